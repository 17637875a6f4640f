"""The machine to thirty digits: a Taylor method of steps in fixed-point integers.

Every turn of the spindle is cut into pieces on which each signal is a polynomial of the phase s,
counted in pieces since the piece began. A piece is held by its derivatives D[k] = d^k/ds^k at
its start, as integers of `bits` fractional bits, so that

    x(s) = sum_k D[k] s^k / k!,

and the equations of motion are a recurrence for D without a division:

    X[k+2] = -(h^2 w_t^2  X[k] + 2 zeta_t  w_t  h X[k+1] + h^2 F[k] / m_t)
    Y[k+2] = -(h^2 w_wp^2 Y[k] + 2 zeta_wp w_wp h Y[k+1] - h^2 F[k] / m_wp) (+ the bearing)
    F[k]   = C w (X[k] - Y[k] - u[k])

A piece of this turn starts where a piece of the last turn started, so the surface u met again is
that piece's own polynomial. Only a located event starts a piece elsewhere; u is then shifted
there, exactly. A break (a jump of some derivative) returns every turn, two orders higher each
time it passes the equations of motion; once that order exceeds the degree of the polynomials it
is below their truncation error and its piece is joined to the one before.

The parameters are taken as the exact values of the model's doubles and the delay as 60 / rpm.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from operator import mul
from typing import NamedTuple

import numpy as np

from lathe_chatter.model import BearingContact, Cut, Machine, paper_initial_state
from support.reference.roots import first_root
from support.reference.solution import Event, Solution

_SMOOTH = 1_000_000
"""The order of a break at which nothing jumps."""
_PHASES_KEPT = 20_000


@dataclass(frozen=True)
class ExactSolution(Solution):
    """A run with all its digits.

    Attributes:
        fixed: The states as integers in units of 2^-bits, SI.
        bits: Fractional bits of `fixed`.
        event_times: The instants of `events`, s.
    """

    fixed: tuple[tuple[int, ...], ...]
    bits: int
    event_times: tuple[Fraction, ...]


class _Piece(NamedTuple):
    start: int  # phase in the turn, in pieces of the uniform grid, fixed-point
    surface: tuple[int, ...]  # derivatives of the surface left behind
    order: int  # lowest derivative of the surface that jumps at the start


class _Regime(NamedTuple):
    tool: tuple[int, int, int]  # h^2 w^2, 2 zeta w h, h^2 C w / m, fixed-point
    workpiece: tuple[int, int, int]
    bearing_offset: int  # h^2 k_bc gamma / m_wp, fixed-point metres


def solve(
    machine: Machine,
    cut: Cut,
    duration: float,
    *,
    sample_rate: float = 1e4,
    tool_leaves_cut: bool = True,
    piece: float = 4e-4,
    degree: int = 26,
    bits: int = 144,
) -> ExactSolution:
    """Integrate from `model.paper_initial_state`, with r = 0 before.

    Args:
        machine: The machine.
        cut: The cut; its speed is constant, its noises and runout are left out.
        duration: s.
        sample_rate: Hz.
        tool_leaves_cut: Total force with multiple regeneration, or the paper's linear force.
        piece: Longest piece of the grid, s; the turn is divided evenly.
        degree: Degree of the polynomials.
        bits: Fractional bits of every number.

    Returns:
        States, each correctly rounded to a double, and events.

    Raises:
        ArithmeticError: If the workpiece or the tool grazes so closely that no event can be told.
    """
    run = _Run(
        machine,
        cut,
        tool_leaves_cut=tool_leaves_cut,
        piece=piece,
        degree=degree,
        bits=bits,
    )
    fixed = tuple(run.sample(round(duration * sample_rate), Fraction(sample_rate)))
    one = 1 << bits
    # The last piece reaches beyond the last sample; what happens there is not part of the run.
    end = len(fixed) / Fraction(sample_rate)
    within = sum(time <= end for time in run.event_times)
    return ExactSolution(
        np.array([[number / one for number in row] for row in fixed]),
        tuple(run.events[:within]),
        fixed,
        bits,
        tuple(run.event_times[:within]),
    )


class _Run:
    """One run: the state at the start of the current piece and the surface of the last turn."""

    def __init__(
        self,
        machine: Machine,
        cut: Cut,
        *,
        tool_leaves_cut: bool,
        piece: float,
        degree: int,
        bits: int,
    ) -> None:
        self.bits, self.degree = bits, degree
        self.one = 1 << bits
        delay = Fraction(60) / Fraction(cut.spindle_speed_rpm)
        self.grid = math.ceil(delay / Fraction(piece))
        self.h = delay / self.grid
        self.tool_leaves_cut = tool_leaves_cut
        self.contact = cut.bearing_contact
        self.feed = self.fix(Fraction(cut.feed_speed) * delay) if tool_leaves_cut else 0
        self.clearance = self.fix(Fraction(cut.bearing_clearance))
        self.regimes = {
            (cutting, seated): self._regime(machine, cut, cutting=cutting, seated=seated)
            for cutting in (False, True)
            for seated in (False, True)
        }
        x, v, y, w = (Fraction(number) for number in paper_initial_state(cut).tolist())
        self.state = (self.fix(x), self.fix(v * self.h), self.fix(y), self.fix(w * self.h))
        self.cutting = True
        self.seated = self.contact is BearingContact.SEATED or (
            self.contact is BearingContact.GAP and self.state[2] >= self.clearance
        )
        self.fresh = ''  # the kind of the event at the start of the current piece
        self.events: list[Event] = []
        self.event_times: list[Fraction] = []
        self._known: dict[int, tuple[int, ...]] = {}

    def fix(self, value: Fraction) -> int:
        """The nearest fixed-point number."""
        return round(value * self.one)

    def _regime(self, machine: Machine, cut: Cut, *, cutting: bool, seated: bool) -> _Regime:
        stiffness = Fraction(machine.cutting_coefficient) * Fraction(cut.depth_of_cut)
        bearing = Fraction(machine.bearing_stiffness) / Fraction(machine.workpiece.mass)
        modes = []
        for mode, extra in ((machine.tool, 0), (machine.workpiece, bearing if seated else 0)):
            omega = Fraction(mode.natural_frequency)
            modes.append(
                (
                    self.fix(self.h**2 * (omega**2 + extra)),
                    self.fix(2 * Fraction(mode.damping_ratio) * omega * self.h),
                    self.fix(self.h**2 * stiffness / Fraction(mode.mass)) if cutting else 0,
                )
            )
        offset = self.h**2 * bearing * Fraction(cut.bearing_clearance) if seated else Fraction(0)
        return _Regime(modes[0], modes[1], self.fix(offset))

    def weights(self, phase: int) -> tuple[int, ...]:
        """s^k / k! for k = 0..degree; most phases come back every turn."""
        known = self._known.get(phase)
        if known is None:
            result = [self.one]
            for k in range(1, self.degree + 1):
                result.append((result[-1] * phase >> self.bits) // k)
            if len(self._known) >= _PHASES_KEPT:
                self._known.clear()
            known = self._known[phase] = tuple(result)
        return known

    def value(self, derivatives: Sequence[int], phase: int) -> int:
        """The polynomial at `phase`."""
        return sum(map(mul, derivatives, self.weights(phase))) >> self.bits

    def shift(self, derivatives: tuple[int, ...], phase: int) -> tuple[int, ...]:
        """The derivatives of the same polynomial at `phase`."""
        return tuple(self.value(derivatives[k:], phase) for k in range(len(derivatives)))

    def sample(self, count: int, rate: Fraction) -> Iterator[tuple[int, ...]]:
        """The states at k / rate, k = 1..count, turn after turn."""
        unit = 1 / (rate * self.h)  # one sample, in pieces
        zero = (0,) * (self.degree + 1)
        pieces = [_Piece(i << self.bits, zero, _SMOOTH) for i in range(self.grid)]
        turn, taken = 0, 0
        while taken < count:
            passed: list[_Piece] = []
            for start, end, surface, order in self._joined(pieces):
                for piece, length, x, y in self._advance(start, end, surface, order, turn):
                    passed.append(piece)
                    while taken < count:
                        phase = ((taken + 1) * unit.numerator << self.bits) // unit.denominator
                        phase -= turn * self.grid * self.one + piece.start
                        if phase > length:
                            break
                        taken += 1
                        yield self._physical(x, y, phase)
            pieces = passed
            turn += 1

    def _joined(self, pieces: list[_Piece]) -> Iterator[tuple[int, int, tuple[int, ...], int]]:
        """Start, end, surface and order of the pieces of the next turn."""
        kept = [p for p in pieces if p.order <= self.degree or p.start % self.one == 0]
        ends = [p.start for p in kept[1:]] + [self.grid * self.one]
        for piece, end in zip(kept, ends, strict=True):
            yield piece.start, end, piece.surface, piece.order

    def _advance(
        self, start: int, end: int, surface: tuple[int, ...], order: int, turn: int
    ) -> Iterator[tuple[_Piece, int, list[int], list[int]]]:
        """Integrate from phase `start` to `end`, piece by piece where events divide it.

        Yields:
            The piece with the surface it leaves, its length, and tool and workpiece on it.
        """
        if start == 0 and turn == 0:
            order = 0  # the history ends: r'' jumps
        while True:
            x, y = self._expand(surface)
            thickness = [a - b - u for a, b, u in zip(x, y, surface, strict=True)]
            thickness[0] += self.feed
            if self.cutting:
                left = tuple(a - b for a, b in zip(x, y, strict=True))
                left_order = order + 2
            else:
                left = (surface[0] - self.feed, *surface[1:])
                left_order = order
            if self.fresh:
                own = 1 if self.fresh == 'chip' else 3 if self.cutting else _SMOOTH
                left_order = min(left_order, own)
            phase, kind = self._first_event(y, thickness, end - start)
            length = end - start if not kind else phase
            self.state = tuple(self.value(d[k:], length) for d in (x, y) for k in (0, 1))
            self.fresh = kind
            yield _Piece(start, left, left_order), length, x, y
            if not kind:
                return
            self._switch(kind, turn, start + length)
            surface = self.shift(surface, length)
            start, order = start + length, _SMOOTH

    def _expand(self, surface: tuple[int, ...]) -> tuple[list[int], list[int]]:
        """The derivatives of both displacements at the start of a piece."""
        tool, workpiece, offset = self.regimes[self.cutting, self.seated]
        k_t, c_t, f_t = tool
        k_w, c_w, f_w = workpiece
        bits = self.bits
        x0, x1, y0, y1 = self.state
        x, y = [x0, x1], [y0, y1]
        # The total force adds the feed to the chip thickness; a polynomial has it in D[0] alone.
        thickness = x0 - y0 - surface[0] + self.feed
        for u in surface[1:-1]:
            x2 = -(k_t * x0 + c_t * x1 + f_t * thickness) >> bits
            y2 = (-(k_w * y0 + c_w * y1 - f_w * thickness) >> bits) + offset
            x.append(x2)
            y.append(y2)
            x0, x1, y0, y1 = x1, x2, y1, y2
            thickness = x0 - y0 - u
            offset = 0
        return x, y

    def _first_event(self, y: list[int], thickness: list[int], length: int) -> tuple[int, str]:
        """Phase and kind of the first event on a piece; the kind is empty without one."""
        found = []
        if self.contact is BearingContact.GAP:
            margin = [y[0] - self.clearance, *y[1:]]
            sign = 1 if self.seated else -1
            found.append(self._crossing('bearing', [sign * d for d in margin], length))
        if self.tool_leaves_cut:
            sign = 1 if self.cutting else -1
            found.append(self._crossing('chip', [sign * d for d in thickness], length))
        return min((f for f in found if f[1]), default=(0, ''))

    def _crossing(self, kind: str, derivatives: list[int], length: int) -> tuple[int, str]:
        """Phase at which a signal that is positive ceases to be, exact to the last bits."""
        scale = 1.0 / self.one
        g = [d * scale / math.factorial(k) for k, d in enumerate(derivatives)]
        if self.fresh == kind:
            g = g[1:]  # the zero at the start is the event that has just been passed
        if g[0] < 0.0:
            raise ArithmeticError(f'a {kind} event was passed unseen')
        root = first_root(g, length * scale)
        if root is None:
            return 0, ''
        phase = int(root * self.one)
        for _ in range(8):
            slope = self.value(derivatives[1:], phase)
            step = (self.value(derivatives, phase) << self.bits) // slope
            phase -= step
            if abs(step) < 1 << (self.bits // 3):  # the next step would be below one bit
                return min(max(phase, 1), length), kind
        raise ArithmeticError(f'a {kind} event is too close to grazing to be located')

    def _switch(self, kind: str, turn: int, phase: int) -> None:
        if kind == 'bearing':
            self.seated = begins = not self.seated
        else:
            self.cutting = begins = not self.cutting
        time = self.h * (Fraction(phase, self.one) + turn * self.grid)
        self.events.append(Event(float(time), kind, begins))
        self.event_times.append(time)

    def _physical(self, x: list[int], y: list[int], phase: int) -> tuple[int, ...]:
        """Displacements in m and velocities in m/s, fixed-point."""
        a, v, b, w = (self.value(d[k:], phase) for d in (x, y) for k in (0, 1))
        num, den = self.h.numerator, self.h.denominator
        return a, v * den // num, b, w * den // num
