"""Machines with several modes, process damping and a bearing on both sides.

Against DOP853 with located events, closed forms, and characteristic roots found by Newton's
method on the dispersion relation itself.
"""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.reference import dop853
from support.reference.solution import Event, event_error

from lathe_chatter.array_types import Array
from lathe_chatter.lathe import EventKind, VirtualLathe
from lathe_chatter.model import Cut, Machine, Mode

_RATE = 1e4


def _modes(count: int, lowest: float, highest: float, share: float) -> list[Mode]:
    """Modes of falling weight, each damped by 5 %."""
    frequencies = np.geomspace(lowest, highest, count) if count > 1 else [lowest]
    weights = np.geomspace(1.0, share, count)
    return [
        Mode(0.05 / weight**2, 2.0 * math.pi * f, 0.05)
        for f, weight in zip(frequencies, weights, strict=True)
    ]


def _machine(count: int) -> Machine:
    """With `count` modes a body, the lowest two of them the paper's."""
    tool, workpiece = _modes(count, 123.0, 600.0, 0.4), _modes(count, 103.0, 540.0, 0.4)
    return Machine(tool, workpiece, bearing_stiffness=1e4)


def _apart() -> Machine:
    """Force, chip and bearing take part in the modes differently, and with either sign."""
    return Machine(
        [Mode(0.05, 775.0, 0.05), Mode(0.1, 2500.0, 0.03, chip=0.6, force=-0.3)],
        [
            Mode(0.05, 650.0, 0.05, bearing=0.7),
            Mode(0.1, 1700.0, 0.04, chip=-0.5, force=-0.4, bearing=0.9),
        ],
        bearing_stiffness=1e4,
    )


def _events(lathe: VirtualLathe) -> list[Event]:
    """As the reference tells them, above and below the clearance alike."""
    names = {
        EventKind.BEARING_ENGAGES: ('bearing', True),
        EventKind.BEARING_RELEASES: ('bearing', False),
        EventKind.TOOL_ENTERS_CUT: ('chip', True),
        EventKind.TOOL_LEAVES_CUT: ('chip', False),
    }
    return [Event(event.time, *names[event.kind]) for event in lathe.events]


def _error(found: Array, expected: Array) -> float:
    """Of displacements over the largest of the last 20 ms."""
    size = np.abs(expected[:, ::2]).max(axis=1)
    padded = np.concatenate([np.zeros(199), size])
    amplitude = np.lib.stride_tricks.sliding_window_view(padded, 200).max(axis=-1)
    return float((np.abs(found - expected)[:, ::2].max(axis=1) / amplitude).max())


_CASES: dict[str, tuple[Machine, dict[str, Any]]] = {
    '2+2': (_machine(2), {}),
    '2+2, any speed': (_machine(2), {'spindle_speed_rpm': 2999.7, 'bearing_clearance': 2e-6}),
    '4+4': (_machine(4), {}),
    '8+8': (_machine(8), {'depth_of_cut': 3e-3}),
    'apart': (_apart(), {}),
    'process damping': (_machine(2), {'process_damping': 3e3}),
    'both sides': (Machine(), {'bearing_contact': 'both_sides', 'bearing_clearance': 3e-6}),
    'both sides, apart': (
        _apart(),
        {'bearing_contact': 'both_sides', 'bearing_clearance': 2e-6, 'process_damping': 1e3},
    ),
}


@pytest.mark.parametrize(('machine', 'changes'), _CASES.values(), ids=_CASES)
def test_contact_and_loss_of_cut_agree_with_dop853(
    machine: Machine, changes: dict[str, Any]
) -> None:
    """In chatter that lasts; the reference's own error is up to 1e-10 here."""
    cut = Cut(3000.0, 1.2e-3, 5e-6).with_changes(**changes)
    reference = dop853.solve(machine, cut, 0.4, sample_rate=_RATE, step=1e-4)
    lathe = VirtualLathe(machine, cut)
    samples = lathe.advance(4000)
    assert _error(samples[:, 2:6], reference.states) < 1e-9
    expected = [
        Event(e.time, 'bearing' if e.kind == 'below' else e.kind, e.begins)
        for e in reference.events
    ]
    assert event_error(_events(lathe), expected) < 1e-9
    assert len(expected) > 20


def test_equal_parts_of_a_mode_move_as_the_whole() -> None:
    """Nearly and wholly equal frequencies are no obstacle."""
    cut = Cut(3000.0, 1e-3, 5e-6)
    whole = VirtualLathe(cut=cut).advance(20_000)
    for parts in (2, 4, 8):
        machine = Machine(
            [Mode(0.05 * parts, 775.0, 0.05)] * parts, [Mode(0.05 * parts, 650.0, 0.05)] * parts,
            bearing_stiffness=Machine().bearing_stiffness,
        )  # fmt: skip
        samples = VirtualLathe(machine, cut).advance(20_000)
        assert _error(samples[:, 2:6], whole[:, 2:6]) < 1e-9


def _random(rng: np.random.Generator) -> Machine:
    """One or two modes a body, with participations of either sign."""

    def body() -> list[Mode]:
        return [
            Mode(
                0.05 * rng.uniform(0.5, 3.0), rng.uniform(500.0, 2000.0), rng.uniform(0.02, 0.1),
                chip=rng.uniform(0.3, 1.0), force=rng.uniform(-0.3, 1.0),
            )
            for _ in range(rng.integers(1, 3))
        ]  # fmt: skip

    return Machine(body(), body(), bearing_stiffness=1e4)


def _characteristic(machine: Machine, cut: Cut, s: complex) -> complex:
    """1 + [C w (1 - exp(-s tau)) + C_pd w s / V] (G_t + G_wp)."""
    flexibility = sum(
        mode.chip * mode.force / (mode.mass * s * s + mode.damping * s + mode.stiffness)
        for mode in (*machine.tool.modes, *machine.workpiece.modes)
    )
    speed = math.pi * cut.workpiece_diameter * cut.spindle_speed_rpm / 60.0
    force = machine.cutting_stiffness(cut.depth_of_cut) * (1.0 - cmath.exp(-s * cut.delay))
    force += cut.process_damping * cut.depth_of_cut / speed * s
    return 1.0 + force * flexibility


def _root_near(machine: Machine, cut: Cut, guess: complex) -> complex:
    """By the secant method."""
    a, b = guess, guess * (1.0 + 1e-6)
    at_a = _characteristic(machine, cut, a)
    for _ in range(60):
        if not (b.real * cut.delay > -300.0 and abs(b) < 1e6):
            return complex('nan')  # lost
        at_b = _characteristic(machine, cut, b)
        if at_b == at_a:
            break
        a, b, at_a = b, b - at_b * (b - a) / (at_b - at_a), at_b
        if abs(b - a) <= 1e-13 * abs(b):
            break
    return b


@pytest.mark.parametrize('process_damping', [0.0, 2e3])
def test_a_long_run_grows_with_a_root_of_the_characteristic_equation(
    process_damping: float,
) -> None:
    """A hundred random structures each: what a run tends to is a root, and the rightmost near."""
    rng = np.random.default_rng(int(process_damping))
    seen = 0
    for _ in range(100):
        machine = _random(rng)
        cut = Cut(
            rng.uniform(2000.0, 9000.0), rng.uniform(0.3e-3, 1.5e-3), bearing_contact='none',
            process_damping=process_damping,
        )  # fmt: skip
        lathe = VirtualLathe(machine, cut, tool_leaves_cut=False, displacement_limit=1e12)
        lathe.advance(30_000)
        if lathe.guard:
            continue
        velocity = lathe.advance(2_000)[::10, 3]
        if not np.abs(velocity).max() > 1e-250:
            continue
        rows = np.lib.stride_tricks.sliding_window_view(velocity, 3)
        rows = rows / np.abs(rows).max(axis=1, keepdims=True)
        (first, second), (rest, *_), *_ = np.linalg.lstsq(rows[:, 1::-1], rows[:, 2], rcond=None)
        if rest > 1e-18:  # two roots as far to the right as each other
            continue
        z = np.roots([1.0, -first, -second])
        found = complex(np.log(z[np.argmax(z.imag)])) * _RATE / 10.0
        root = _root_near(machine, cut, found)
        assert abs(found - root) < 1e-6 * abs(root)
        for imaginary in np.linspace(300.0, 3000.0, 40):
            other = _root_near(machine, cut, complex(root.real + 5.0, imaginary))
            if cmath.isnan(other):
                continue
            residual = abs(_characteristic(machine, cut, other))
            assert not (residual < 1e-9 and other.real > root.real + 1e-3 and other.imag > 1.0)
        seen += 1
    assert seen > 60


@pytest.mark.parametrize('rpm', [600.0, 3000.0, 11_700.0])
def test_unbalance_turns_the_workpiece_as_its_closed_form_says(rpm: float) -> None:
    """X = U Omega^2 / (k - m Omega^2 + i c Omega), out of the cut, once the start has decayed."""
    machine = Machine()
    cut = Cut(rpm, 0.0, bearing_contact='none', unbalance=2e-6)
    lathe = VirtualLathe(machine, cut, accelerometers=True)
    lathe.advance(20_000)
    samples = lathe.advance(2_000)
    mode, omega = machine.workpiece, cut.spindle_speed_rpm * 2.0 * math.pi / 60.0
    answer = 2e-6 * omega**2 / (mode.stiffness - mode.mass * omega**2 + 1j * mode.damping * omega)
    turning = np.exp(2j * math.pi * samples[:, 1])
    for column, factor in ((4, 1.0), (5, 1j * omega), (9, -(omega**2))):
        expected = (factor * answer * turning).real
        assert np.abs(samples[:, column] - expected).max() < 1e-9 * abs(factor * answer)


def test_accelerations_are_the_derivatives_of_the_velocities() -> None:
    """By central differences of a fine run, in and out of the cut, on and off the bearing."""
    cut = Cut(3000.0, 1e-3, 5e-6, process_damping=1e3, unbalance=1e-7, runout=0.0)
    lathe = VirtualLathe(_apart(), cut, sample_rate=2e5, accelerometers=True)
    assert lathe.columns[-2:] == ('tool_acceleration', 'workpiece_acceleration')
    samples = lathe.advance(60_000)
    assert lathe.events
    for velocity, acceleration in ((3, 8), (5, 9)):
        slope = (samples[2:, velocity] - samples[:-2, velocity]) * 1e5
        away = np.abs(slope - samples[1:-1, acceleration])
        assert np.median(away) < 1e-5 * np.abs(slope).max()
        assert (away < 1e-2 * np.abs(slope).max()).mean() > 0.99


def test_a_two_sided_clearance_against_brute_force() -> None:
    """An undamped workpiece between two stops, by classical Runge-Kutta in steps of 0.5 us."""
    machine = Machine(workpiece=Mode(0.05, 650.0, 0.0), bearing_stiffness=5e4)
    clearance, step = 4e-6, 5e-7
    cut = Cut(3000.0, 0.0, clearance, 'both_sides')
    lathe = VirtualLathe(machine, cut, initial_state=(0.0, 0.0, 0.0, 0.01))
    samples = lathe.advance(500)

    def slope(x: float, v: float) -> tuple[float, float]:
        push = max(x - clearance, 0.0) + min(x + clearance, 0.0)
        return v, -(650.0**2) * x - 1e6 * push

    x, v, path = 0.0, 0.01, []
    for k in range(1, 100_001):
        a = slope(x, v)
        b = slope(x + 0.5 * step * a[0], v + 0.5 * step * a[1])
        c = slope(x + 0.5 * step * b[0], v + 0.5 * step * b[1])
        d = slope(x + step * c[0], v + step * c[1])
        x += step * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0]) / 6.0
        v += step * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1]) / 6.0
        if k % 200 == 0:
            path.append(x)
    assert np.abs(samples[:, 4] - path).max() < 1e-6 * np.abs(path).max()
    energy = 0.05 * samples[:, 5] ** 2 + machine.workpiece.stiffness * samples[:, 4] ** 2
    pressed = np.maximum(np.abs(samples[:, 4]) - clearance, 0.0)
    energy += machine.bearing_stiffness * pressed**2
    assert energy == pytest.approx(0.05 * 0.01**2, rel=1e-12)
    assert len(lathe.events) > 20
    assert samples[:, 4].min() < -clearance < clearance < samples[:, 4].max()


def _growth(machine: Machine, cut: Cut) -> float:
    """1/s, of a linear run, from its largest velocities a second apart."""
    lathe = VirtualLathe(machine, cut, tool_leaves_cut=False, displacement_limit=1e12)
    lathe.advance(20_000)
    first = np.abs(lathe.advance(2_000)[:, 3]).max()
    lathe.advance(8_000)
    return float(np.log(np.abs(lathe.advance(2_000)[:, 3]).max() / first))


def test_the_textbooks_limit_of_one_mode() -> None:
    """b = 2 k zeta (1 + zeta) / K at the worst speed; a stiff workpiece does not move."""
    mass, omega, zeta = 0.5, 800.0, 0.03
    machine = Machine(Mode(mass, omega, zeta), Mode(1e6, 1e3, 0.5))
    limit = 2.0 * mass * omega**2 * zeta * (1.0 + zeta) / machine.cutting_coefficient
    chatter = omega * math.sqrt(1.0 + 2.0 * zeta)
    phase = math.atan2(zeta * 2.0 * chatter / omega, 1.0 - (chatter / omega) ** 2)
    turns = 2.0 * math.pi * 2 + 3.0 * math.pi - 2.0 * phase
    cut = Cut(60.0 * chatter / turns, limit, bearing_contact='none')
    assert _growth(machine, cut.with_changes(depth_of_cut=limit * 1.02)) > 0.0
    assert _growth(machine, cut.with_changes(depth_of_cut=limit * 0.98)) < 0.0


def test_process_damping_follows_the_surface_speed() -> None:
    """C_pd w r'/V on a ramp and while the speed varies, as DOP853 has it where C is 0."""
    machine = Machine(cutting_coefficient=0.0)
    start = Cut(2000.0, 1e-3, bearing_contact='none', process_damping=2e4)
    start = start.with_changes(speed_variation_amplitude=0.3, speed_variation_frequency=5.0)
    lathe = VirtualLathe(
        machine, start, tool_leaves_cut=False, accelerometers=True, spindle_acceleration=2e4,
        initial_state=(1e-5, 0.0, -2e-5, 0.01),
    )  # fmt: skip
    lathe.retune(start.with_changes(spindle_speed_rpm=4000.0))
    samples = lathe.advance(2000)

    def accelerations(t: float, y: Array) -> tuple[float, float]:
        swing = 1.0 + 0.3 * math.sin(2.0 * math.pi * 5.0 * t)
        rpm = min(2000.0 + 2e4 * t, 4000.0) * swing
        surface_speed = math.pi * start.workpiece_diameter * rpm / 60.0
        force = start.process_damping * start.depth_of_cut / surface_speed * (y[1] - y[3])
        tool, workpiece = machine.tool, machine.workpiece
        return (
            -(force + tool.damping * y[1] + tool.stiffness * y[0]) / tool.mass,
            (force - workpiece.damping * y[3] - workpiece.stiffness * y[2]) / workpiece.mass,
        )

    def slope(t: float, y: Array) -> list[float]:
        of_tool, of_workpiece = accelerations(t, y)
        return [y[1], of_tool, y[3], of_workpiece]

    solved = solve_ivp(
        slope, (0.0, 0.2), (1e-5, 0.0, -2e-5, 0.01), 'DOP853', samples[:, 0], rtol=1e-12,
        atol=1e-18, max_step=1e-3,
    )  # fmt: skip
    assert _error(samples[:, 2:6], solved.y.T) < 1e-8
    expected = [accelerations(t, y) for t, y in zip(samples[:, 0], solved.y.T, strict=True)]
    assert samples[:, 8:] == pytest.approx(np.array(expected), rel=1e-6, abs=1e-6)


@pytest.mark.parametrize('varied', [False, True])
def test_process_damping_while_the_speed_changes_agrees_with_a_tenth_of_the_step(
    varied: bool,
) -> None:
    cut = Cut(3017.0, 0.8e-3, 5e-6, process_damping=3e3, unbalance=1e-7)
    if varied:
        cut = cut.with_changes(speed_variation_amplitude=0.2, speed_variation_frequency=7.0)
    runs, events = [], []
    for refinement in (1, 10):
        lathe = VirtualLathe(
            _machine(2), cut, sample_rate=_RATE * refinement,
            spindle_acceleration=0.0 if varied else 3e4,
        )  # fmt: skip
        blocks = [lathe.advance(700 * refinement)]
        found = len(lathe.events)
        lathe.retune(cut.with_changes(spindle_speed_rpm=4213.0))
        blocks.append(lathe.advance(1300 * refinement))
        runs.append(np.concatenate(blocks)[refinement - 1 :: refinement])
        events.append(found + len(lathe.events))
    assert _error(runs[0][:, 2:6], runs[1][:, 2:6]) < 1e-8
    assert events[0] == events[1] > 0


def test_a_feed_per_revolution_follows_the_spindle() -> None:
    """The chip of a stable cut is the feed at any speed; of a feed speed it is v tau."""
    for geared in (True, False):
        cut = Cut(3000.0, 0.2e-3, bearing_contact='none', feed_speed=0.0025)
        if geared:
            cut = cut.with_changes(feed_per_revolution=80e-6)
        lathe = VirtualLathe(cut=cut, spindle_acceleration=6e3)
        lathe.advance(10_000)
        lathe.retune(cut.with_changes(spindle_speed_rpm=4000.0))
        lathe.advance(30_000)
        expected = 80e-6 if geared else 0.0025 * 60.0 / 4000.0
        assert lathe.advance(1)[0, 6] == pytest.approx(expected, rel=1e-9)


def test_force_noise_at_the_cut_is_equal_and_opposite() -> None:
    """On equal bodies at a depth of 0 tool and workpiece move as mirror images."""
    mode = Mode(0.05, 700.0, 0.05)
    cut = Cut(3017.0, 0.0, bearing_contact='none', feed_speed=0.0025, cutting_force_noise=0.1)
    lathe = VirtualLathe(Machine(mode, mode), cut, initial_state=(0.0,) * 4, tool_leaves_cut=False)
    samples = lathe.advance(2_000)
    assert np.abs(samples[:, 2]).max() > 1e-7
    assert samples[:, 4] == pytest.approx(-samples[:, 2], rel=1e-9, abs=1e-18)


def test_ticks_and_snapshots_do_not_matter_with_everything_on() -> None:
    cut = Cut(
        3017.0, 1.2e-3, 3e-6, 'both_sides', process_damping=1e3, unbalance=1e-7, force_noise=1e-3,
        cutting_force_noise=2e-3, sensor_noise=1e-8, acceleration_noise=1e-2, tool_runout=1e-6,
        runout=2e-6,
    )  # fmt: skip
    for varied in (0.0, 0.2):
        lathes = [
            VirtualLathe(
                _apart(), cut.with_changes(speed_variation_amplitude=varied),
                accelerometers=True, seed=4,
            )
            for _ in range(2)
        ]  # fmt: skip
        whole = lathes[0].advance(3000)
        rng, parts = np.random.default_rng(1), []
        while lathes[1].samples_taken < 3000:
            left = 3000 - lathes[1].samples_taken
            parts.append(lathes[1].advance(min(left, int(rng.integers(0, 60)))))
            lathes[1] = VirtualLathe.continued(lathes[1].snapshot())
        assert np.concatenate(parts).tobytes() == whole.tobytes()
        assert lathes[0].snapshot() == lathes[1].snapshot()
        assert whole.shape == (3000, 10)
