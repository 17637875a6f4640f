"""VirtualLathe against the independent references, over the paper's runs and its worst cases.

What is measured here at 10000 samples per second is stated beside each bar.
"""

from __future__ import annotations

from typing import Any

import pytest
from support.reference import dop853, taylor
from support.reference.solution import Event, Solution, event_error, relative_error

from lathe_chatter.lathe import EventKind, VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine, Mode

_RATE = 1e4
_UNLIMITED = 1e12  # the paper's linear runs grow beyond any lathe

_EVENTS = {
    EventKind.BEARING_ENGAGES: ('bearing', True),
    EventKind.BEARING_RELEASES: ('bearing', False),
    EventKind.TOOL_ENTERS_CUT: ('chip', True),
    EventKind.TOOL_LEAVES_CUT: ('chip', False),
}

_PAPER_OPEN = [(3000.0, 0.5), (10000.0, 0.5), (3000.0, 1.0), (10000.0, 1.0)]
"""Speed in rev/min and depth of cut in mm of the runs without bearing clearance."""

_PAPER_CLEARANCE = [
    (60.0, 3000.0, 0.5),
    (60.0, 10000.0, 0.5),
    (60.0, 3000.0, 1.0),
    (60.0, 10000.0, 1.0),
    (80.0, 3000.0, 0.5),
    (110.0, 3000.0, 0.5),
    (80.0, 3000.0, 1.0),
    (110.0, 3000.0, 1.0),
    (5.0, 3000.0, 0.5),
    (5.0, 10000.0, 0.5),
]
"""The same with a clearance in um."""

_PAPER_RUNS = (
    [Cut(rpm, 1e-3 * depth, bearing_contact=BearingContact.NONE) for rpm, depth in _PAPER_OPEN]
    + [
        Cut(rpm, 1e-3 * depth, 1e-6 * clearance, contact)
        for contact in (BearingContact.SEATED, BearingContact.GAP)
        for clearance, rpm, depth in _PAPER_CLEARANCE
    ]
)  # fmt: skip


def _name(cut: Cut) -> str:
    clearance = f'{1e6 * cut.bearing_clearance:g}um'
    return (
        f'{cut.bearing_contact.value}-{clearance}-{cut.spindle_speed_rpm:g}rpm'
        f'-{1e3 * cut.depth_of_cut:g}mm'
    )


def _run(cut: Cut, duration: float, machine: Machine | None = None, **settings: Any) -> Solution:
    lathe = VirtualLathe(machine, cut, displacement_limit=_UNLIMITED, **settings)
    samples = lathe.advance(round(duration * lathe.sample_rate))
    assert not lathe.guard
    events = tuple(Event(event.time, *_EVENTS[event.kind]) for event in lathe.events)
    return Solution(samples[:, 2:6], events)


@pytest.mark.parametrize('cut', _PAPER_RUNS, ids=_name)
def test_the_papers_runs_agree_with_dop853(cut: Cut) -> None:
    """Measured: 8.2e-11 at most, of which DOP853 itself has up to 2.6e-11."""
    reference = dop853.solve(Machine(), cut, 0.4, sample_rate=_RATE, tool_leaves_cut=False)
    run = _run(cut, 0.4, tool_leaves_cut=False)
    assert relative_error(run.states, reference.states, _RATE) < 5e-10
    assert event_error(run.events, reference.events) < 1e-9


@pytest.mark.parametrize('rpm', [3000.0, 10000.0])
@pytest.mark.parametrize(
    ('law', 'contact', 'clearance'),
    [
        ('linear', BearingContact.NONE, 5e-6),
        ('linear', BearingContact.GAP, 60e-6),
        ('linear', BearingContact.GAP, 5e-6),
        ('total', BearingContact.NONE, 5e-6),
        ('total', BearingContact.GAP, 5e-6),  # chatter never reaches 60 um with this law
    ],
)
def test_a_second_agrees_with_thirty_digits(
    rpm: float, law: str, contact: BearingContact, clearance: float
) -> None:
    """Measured: 1.6e-10 at most; event times within 1.4e-13 s."""
    total = law == 'total'
    cut = Cut(rpm, 1e-3, clearance, contact)
    reference = taylor.solve(Machine(), cut, 1.0, sample_rate=_RATE, tool_leaves_cut=total)
    run = _run(cut, 1.0, tool_leaves_cut=total)
    assert relative_error(run.states, reference.states, _RATE) < 1e-9
    assert event_error(run.events, reference.events) < 1e-9
    touches = any(event.kind == 'bearing' for event in run.events)
    assert touches == (contact is BearingContact.GAP)
    assert total == any(event.kind == 'chip' for event in run.events)


@pytest.mark.parametrize('law', ['linear', 'total'])
@pytest.mark.parametrize('rpm', [2999.7, 8123.45, 29999.0, 613.0])
def test_a_turn_need_not_be_a_whole_number_of_samples(rpm: float, law: str) -> None:
    """Measured: 1.2e-10 at most; event times within 7.1e-13 s."""
    total = law == 'total'
    cut = Cut(rpm, 1.5e-3, 2e-6, BearingContact.GAP)
    reference = taylor.solve(Machine(), cut, 0.3, sample_rate=_RATE, tool_leaves_cut=total)
    run = _run(cut, 0.3, tool_leaves_cut=total)
    assert relative_error(run.states, reference.states, _RATE) < 1e-9
    assert event_error(run.events, reference.events) < 1e-9
    assert run.events


@pytest.mark.parametrize('law', ['linear', 'total'])
def test_a_stiff_bearing_and_undamped_modes(law: str) -> None:
    """A bearing ten times as stiff as the spindle, met some hundred times.

    Measured: 5.3e-11 at most.
    """
    machine = Machine(Mode(0.05, 775.0, 0.0), Mode(0.2, 400.0, 0.0), bearing_stiffness=3.2e5)
    cut = Cut(3000.0, 0.5e-3, 1e-6, BearingContact.GAP)
    reference = taylor.solve(
        machine, cut, 0.5, sample_rate=_RATE, tool_leaves_cut=law == 'total', piece=2.5e-4
    )
    run = _run(cut, 0.5, machine, tool_leaves_cut=law == 'total')
    assert relative_error(run.states, reference.states, _RATE, machine) < 1e-9
    assert event_error(run.events, reference.events) < 1e-9
    assert len(run.events) > 50


@pytest.mark.parametrize('overlap', [1e-2, 1e-5, 1e-8])
def test_a_touch_much_shorter_than_a_step_is_not_missed(overlap: float) -> None:
    """The clearance lies just below a peak; a touch lasts 0.26 us at the smallest overlap."""
    open_cut = Cut(3000.0, 1e-3, bearing_contact=BearingContact.NONE)
    path = taylor.solve(Machine(), open_cut, 0.1, sample_rate=1e5, tool_leaves_cut=False)
    x = path.states[:, 2]
    i = int(x[:-1].argmax())
    assert x[i - 1] < x[i] > x[i + 1]
    peak = x[i] - (x[i + 1] - x[i - 1]) ** 2 / (8.0 * (x[i + 1] - 2.0 * x[i] + x[i - 1]))
    clearance = float(peak * (1.0 - overlap))
    cut = open_cut.with_changes(
        bearing_contact=BearingContact.GAP, bearing_clearance=clearance
    )  # fmt: skip
    duration = (i + 50) * 1e-5
    reference = taylor.solve(Machine(), cut, duration, sample_rate=_RATE, tool_leaves_cut=False)
    run = _run(cut, duration, tool_leaves_cut=False)
    assert [event.begins for event in run.events] == [True, False]
    assert event_error(run.events, reference.events) < 1e-9


def test_the_error_falls_with_the_sixth_power_of_the_step() -> None:
    """Events included: 511 of them in this run's second."""
    cut = Cut(3000.0, 1e-3, 5e-6, BearingContact.GAP)
    errors = []
    for rate in (8e3, 16e3):
        reference = taylor.solve(Machine(), cut, 0.3, sample_rate=rate)
        errors.append(
            relative_error(_run(cut, 0.3, sample_rate=rate).states, reference.states, rate)
        )
    assert errors[0] > 2**5.5 * errors[1]
