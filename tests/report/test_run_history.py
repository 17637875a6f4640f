"""What a run's record tells of its spindle."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.histories import history_of

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.change_and_knock_sentences import Change
from lathe_chatter.model import Cut
from lathe_chatter.report.monitor_record import Flag
from lathe_chatter.report.run_excerpts import excerpts_of
from lathe_chatter.report.run_history import History, in_words
from lathe_chatter.samples import SAMPLE_COLUMNS


def history(parts: list[np.ndarray], changes: list[Change], acceleration: float) -> History:
    samples = dict(zip(SAMPLE_COLUMNS, np.concatenate(parts).T, strict=True))
    return history_of(samples, changes=changes, spindle_acceleration=acceleration)


def speed_change(time: float, speed: float) -> Change:
    return Change(time, {}, {'spindle_speed_rpm': speed})


@pytest.mark.parametrize('acceleration', [0.0, 1000.0])
def test_the_speed_is_the_one_that_the_spindle_turned_with(acceleration: float) -> None:
    """Also where a ramp is turned round on its way."""
    lathe = VirtualLathe(spindle_acceleration=acceleration)
    parts, changes = [lathe.advance(5000)], []
    for speed, count in ((4000.0, 6000), (2500.0, 30_000)):
        changes.append(speed_change(lathe.time, speed))
        lathe.retune(lathe.cut.with_changes(spindle_speed_rpm=speed))
        parts.append(lathe.advance(count))
    run = history(parts, changes, acceleration)
    time, angle = np.concatenate(parts)[:, :2].T
    between = 0.5 * (time[1:] + time[:-1])
    turned = 60.0 * np.diff(angle) / np.diff(time)
    # Corners apart, where it turns with both in one sample.
    places = list(range(50, len(between), 997))
    assert [run.speed_at(between[k]) for k in places] == pytest.approx(turned[places], rel=1e-6)
    assert run.cut_at(lathe.time).spindle_speed_rpm == 2500.0


def test_steps_close_upon_each_other_are_told_as_one() -> None:
    """A supervisor makes a ramp of ten and more; what somebody else does is told apart."""
    changes = [speed_change(1.0, 3100.0)]
    changes += [speed_change(2.0 + 0.04 * k, 3200.0 + 100.0 * k) for k in range(5)]
    changes += [Change(2.17, {}, {'depth_of_cut': 4e-4}), speed_change(2.2, 4000.0)]
    run = history([VirtualLathe().advance(30_000)], changes, 0.0)
    assert [(round(each.time, 3), in_words(each)) for each in run.in_order()] == [
        (1.0, '3100 rev/min'),
        (2.16, '3600 rev/min, in 5 steps since 2.000 s'),
        (2.17, 'depth 0.4 mm'),
        (2.2, '4000 rev/min'),
    ]
    assert run.speed_at(2.1) == 3400.0


def test_a_ramp_is_no_part_of_what_is_looked_at_closely() -> None:
    lathe = VirtualLathe(spindle_acceleration=2000.0)
    parts = [lathe.advance(10_000)]
    lathe.retune(lathe.cut.with_changes(spindle_speed_rpm=5000.0))
    parts.append(lathe.advance(15_000))
    run = history(parts, [speed_change(1.0, 5000.0)], 2000.0)
    last = excerpts_of(run)[-1]
    assert last.samples['time'][0] > 2.0
    assert last.cut.spindle_speed_rpm == 5000.0


def test_a_record_that_begins_late_has_full_panels() -> None:
    lathe = VirtualLathe(cut=Cut(depth_of_cut=1e-3))
    lathe.advance(1_000_000)
    run = history([lathe.advance(10_000)], [speed_change(50.0, 3000.0)], 0.0)
    assert run.begin == pytest.approx(100.0001)
    for excerpt in excerpts_of(run):
        assert len(excerpt.samples['time']) >= 2499
        assert excerpt.spectrum('tool_displacement').frequency.size


def test_a_settled_figure_is_no_first_guess() -> None:
    told = np.array([[1.0, 1.02, 1.04, 1.06, 3.0], [1001.8, 207.0, 207.2, math.nan, 50.0]])
    run = history_of({'time': told[0]}, estimates={'frequency': told})
    assert run.settled('frequency', 1.0, 2.0) == 207.2
    assert math.isnan(run.settled('frequency', 1.5, 2.0))
    assert math.isnan(run.settled('growth_rate', 1.0, 2.0))


def test_of_several_alarms_the_longest_is_looked_at_closely() -> None:
    """A short one may be a false alarm."""
    lathe = VirtualLathe()
    run = history([lathe.advance(20_000)], [], 0.0)
    times = ((0.5, True), (0.52, False), (1.0, True), (1.6, False))
    run = replace(run, flags=[Flag(time, up) for time, up in times])
    _, chatter, _ = excerpts_of(run)
    assert (chatter.title, chatter.until) == ('chatter', 1.6)
