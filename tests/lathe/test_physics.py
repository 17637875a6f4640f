"""Laws that the virtual lathe must obey, whatever its method: no tolerance here is tuned.

Bounds come from rounding (the number of steps times the spacing of doubles), from the digits
that a published figure has, or from an order of convergence.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from lathe_chatter.array_types import Array
from lathe_chatter.lathe import EventKind, VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine, Mode

_RATE = 1e4
_EPSILON = float(np.finfo(float).eps)

_ROOTS = [  # reproduction: contact, rev/min, depth in mm, growth rate 1/s, frequency rad/s
    ('none', 3000.0, 0.5, -8.999066, 825.483211),
    ('none', 10000.0, 0.5, -7.240068, 794.924220),
    ('none', 3000.0, 1.0, 13.652715, 847.585268),
    ('none', 10000.0, 1.0, 21.598456, 816.172885),
    ('seated', 3000.0, 0.5, 1.708234, 845.306344),
    ('seated', 10000.0, 0.5, 4.349768, 822.140171),
    ('seated', 3000.0, 1.0, 19.182492, 867.884034),
    ('seated', 10000.0, 1.0, 28.772325, 847.879127),
]


def _root_of(signal: Array, interval: float) -> complex:
    """The lambda of a signal that is one decaying or growing vibration, by linear prediction.

    y[k] = 2 Re(z) y[k-1] - |z|^2 y[k-2] with z = exp(lambda interval), by least squares on
    windows that are scaled to one size, so that every one of them counts.
    """
    rows = np.lib.stride_tricks.sliding_window_view(signal, 3)
    rows = rows / np.abs(rows).max(axis=1, keepdims=True)
    (first, second), *_ = np.linalg.lstsq(rows[:, 1::-1], rows[:, 2], rcond=None)
    z = np.roots([1.0, -first, -second])
    return complex(np.log(z[np.argmax(z.imag)])) / interval


@pytest.mark.parametrize(('contact', 'rpm', 'depth', 'growth', 'frequency'), _ROOTS)
def test_a_linear_run_grows_with_the_rightmost_root(
    contact: str, rpm: float, depth: float, growth: float, frequency: float
) -> None:
    """To the six decimals that the root is given with. A velocity has no constant part."""
    cut = Cut(rpm, 1e-3 * depth, bearing_contact=BearingContact(contact))
    lathe = VirtualLathe(cut=cut, tool_leaves_cut=False, displacement_limit=1e12)
    lathe.advance(12_000)
    velocity = lathe.advance(2_000)[:, 3]
    found = _root_of(velocity[::10], 10.0 / _RATE)
    assert found.real == pytest.approx(growth, abs=1e-6)
    assert found.imag == pytest.approx(frequency, abs=1e-6)


def _free(mode: Mode, stiffness: float, rest: float, start: Array, t: Array) -> Array:
    """x(t) of m x'' + c x' + k (x - rest) = 0 in closed form."""
    decay = mode.damping / (2.0 * mode.mass)
    omega = np.sqrt(stiffness / mode.mass - decay**2)
    x, v = start[0] - rest, start[1]
    swing = x * np.cos(omega * t) + (v + decay * x) / omega * np.sin(omega * t)
    return rest + np.exp(-decay * t) * swing


@pytest.mark.parametrize('contact', ['none', 'seated'])
@pytest.mark.parametrize('total', [True, False])
def test_without_depth_each_mode_decays_with_its_own_damping(contact: str, *, total: bool) -> None:
    machine = Machine(Mode(0.05, 775.0, 0.02), Mode(0.08, 650.0, 0.005))
    start = np.array([1e-5, -0.01, 2e-5, 0.02])
    cut = Cut(3000.0, 0.0, bearing_contact=BearingContact(contact))
    lathe = VirtualLathe(machine, cut, tool_leaves_cut=total, initial_state=start)
    samples = lathe.advance(10_000)
    t = samples[:, 0]
    seated = contact == 'seated'
    stiffness = machine.workpiece_stiffness(seated=seated)
    rest = cut.bearing_clearance * machine.bearing_stiffness / stiffness if seated else 0.0
    tool = _free(machine.tool, machine.tool.stiffness, 0.0, start[:2], t)
    workpiece = _free(machine.workpiece, stiffness, rest, start[2:], t)
    rounding = len(samples) * _EPSILON
    assert np.abs(samples[:, 2] - tool).max() < rounding * np.abs(tool).max()
    assert np.abs(samples[:, 4] - workpiece).max() < rounding * np.abs(workpiece).max()
    assert not samples[:, 7].any()


@pytest.mark.parametrize('contact', ['none', 'gap', 'seated'])
def test_undamped_and_uncut_energy_is_conserved(contact: str) -> None:
    """Across a thousand contacts, with the bearing's elastic energy where it carries."""
    machine = Machine(Mode(0.05, 775.0, 0.0), Mode(0.05, 650.0, 0.0), bearing_stiffness=1e5)
    cut = Cut(3000.0, 0.0, 5e-6, BearingContact(contact))
    lathe = VirtualLathe(machine, cut, initial_state=(1e-5, 0.0, 0.0, 0.02))
    samples = lathe.advance(50_000)
    x, v, y, w = samples[:, 2:6].T
    pressed = y - cut.bearing_clearance
    if contact == 'gap':
        pressed = np.maximum(pressed, 0.0)
        met = [event for event in lathe.events if event.kind is EventKind.BEARING_ENGAGES]
        assert len(met) > 500
    bearing = 0.0 if contact == 'none' else machine.bearing_stiffness
    energy = 0.5 * (
        0.05 * v**2 + machine.tool.stiffness * x**2
        + 0.05 * w**2 + machine.workpiece.stiffness * y**2 + bearing * pressed**2
    )  # fmt: skip
    # Every step rounds both displacement and velocity, and energy is their square.
    assert np.abs(energy / energy[0] - 1.0).max() < 4.0 * len(samples) * _EPSILON


def _residual(rate: float) -> tuple[float, float, float]:
    """How far successive samples are from the equations of motion, and steps of both forces."""
    machine, cut = Machine(), Cut(3000.0, 1e-3, 5e-6, BearingContact.GAP)
    lathe = VirtualLathe(machine, cut, sample_rate=rate)
    samples = lathe.advance(round(0.2 * rate))
    kinds = {event.kind for event in lathe.events}
    assert kinds == set(EventKind)
    x, v, y, w = samples[:, 2:6].T
    force = samples[:, 7]
    bearing = machine.bearing_stiffness * np.maximum(y - cut.bearing_clearance, 0.0)
    tool, workpiece = machine.tool, machine.workpiece
    on_tool = -tool.stiffness * x - tool.damping * v - force
    on_workpiece = -workpiece.stiffness * y - workpiece.damping * w + force - bearing
    miss = 0.0
    for mass, velocity, pull in ((0.05, v, on_tool), (0.05, w, on_workpiece)):
        mean = 0.5 * (pull[1:] + pull[:-1])
        miss = max(miss, float(np.abs(mass * np.diff(velocity) * rate - mean).max()))
    return miss, float(np.abs(np.diff(force)).max()), float(np.abs(np.diff(bearing)).max())


def test_contact_forces_are_continuous() -> None:
    """A force that jumped would miss the balance, or step, by the same at every sample rate.

    The samples meet the balance of forces with the error of the trapezoidal rule: of second
    order but for the kinks of contact, of first order at them.
    """
    coarse, fine = _residual(1e4), _residual(4e4)
    for at_coarse, at_fine in zip(coarse, fine, strict=True):
        assert at_fine == pytest.approx(0.0, abs=at_coarse / 3.5)


def test_contact_follows_the_displacement() -> None:
    lathe = VirtualLathe(cut=Cut(3000.0, 1e-3, 5e-6))
    for _ in range(3000):
        sample = lathe.advance(1)[0]
        assert lathe.bearing_engaged == (sample[4] >= 5e-6)
        assert lathe.tool_in_cut == (sample[7] > 0.0)
        assert (sample[6] > 0.0) == lathe.tool_in_cut


def _saturated(rate: float) -> tuple[float, float, float]:
    """Amplitudes of tool and workpiece, peak to peak, and the share of time out of cut."""
    lathe = VirtualLathe(
        cut=Cut(3000.0, 1e-3, bearing_contact=BearingContact.NONE), sample_rate=rate
    )
    lathe.advance(round(4.0 * rate))
    samples = lathe.advance(round(1.0 * rate))
    events = lathe.events
    pairs = itertools.pairwise(events)
    inside = [b.time - a.time for a, b in pairs if a.kind is EventKind.TOOL_LEAVES_CUT]
    ends = 5.0 - events[-1].time if events[-1].kind is EventKind.TOOL_LEAVES_CUT else 0.0
    starts = events[0].time - 4.0 if events[0].kind is EventKind.TOOL_ENTERS_CUT else 0.0
    share = (sum(inside) + ends + starts) / 1.0
    assert share == pytest.approx((samples[:, 6] == 0.0).mean(), abs=len(events) / rate)
    return float(np.ptp(samples[:, 2])), float(np.ptp(samples[:, 4])), share


def test_saturated_chatter_converges_as_the_step_is_refined() -> None:
    """3000 rev/min, 1 mm, feed 50 um: 76 um at the tool, 34 um at the workpiece, 35 % out."""
    coarse, medium, fine = (_saturated(rate) for rate in (1e4, 2e4, 8e4))
    assert fine[0] == pytest.approx(76e-6, abs=0.5e-6)
    assert fine[1] == pytest.approx(34e-6, abs=0.5e-6)
    assert fine[2] == pytest.approx(0.35, abs=0.005)
    for rate, found in ((1e4, coarse), (2e4, medium)):
        # A peak lies at most half a sample from one: (omega / rate)^2 / 8 of it at each end.
        seen = (850.0 / rate) ** 2 / 8.0
        assert found[0] == pytest.approx(fine[0], rel=seen)
        assert found[1] == pytest.approx(fine[1], rel=seen)
    assert abs(medium[2] - fine[2]) < 1e-6
    assert abs(coarse[2] - fine[2]) < 1e-6


@pytest.mark.parametrize('rate', [1e4, 4e4])
@pytest.mark.parametrize(
    ('velocity', 'lasting'),
    [(0.0025, False), (0.01, False), (0.02, False), (0.05, True), (0.1, False), (0.25, False)],
)
def test_the_bistable_cut_has_all_of_its_outcomes(
    rate: float, velocity: float, *, lasting: bool
) -> None:
    """Chatter of 41.9 um, or less after each second than after the one before."""
    lathe = VirtualLathe(
        cut=Cut(3000.0, 0.65e-3, 10e-6), sample_rate=rate, initial_state=(0.0, velocity, 0.0, 0.0)
    )
    lathe.advance(round(8.0 * rate))
    ninth, tenth = (float(np.ptp(lathe.advance(round(rate))[:, 2])) for _ in range(2))
    if lasting:
        assert ninth == pytest.approx(41.9e-6, abs=0.05e-6)
        assert tenth == pytest.approx(ninth, rel=1e-3)
    else:
        assert tenth < 0.5 * ninth < 1e-6


@pytest.mark.parametrize(('depth', 'lasting'), [(0.55, False), (0.59, False), (0.60, True)])
def test_a_cut_begun_at_rest_chatters_from_the_seating_line_on(
    depth: float, *, lasting: bool
) -> None:
    """Though the open limit is 0.665 mm: gamma = 5 um, feed 50 um, 3000 rev/min."""
    lathe = VirtualLathe(cut=Cut(3000.0, 1e-3 * depth, 5e-6), initial_state=(0.0,) * 4)
    lathe.advance(150_000)
    samples = lathe.advance(10_000)
    if lasting:
        assert np.ptp(samples[:, 2]) == pytest.approx(38e-6, abs=0.5e-6)
    else:
        assert np.ptp(samples[:, 2]) < 1e-12


@pytest.mark.parametrize('side', [-1e-3, 1e-3])
def test_the_seating_line_is_where_it_says(side: float) -> None:
    """w = k_wp gamma / (C f): just below it a whisper at the equilibrium dies, above it grows.

    The workpiece then stands 5 nm before or beyond its contact, so the line is met to 0.1 %.
    """
    machine, clearance, feed = Machine(), 5e-6, 50e-6
    stiffness = machine.workpiece.stiffness
    line = stiffness * clearance / (machine.cutting_coefficient * feed)
    assert line == pytest.approx(0.6036e-3, abs=0.5e-7)
    depth = line * (1.0 + side)
    force = machine.cutting_coefficient * depth * feed
    rest = force / stiffness
    if rest > clearance:
        rest = (force + machine.bearing_stiffness * clearance) / (
            stiffness + machine.bearing_stiffness
        )
    at_rest = (-force / machine.tool.stiffness, 1e-9, rest, 0.0)
    lathe = VirtualLathe(machine, Cut(3000.0, depth, clearance), initial_state=at_rest)
    assert lathe.bearing_engaged == (side > 0.0)
    lathe.advance(150_000)
    last = lathe.advance(10_000)
    if side < 0.0:
        assert np.abs(last[:, 4] - rest).max() < 1e-15
        assert last[-1, 7] == pytest.approx(force, rel=1e-9)
    else:
        assert np.ptp(last[:, 2]) == pytest.approx(38.5e-6, rel=0.05)


def test_a_stable_cut_ends_at_its_static_deflection() -> None:
    """-C w f / k_t and C w f / k_wp: the mean chip is carried by both springs."""
    machine, cut = Machine(), Cut(3000.0, 0.5e-3, bearing_contact=BearingContact.NONE)
    lathe = VirtualLathe(machine, cut)
    last = lathe.advance(50_000)[-1]
    force = machine.cutting_coefficient * cut.depth_of_cut * cut.feed
    assert last[7] == pytest.approx(force, rel=1e-12)
    assert last[6] == pytest.approx(cut.feed, rel=1e-12)
    assert last[2] == pytest.approx(-force / machine.tool.stiffness, rel=1e-12)
    assert last[4] == pytest.approx(force / machine.workpiece.stiffness, rel=1e-12)
    assert last[[3, 5]] == pytest.approx([0.0, 0.0], abs=1e-15)


def test_what_is_removed_is_what_was_fed() -> None:
    """In chatter too the mean chip per turn is the feed: nothing is cut twice, nothing is lost.

    h(t) = S(t) - S(t - tau) sums up to the surface of the last turn, which is at most one
    amplitude from where the feed stands.
    """
    cut = Cut(3000.0, 1e-3, bearing_contact=BearingContact.NONE)
    lathe = VirtualLathe(cut=cut)
    samples = lathe.advance(100_000)  # 500 turns of 200 samples
    removed = samples[:, 6].reshape(500, 200).sum(axis=0)
    bound = np.ptp(samples[:, 2] - samples[:, 4]) + cut.feed
    assert np.abs(removed - 500.0 * cut.feed).max() < bound


def test_a_knock_is_a_jump_of_velocity_and_nothing_else() -> None:
    """Two runs that differ by a knock differ by the free response of the linear machine."""
    machine, cut = Machine(), Cut(3000.0, 0.0, bearing_contact=BearingContact.NONE)
    quiet, knocked = (VirtualLathe(machine, cut, tool_leaves_cut=False) for _ in range(2))
    quiet.advance(137)
    knocked.advance(137)
    knocked.knock(2e-3)
    difference = (knocked.advance(500) - quiet.advance(500))[:, 2]
    t = np.arange(1, 501) / _RATE
    response = _free(machine.tool, machine.tool.stiffness, 0.0, np.array([0.0, 0.04]), t)
    assert np.abs(difference - response).max() < 1000 * _EPSILON * np.abs(response).max()
