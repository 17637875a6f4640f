"""The characteristic equation of turning, for machines with any number of modes.

With the receptances G_t and G_wp of tool and workpiece, chip thickness from the cutting force,
equations (2) and (8) have solutions e^st where

    1 + [C w (1 - e^(-s tau)) + C_pd w s / V] G(s) = 0,    G = G_t + G_wp,

the second term being the process damping at the cutting speed V. Its real part decides: chatter
grows like e^(Re s t). G is a sum of sections,

    G = sum_j (alpha_j s + beta_j) / (s^2 + c_j s + k_j),

one for each mode; where a workpiece with several modes rests on its bearing, which couples them,
one for each mode of the two together.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.errors import ParameterError
from lathe_chatter.model import Body, Cut, Machine
from lathe_chatter.model.quantity_fields import Quantity, check_flag, limits_of
from lathe_chatter.stability.compiled_characteristic import (
    ALPHA,
    BETA,
    DAMPING,
    SECTION_SIZE,
    STIFFNESS,
)

Complex: TypeAlias = NDArray[np.complexfloating[Any, Any]]
Machines: TypeAlias = Machine | Sequence[Machine] | NDArray[np.object_]
"""One machine, or several as an array of any shape that broadcasts with speeds and depths."""

LEAST_DAMPING = 1e-9
"""What a mode without damping is taken to have where a limit is computed."""
_PROCESS_DAMPING = Quantity('process damping coefficient C_pd', 'N/m', high=1e9)
_DIAMETER = Quantity('workpiece diameter', 'm', high=100.0, exclusive=True)


@dataclass(frozen=True)
class ProcessDamping:
    """The force C_pd (w/V) r' of the tool's flank on the waves that it has just cut.

    Attributes:
        coefficient: C_pd, N/m.
        diameter: Of the workpiece, m: V = pi D n.

    Raises:
        ParameterError: If a value is not allowed.
    """

    coefficient: float = 0.0
    diameter: float = 0.05

    def __post_init__(self) -> None:
        """Validate."""
        _PROCESS_DAMPING.check('process_damping', self.coefficient)
        _DIAMETER.check('workpiece_diameter', self.diameter)

    @property
    def per_width_and_delay(self) -> float:
        """C_pd / (pi D): times depth and delay the damping, N/m2."""
        return self.coefficient / (math.pi * self.diameter)

    @classmethod
    def of(cls, cut: Cut) -> ProcessDamping:
        """That of a cut."""
        return cls(cut.process_damping, cut.workpiece_diameter)


NO_DAMPING = ProcessDamping()


def sections_of(machine: Machine, *, seated: bool, least_damping: float = 0.0) -> Array:
    """The sections of a machine whose bearing carries (seated) or does not.

    Args:
        machine: Tool, workpiece, bearing.
        seated: Whether the workpiece rests on its bearing.
        least_damping: No section has a smaller damping ratio than that.

    Returns:
        alpha, beta, c and k of each mode (modes, SECTION_SIZE).

    Raises:
        ParameterError: If `seated` is no truth.
    """
    seated = check_flag('seated', seated)
    sections = np.concatenate(
        (_free(machine.tool), _workpiece(machine, seated=seated)), dtype=float
    )
    least = 2.0 * least_damping * np.sqrt(sections[:, STIFFNESS])
    np.maximum(sections[:, DAMPING], least, out=sections[:, DAMPING])
    return sections


def _free(body: Body) -> Array:
    """The sections of a body's modes, each by itself."""
    return np.array(
        [
            (0.0, mode.chip * mode.force / mode.mass, mode.damping / mode.mass,
             mode.natural_frequency**2)
            for mode in body.modes
        ]
    )  # fmt: skip


def _workpiece(machine: Machine, *, seated: bool) -> Array:
    """The sections of the workpiece."""
    sections, modes = _free(machine.workpiece), machine.workpiece.modes
    bearing = np.array([mode.bearing for mode in modes])
    if not seated or not machine.bearing_stiffness or not bearing.any():
        return sections
    mass = np.array([mode.mass for mode in modes])
    if len(modes) == 1:
        sections[0, STIFFNESS] += machine.bearing_stiffness * bearing[0] ** 2 / mass[0]
        return sections
    # The bearing couples the modes: poles and residues of the coupled system, in pairs.
    count = len(modes)
    a = np.zeros((2 * count, 2 * count))
    a[:count, count:] = np.eye(count)
    a[count:, :count] = -np.diag(sections[:, STIFFNESS])
    a[count:, :count] -= machine.bearing_stiffness * np.outer(bearing / mass, bearing)
    a[count:, count:] = -np.diag(sections[:, DAMPING])
    # Scaled to one frequency: displacements and velocities differ by it otherwise.
    scale = math.sqrt(float(sections[:, STIFFNESS].mean()))
    a[:count, count:] *= scale
    a[count:, :count] /= scale
    poles, vectors = np.linalg.eig(a)
    chip = np.array([mode.chip for mode in modes])
    pushed = np.concatenate((np.zeros(count), np.array([m.force for m in modes]) / mass / scale))
    residues = (chip @ vectors[:count]) * np.linalg.solve(vectors, pushed.astype(complex))
    return np.array([_section(*pair) for pair in _pairs(poles, residues)])


def _pairs(
    poles: Complex, residues: Complex
) -> Iterable[tuple[complex, complex, complex, complex]]:
    """Conjugate poles, and real ones two by two, with their residues."""
    upper = np.flatnonzero(poles.imag > 0.0)
    for k in upper:
        yield poles[k], residues[k], poles[k].conjugate(), residues[k].conjugate()
    real = np.flatnonzero(poles.imag == 0.0)
    for one, other in zip(real[0::2], real[1::2], strict=True):
        yield poles[one], residues[one], poles[other], residues[other]


def _section(p: complex, r: complex, q: complex, t: complex) -> tuple[float, float, float, float]:
    """r/(s - p) + t/(s - q) over one denominator."""
    values = (r + t, -(r * q + t * p), -(p + q), p * q)
    alpha, beta, damping, stiffness = (float(value.real) for value in values)
    return alpha, beta, damping, stiffness


@dataclass(frozen=True)
class Cuts:
    """Many cuts of one or several machines, each a row.

    Attributes:
        shape: Of what was given.
        sections: Of the machines (machines, most modes, SECTION_SIZE).
        modes: How many each machine has (machines,).
        machine: Number of each cut's machine (n,).
        stiffness: C w, or C where no depth was given (n,), N/m.
        damping: C_pd w / V (n,), N s/m, the same.
        delay: tau (n,), s.
    """

    shape: tuple[int, ...]
    sections: Array
    modes: Integers
    machine: Integers
    stiffness: Array
    damping: Array
    delay: Array

    @classmethod
    def of(  # noqa: PLR0913 -- a cut's facts
        cls,
        machines: Machines,
        spindle_speed_rpm: ArrayLike,
        depth_of_cut: ArrayLike | None,
        *,
        seated: bool,
        process: ProcessDamping = NO_DAMPING,
        least_damping: float = 0.0,
    ) -> Cuts:
        """Cuts from machines, speeds and depths that broadcast; None is a depth of 1.

        Raises:
            ParameterError: If a machine is none, or a speed or depth not allowed.
        """
        given = machine_array(machines)
        speeds = checked('spindle_speed_rpm', spindle_speed_rpm)
        depths = np.ones(()) if depth_of_cut is None else checked('depth_of_cut', depth_of_cut)
        different: dict[int, Machine] = {id(machine): machine for machine in given.ravel()}
        number = {key: k for k, key in enumerate(different)}
        which = np.array([number[id(machine)] for machine in given.ravel()], dtype=np.int64)
        shared = np.broadcast_arrays(which.reshape(given.shape), speeds, depths)
        numbers, speeds, depths = map(np.array, shared)  # compiled code wants arrays of their own
        several = [
            sections_of(machine, seated=seated, least_damping=least_damping)
            for machine in different.values()
        ]
        modes = np.array([len(sections) for sections in several], dtype=np.int64)
        padded = np.zeros((len(several), max(modes, default=1), SECTION_SIZE))
        for place, sections in zip(padded, several, strict=True):
            place[: len(sections)] = sections
        coefficient = np.array([m.cutting_coefficient for m in different.values()])
        owner = np.ascontiguousarray(numbers.ravel())
        width, delay = depths.ravel(), 60.0 / speeds.ravel()
        return cls(
            numbers.shape, padded, modes, owner, coefficient[owner] * width,
            process.per_width_and_delay * width * delay, delay,
        )  # fmt: skip


def machine_array(machines: Machines) -> NDArray[np.object_]:
    """One or several machines as an array.

    Raises:
        ParameterError: If something among them is no machine.
    """
    if isinstance(machines, Machine):
        one: NDArray[np.object_] = np.empty((), object)
        one[()] = machines
        return one
    given = np.asarray(machines, object)
    wrong = next((each for each in given.ravel() if not isinstance(each, Machine)), None)
    if wrong is not None:
        raise ParameterError('machine', wrong, '', 'a Machine, or an array of them')
    return given


def receptance(sections: Array, s: Any) -> Complex:
    """G(s), m/N, of one machine at points of any shape, 1/s."""
    at = np.asarray(s)[..., None]
    denominator = (at + sections[:, DAMPING]) * at + sections[:, STIFFNESS]
    total: Complex = ((sections[:, ALPHA] * at + sections[:, BETA]) / denominator).sum(axis=-1)
    return total


def checked(name: str, values: ArrayLike) -> Array:
    """Values of a field of `Cut` as an array, each within the limits of that field.

    Raises:
        ParameterError: For the first that is not allowed.
    """
    limits = limits_of(Cut, name)
    try:
        numbers = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        return np.asarray(limits.check(name, values))
    wrong = ~((numbers >= limits.low) & (numbers <= limits.high))
    if wrong.any():
        limits.check(name, float(numbers[wrong][0]))
    return numbers
