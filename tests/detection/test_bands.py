"""Where no machine is known the band finds itself: chatter from 50 Hz to 1.5 kHz is found."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from lathe_chatter.detection import ChatterDetector, Estimate
from lathe_chatter.detection.estimate import Mode
from lathe_chatter.detection.filter_design import Band, bands_of
from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model import Mode as Vibration
from lathe_chatter.model.machine_file import load_machine
from lathe_chatter.stability import critical_depth, rightmost_root

MASS = {50.0: 400.0, 400.0: 20.0, 1500.0: 1.0}


def onset(hertz: float, rate: float) -> tuple[list[Estimate], complex]:
    """4 s of a stable cut and 3 s of chatter on a machine of that frequency, none told."""
    tool = Vibration(MASS[hertz], 2.0 * math.pi * hertz, 0.02)
    machine = Machine(
        tool=tool,
        workpiece=Vibration(2.0 * tool.mass, 1.9 * tool.natural_frequency, 0.03),
        bearing_stiffness=0.0,
        cutting_coefficient=1e9,
    )
    rpm = 60.0 * hertz / 3.4
    limit = critical_depth(machine, rpm, seated=False)
    noise = 1e-9 * tool.stiffness / math.sqrt(hertz)
    quiet = Cut(
        spindle_speed_rpm=rpm, depth_of_cut=0.6 * limit, bearing_contact='none', force_noise=noise
    )
    lathe, detector = VirtualLathe(machine, cut=quiet, sample_rate=rate), ChatterDetector(None)
    found, size = [], round(0.02 * rate)
    for block in range(350):
        if block == 200:
            lathe.retune(quiet.with_changes(depth_of_cut=1.5 * limit))
        found.append(detector.update(lathe.advance(size), lathe.columns))
    return found, rightmost_root(machine, rpm, 1.5 * limit, seated=False)


@pytest.mark.parametrize(('hertz', 'rate'), [(50.0, 2e3), (400.0, 1e4), (1500.0, 2e4)])
def test_chatter_of_any_frequency_is_found_at_it(hertz: float, rate: float) -> None:
    found, root = onset(hertz, rate)
    assert not any(each.chatter for each in found[:200])
    flag = next(k for k in range(200, 350) if found[k].chatter)
    later = found[min(flag + 5, 349)]
    assert later.mode is Mode.NO_MACHINE
    assert later.frequency == pytest.approx(root.imag / 2.0 / math.pi, rel=0.01)


@pytest.mark.parametrize(('depth', 'is_chatter'), [(0.5e-3, True), (0.25e-3, False)])
def test_chatter_that_noise_has_raised_at_once_is_found(depth: float, is_chatter: bool) -> None:
    """It is full grown before there is any baseline, and noise rises above that as much as it."""
    described = load_machine('chucked_shaft')
    cut = described.cut.with_changes(depth_of_cut=depth, force_noise=0.5)
    lathe, detector = VirtualLathe(described.machine, cut=cut), ChatterDetector(None)
    found = [detector.update(lathe.advance(200), lathe.columns) for _ in range(300)]
    assert any(each.chatter for each in found) is is_chatter
    if is_chatter:
        flag = next(k for k in range(300) if found[k].chatter)
        assert flag < 150
        assert all(each.chatter for each in found[flag:])
        assert np.median([each.frequency for each in found[flag:]]) == pytest.approx(
            317.0, abs=1.0
        )


def test_nothing_is_looked_for_beyond_what_the_rate_can_tell() -> None:
    """A tone of 1.4 kHz sampled at 2 kHz comes as 600 Hz: all that is said is below 1 kHz."""
    time = np.arange(20_000) / 2e3
    sound = np.cos(2.0 * np.pi * 1400.0 * time)
    estimate = ChatterDetector(None).update(np.column_stack([time, sound]), ('time', 'sound'))
    assert not estimate.frequency > 1e3
    asked = ChatterDetector(None, highest_frequency=1500.0)
    estimate = asked.update(np.column_stack([time, sound]), ('time', 'sound'))
    assert estimate.mode is Mode.TOO_SLOW
    assert math.isnan(estimate.frequency)


def test_bounds_that_are_none_are_refused() -> None:
    with pytest.raises(ParameterError, match='highest_frequency'):
        ChatterDetector(None, lowest_frequency=500.0, highest_frequency=400.0)


def test_the_bands_cover_the_whole_and_none_is_wide() -> None:
    bands = bands_of(Band(20.0, 5000.0))
    assert bands[0].low == pytest.approx(20.0)
    assert bands[-1].high == pytest.approx(5000.0)
    for one, other in itertools.pairwise(bands):
        assert one.high == other.low
        assert one.high / one.low < 5.0
