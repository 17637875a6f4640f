from __future__ import annotations

import pytest

from lathe_chatter.lathe.change_and_knock_sentences import change_sentence, parse_change
from lathe_chatter.model import BearingContact, Cut

OLD = Cut()


@pytest.mark.parametrize(
    'changes',
    [
        {'depth_of_cut': 0.00062},
        {'spindle_speed_rpm': 1.0 / 3.0 * 1e4, 'bearing_clearance': 1e-7 / 3.0},
        {'bearing_contact': 'none'},
        {'force_noise': 1e-4, 'bearing_contact': 'seated', 'feed_speed': 0.0},
    ],
)
def test_a_change_is_read_back_to_the_last_bit(changes: dict[str, object]) -> None:
    new = OLD.with_changes(**changes)
    change = parse_change(change_sentence(12.3456, OLD, new))
    assert change is not None
    assert change.time == 12.3456
    assert OLD.with_changes(**change.new) == new
    assert new.with_changes(**change.old) == OLD


def test_no_difference_is_no_sentence() -> None:
    assert change_sentence(1.0, OLD, Cut()) == ''


@pytest.mark.parametrize(
    'sentence',
    [
        '',
        'At 1.0 s: knock of 0.1 N s.',
        'At 1.000000 s: mass 1.0 -> 2.0 kg.',
        'At 1.000000 s: depth_of_cut 0.0005 -> 9.0 m.',
        'At 1.000000 s: depth_of_cut -> 0.001 m.',
        'Behind: 0.1 s of simulated time given up so far.',
    ],
)
def test_other_sentences_are_no_changes(sentence: str) -> None:
    assert parse_change(sentence) is None


def test_the_sentence_is_for_people_too() -> None:
    new = OLD.with_changes(depth_of_cut=0.00062, bearing_contact=BearingContact.NONE)
    assert change_sentence(3.0, OLD, new) == (
        'At 3.000000 s: depth_of_cut 0.0005 -> 0.00062 m, bearing_contact gap -> none.'
    )
