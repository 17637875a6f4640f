"""A second simulation of the machine, of its own making and fast, for hours of cutting.

The project's lathe locates every event to 1e-10 and needs 8 ms per simulated second; a
detector is judged on many hours and on disturbances that the lathe does not have (unbalance,
harmonics of the runout). Here each mode is advanced exactly by one sample under a force that
is linear in between, and the cutting force at the end of the step is solved for, not lagged:

    m x'' + c x' + k x = f,    F = C w max(h, 0) or C w h,    h = r + fed - (surface met),

the error of the growth rate is below 0.05 1/s (`python benchmarks/detection check`). Nothing of
it is shared with the integrator or the detector.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import expm

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.model import Machine, Mode

RATE = 1e4
COLUMNS = ('time', 'spindle_angle', 'tool_displacement', 'workpiece_displacement')
ACCELERATIONS = ('tool_acceleration', 'workpiece_acceleration')
HARMONICS = (5e-6, 2e-6, 1e-6)
"""Runout at the workpiece's sensor, once, twice and three times a turn, m."""


@dataclass(frozen=True)
class Stretch:
    """A time in which the cut keeps its depth and contact, and the speed its rate of change.

    Attributes:
        duration: s.
        rpm: Spindle speed at its end, rev/min; it is reached `ramp` seconds after its start.
        depth: Depth of cut, m.
        seated: Whether the workpiece rests on its bearing.
        ramp: How long the speed takes to change, s; 0 for a step.
        knock: Impulse on the tool at its start, N s.
    """

    duration: float
    rpm: float
    depth: float
    seated: bool = False
    ramp: float = 0.0
    knock: float = 0.0


@dataclass(frozen=True)
class Surroundings:
    """What disturbs the cut and its measurement.

    Attributes:
        force_noise: Density of the random force on the tool, N2 s.
        sensor_noise: Of both displacements, rms, m.
        chip: Mean chip thickness, m; 0 for the linear force about the mean.
        unbalance: Force on the workpiece once a turn, N, at every speed.
        harmonic_force: More forces on the workpiece: (times a turn, N).
        runout: At the workpiece's sensor, once, twice, ... a turn, m.
        tool_runout: At the tool's sensor, once a turn, m.
        at_the_cut: Whether the random force is one of the cut, equal and opposite on the
            workpiece, and not on the tool alone.
        rate: Samples a second, Hz.
        machine: What cuts.
    """

    force_noise: float = 2e-7
    sensor_noise: float = 1e-7
    chip: float = 0.0
    unbalance: float = 0.05
    harmonic_force: Sequence[tuple[float, float]] = ()
    runout: Sequence[float] = HARMONICS
    tool_runout: float = 0.0
    at_the_cut: bool = False
    rate: float = RATE
    machine: Machine = field(default_factory=Machine)


def _step_of(mode: Mode, stiffness: float, rate: float) -> Array:
    """x, v after a step from x, v, the force at its start and the force at its end (2, 4)."""
    step = 1.0 / rate
    a = np.zeros((4, 4))
    a[0, 1] = 1.0
    a[1] = [-stiffness / mode.mass, -mode.damping / mode.mass, 1.0 / mode.mass, 0.0]
    a[2, 3] = 1.0 / step  # the force's slope, times the step
    whole = expm(a * step)
    result = np.empty((2, 4))
    result[:, :2] = whole[:2, :2]
    result[:, 2] = whole[:2, 2] - whole[:2, 3]
    result[:, 3] = whole[:2, 3]
    return result


@compiled()
def _met(surface: Array, angles: Array, newest: int, place: int, angle: float) -> float:
    """The surface at an angle between the samples `place` and `place` + 1, by four of them."""
    x = (angle - angles[place]) / (angles[place + 1] - angles[place])
    if place < 2 or place + 2 > newest:
        return float(surface[place] + x * (surface[place + 1] - surface[place]))
    a, b, c, d = x + 1.0, x, x - 1.0, x - 2.0
    return float(
        -surface[place - 1] * b * c * d / 6.0
        + surface[place] * a * c * d / 2.0
        - surface[place + 1] * a * b * d / 2.0
        + surface[place + 2] * a * b * c / 6.0
    )


@compiled()
def _cut(  # noqa: PLR0913, PLR0917 -- one loop over plain numbers
    tool_step: Array, workpiece_steps: Array, plan: Array, numbers: Array, forces: Array,
    normal: Array, out: Array,
) -> None:  # fmt: skip
    """Simulate; `plan` (n, 4) holds speed (rev/s), C w, seated and knock / mass of every step."""
    count = plan.shape[0]
    angles, surface = np.empty(count + 2), np.empty(count + 2)
    angles[0], angles[1] = -2.0, 0.0
    surface[0] = surface[1] = 0.0
    chip, kick, may_leave = numbers[0], numbers[1], numbers[0] > 0.0
    back, rate = numbers[2], numbers[3]
    xt = vt = xw = vw = fed = angle = pull = force = 0.0
    surface[0], surface[1] = -2.0 * chip, 0.0
    place = 0
    for n in range(count):
        speed, cutting, seated = plan[n, 0], plan[n, 1], int(plan[n, 2])
        angle += speed / rate
        fed += chip * speed / rate
        vt += kick * normal[n] + plan[n, 3]
        vw += back * normal[n]
        pushed = 0.0
        for k in range(forces.shape[0]):
            pushed += forces[k, 1] * math.cos(2.0 * math.pi * forces[k, 0] * angle)
        w = workpiece_steps[seated]
        start, end = force + pull, pushed
        xt, vt, tool_x, tool_v = (
            tool_step[0, 0] * xt + tool_step[0, 1] * vt - tool_step[0, 2] * force,
            tool_step[1, 0] * xt + tool_step[1, 1] * vt - tool_step[1, 2] * force,
            tool_step[0, 3],
            tool_step[1, 3],
        )
        xw, vw = (
            w[0, 0] * xw + w[0, 1] * vw + w[0, 2] * start + w[0, 3] * end,
            w[1, 0] * xw + w[1, 1] * vw + w[1, 2] * start + w[1, 3] * end,
        )
        while place < n and angles[place + 1] <= angle - 1.0:
            place += 1
        met = _met(surface, angles, n + 1, place, angle - 1.0)
        depth = xt - xw + fed - met
        force = cutting * depth / (1.0 + cutting * (tool_x + w[0, 3]))
        if may_leave and force < 0.0:
            force = 0.0
        xt -= tool_x * force
        vt -= tool_v * force
        xw += w[0, 3] * force
        vw += w[1, 3] * force
        pull = pushed
        angles[n + 2] = angle
        left = xt - xw + fed
        surface[n + 2] = met if may_leave and left < met else left
        out[n, 0], out[n, 1] = (n + 1) / rate, angle
        out[n, 2], out[n, 3], out[n, 4], out[n, 5] = xt, xw, vt, vw


def simulate(
    plan: Sequence[Stretch], around: Surroundings, seed: int, *, accelerations: bool = False
) -> Array:
    """Cut one stretch after another, from rest.

    Args:
        plan: What is cut.
        around: What disturbs it.
        seed: Of every random number.
        accelerations: Whether the accelerations of both are wanted too, m/s2.

    Returns:
        Samples (n, 4), columns as in `COLUMNS`, or (n, 6) with `ACCELERATIONS`.
    """
    rng = np.random.default_rng(seed)
    machine, rate = around.machine, around.rate
    rows, speed = [], plan[0].rpm / 60.0
    for stretch in plan:
        count = round(stretch.duration * rate)
        block = np.empty((count, 4))
        target = stretch.rpm / 60.0
        progress = np.arange(1, count + 1) / (stretch.ramp * rate) if stretch.ramp else np.ones(1)
        block[:, 0] = speed + (target - speed) * np.minimum(progress, 1.0)
        block[:, 1] = machine.cutting_stiffness(stretch.depth)
        block[:, 2] = stretch.seated
        block[:, 3] = 0.0
        block[0, 3] = stretch.knock / machine.tool.mass
        rows.append(block)
        speed = float(block[-1, 0])
    steps = np.vstack(rows)
    stiffness = np.array([machine.workpiece_stiffness(seated=seated) for seated in (False, True)])
    tool = _step_of(machine.tool, machine.tool.stiffness, rate)
    workpiece = np.stack([_step_of(machine.workpiece, each, rate) for each in stiffness])
    impulse = math.sqrt(around.force_noise / rate)
    back = -impulse / machine.workpiece.mass if around.at_the_cut else 0.0
    forces = np.array([(1.0, around.unbalance), *around.harmonic_force])
    out = np.empty((len(steps), 6))
    numbers = np.array([around.chip, impulse / machine.tool.mass, back, rate])
    _cut(tool, workpiece, steps, numbers, forces, rng.standard_normal(len(steps)), out)
    turn = 2.0 * math.pi * out[:, 1]
    for number, amplitude in enumerate(around.runout, 1):
        out[:, 3] += amplitude * np.cos(number * turn + number)
    out[:, 2] += around.tool_runout * np.cos(turn + 0.5)
    if around.sensor_noise:
        out[:, 2:4] += around.sensor_noise * rng.standard_normal((len(out), 2))
    if not accelerations:
        return out[:, :4].copy()
    # The mean over a sample, as of an accelerometer whose filter lets no faster vibration through;
    # what the random force does is in it.
    heard = np.diff(out[:, 4:], axis=0, prepend=0.0) * rate
    return np.column_stack([out[:, :4], heard])
