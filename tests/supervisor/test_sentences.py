"""What a supervisor can say, what must be true when it does, and the test that shows it.

A sentence that is not in the table fails here, and so does one that nobody says any more. What the
node `chatter_supervisor` adds is in `nodes/test_sentences.py`.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from support.spoken import sentences, unshown

import lathe_chatter.supervisor

HERE = Path(lathe_chatter.supervisor.__file__).parent
CORE, SEARCH = 'supervisor/test_supervisor.py', 'supervisor/test_move_search.py'
CURED = f'{CORE}::test_chatter_is_ended_by_one_move_to_a_stable_speed'
NOT_KNOWN = f'{CORE}::test_without_a_machine_or_an_amplitude_nothing_is_done'
MARGIN = f'{CORE}::test_a_small_margin_is_warned_of_once'
STOPPED = f'{CORE}::test_vibration_beyond_its_limit_that_does_not_fall_stops_the_lathe'

SAID = {
    'seen_and_done.py': {
        '~/accept does it': (
            'an offer waits to be accepted, and nothing of it was done',
            f'{CORE}::test_in_ask_it_waits',
        ),
        'no machine is known, or the monitor works without it': (
            'it was told none, or what the monitor works with has no machine',
            NOT_KNOWN,
        ),
    },
    'supervisor.py': {
        'I have only just begun to watch': (
            'it was started, or given other parameters, less than hands_off ago',
            f'{CORE}::test_one_that_has_only_just_begun_holds_still_and_blames_nobody',
        ),
        'somebody else has just changed something': (
            'the cut was changed by what it has not sent, less than hands_off ago',
            f'{CORE}::test_hands_off_while_somebody_else_acts',
        ),
        'Somebody else changes the cut: the speed stays where it is on its way.': (
            'the same, amid a ramp of its own, which has ended there',
            f'{CORE}::test_a_hand_amid_a_ramp_leaves_the_speed_where_it_is',
        ),
        'Nothing more is done, for {}.': (
            'the lathe has refused what was asked, or not answered; until the chatter has ended',
            f'{CORE}::test_a_refusal_is_said_and_ends_the_attempts',
        ),
        'Nothing is waiting to be accepted.': (
            'somebody accepts, and there is no offer, or none any more',
            f'{CORE}::test_an_offer_lapses_when_somebody_changes_the_cut',
        ),
        'the lathe has begun again': (
            'its times have gone back, or it is another one',
            f'{CORE}::test_an_offer_of_a_run_before_does_not_stand_in_another',
        ),
        'the cut has changed': (
            'it is not the one for which the offer was made',
            (
                f'{CORE}::'
                'test_an_offer_is_not_accepted_for_another_cut_or_while_something_is_in_the_way'
            ),
        ),
        'What was offered is withdrawn, for {}.': (
            'an offer was waiting to be accepted, and cannot be any more',
            f'{CORE}::test_an_offer_lapses_when_somebody_changes_the_cut',
        ),
        'Nothing is done, for {}.': (
            'somebody accepts an offer that was for another cut, or something is in the way',
            (
                f'{CORE}::'
                'test_an_offer_is_not_accepted_for_another_cut_or_while_something_is_in_the_way'
            ),
        ),
        '{}: nothing is done, for {}.': (
            'chatter is flagged, and that is in the way',
            f'{CORE}::test_hands_off_while_somebody_else_acts',
        ),
        'beyond amplitude_limit, {} um': (
            'the vibration has passed that limit for some time, and does not fall',
            STOPPED,
        ),
        '{}, {}: {} stop': ('the same: it has the lathe paused, or would', STOPPED),
        '{}: {} set {} ({})': ('it asks the lathe for these changes, or would', CURED),
        ' that was not tried': (
            'against this chatter a move was made',
            f'{CORE}::test_after_moves_that_were_no_cure_nothing_is_said_of_those_that_were_made',
        ),
        'no move within the limits{} is predicted to help': (
            'for none of the machines that this may be a cut within the limits is enough',
            f'{CORE}::test_where_nothing_helps_a_person_has_to_decide',
        ),
        '{}: {}; a person has to decide.': (
            'the same; it looks again',
            f'{CORE}::test_where_nothing_helps_a_person_has_to_decide',
        ),
        'I would': (
            'its mode is shadow or ask, or it has made as many moves as it may',
            f'{CORE}::test_a_move_more_than_it_may_make_is_asked_for',
        ),
        ', but only watch.': (
            'its mode is shadow: nothing is done, and nothing can be accepted',
            f'{CORE}::test_in_shadow_it_says_once_what_it_would_do',
        ),
        ', as was accepted.': (
            'somebody has accepted the offer, and it is asked of the lathe',
            f'{CORE}::test_in_ask_it_waits',
        ),
        '1 move was': (
            'it may make one',
            f'{CORE}::test_a_move_more_than_it_may_make_is_asked_for',
        ),
        '{} moves were': (
            'it may make so many',
            f'{CORE}::test_a_move_more_than_it_may_make_is_asked_for',
        ),
        ' {} no cure.': (
            'it has made as many as it may by itself, and the flag is up',
            f'{CORE}::test_a_move_more_than_it_may_make_is_asked_for',
        ),
        ': {}.{}': (
            'an offer waits to be accepted',
            f'{CORE}::test_a_move_more_than_it_may_make_is_asked_for',
        ),
        'the amplitude is not known': (
            'chatter is flagged, and the monitor gives no amplitude',
            NOT_KNOWN,
        ),
        ', {} s after the flag': (
            'it has seen the flag rise so long before it fell',
            f'{CORE}::test_of_a_flag_that_was_up_before_no_time_is_said',
        ),
        'The chatter has ended{}; {} {}.': (
            'the flag has fallen, and the monitor judges the cut',
            f'{CORE}::test_a_flag_that_falls_without_a_judgement_is_no_end_of_the_chatter',
        ),
        'less than margin_limit, {} %': ('the margin has been so for a second', MARGIN),
        'The depth is at or beyond the limit: its margin is {} %, {}': (
            'the same, and the margin is not above 0',
            MARGIN,
        ),
        'The depth may grow by {} % only, {}': ('the same, and the margin is above 0', MARGIN),
        'growing at': (
            'the growth rate is above 0',
            f'{CORE}::test_what_does_not_grow_is_not_said_to_grow',
        ),
        'growth rate': (
            'the growth rate is not above 0',
            f'{CORE}::test_what_does_not_grow_is_not_said_to_grow',
        ),
        'at {} Hz': ('the monitor gives that frequency', NOT_KNOWN),
        '{} {} 1/s': (
            'the monitor gives that growth rate',
            f'{CORE}::test_what_does_not_grow_is_not_said_to_grow',
        ),
        'amplitude {} um': (
            'the monitor gives that amplitude',
            f'{CORE}::test_what_does_not_grow_is_not_said_to_grow',
        ),
        'Chatter {}': ('the flag is up', NOT_KNOWN),
    },
    'move_search.py': {
        'above slowest_speed, which is {} rev/min': (
            'fastest_speed is not: the limits are refused',
            f'{SEARCH}::test_a_range_without_a_speed_is_refused',
        ),
        '{} from {} to {}': ('a change that is asked for: what is so, and what would be', CURED),
        ', margin {} %': (
            'by so much the depth could still grow on the machine as it was told',
            f'{SEARCH}::test_what_is_expected_of_a_move_is_said_in_words',
        ),
        '{} % of the removal rate': (
            'speed, depth and feed of the move give so much of the present one',
            f'{SEARCH}::test_what_is_expected_of_a_move_is_said_in_words',
        ),
        'at least ': (
            'a move was taken that need not suit all of them',
            f'{SEARCH}::test_what_is_expected_of_a_move_is_said_in_words',
        ),
        'on {}{} of {} machines that this may be': (
            'it was tried on so many that were drawn, and is stable on so many of them',
            f'{SEARCH}::test_what_is_expected_of_a_move_is_said_in_words',
        ),
        'predicted: growth {} 1/s{}, {}; stable {}': (
            'the greatest growth rate of the machine as it was told, in the new cut',
            f'{SEARCH}::test_what_is_expected_of_a_move_is_said_in_words',
        ),
    },
}
NO_SENTENCE = {
    # What a limit is, in the table of the parameters.
    'slowest spindle speed to go to', 'fastest spindle speed to go to', 'rev/min per s',
    'change of the spindle speed at most, by a move and by a variation',
    'smallest depth of cut to go to', 'smallest feed per revolution to go to',
    'largest amplitude of a speed variation, fraction of the speed; 0: none',
    'vibration of the tool beyond which growing chatter is stopped, and none goes on its way',
    'moves by itself against one chatter',
    # For programmers, of every package whose names are loaded when they are used.
    'module {} has no attribute {}',
}  # fmt: skip


@pytest.mark.parametrize('module', sorted(module.name for module in HERE.glob('*.py')))
def test_the_table_has_what_a_module_says_and_nothing_else(module: str) -> None:
    assert set(sentences(HERE / module, NO_SENTENCE)) == set(SAID.get(module, {}))


@pytest.mark.parametrize('module', SAID)
def test_every_sentence_has_a_test_that_shows_when_it_is_true(module: str) -> None:
    assert not unshown(SAID, module)
