"""`LatheSweep`: many virtual lathes in one call, each bit for bit as if it were alone."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.integrator import berth, lanes, surface
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.abreast import advance_abreast, store_lanes
from lathe_chatter.lathe.integrator.coefficients import constants_of
from lathe_chatter.lathe.integrator.lanes import LANES
from lathe_chatter.lathe.state import LatheState
from lathe_chatter.model import Cut
from lathe_chatter.model.quantities import count_of
from lathe_chatter.samples import SAMPLE_COLUMNS

_REGULAR = 1e-10
"""How closely a number of steps must make a turn, in steps."""
_MOST_PER_TURN = 100_000
_BLOCK = 1000
"""Samples in one go, of lathes that are alone anyhow."""


class LatheSweep:
    """Lathes that cut on together: other speeds, depths, clearances, machines or seeds.

    Eight are worked on at once by each core where a turn is the same whole number of steps,
    as with `sample_rate_for`; whatever happens to one (contact, leaving the cut, a ramp, noise)
    is worked out for it alone, and so is a lathe whose turn is no whole number of steps.

        cuts = [Cut(speed, 1e-3) for speed in np.linspace(2000.0, 6000.0, 200)]
        sweep = LatheSweep(
            VirtualLathe(cut=cut, sample_rate=sample_rate_for(cut, 100)) for cut in cuts
        )
        samples = sweep.advance(10_000, columns=['tool_displacement'])  # (10000, 200, 1)

    Args:
        lathes: What each begins as; they are copied.

    Raises:
        ParameterError: If there is none.
    """

    def __init__(self, lathes: Iterable[VirtualLathe]) -> None:
        """See the class."""
        given = list(lathes)
        wrong = next((lathe for lathe in given if not isinstance(lathe, VirtualLathe)), None)
        if not given or wrong is not None:
            value = 'empty' if wrong is None else wrong
            raise ParameterError('lathes', value, '', 'at least one VirtualLathe, and no others')
        states = [lathe.snapshot() for lathe in given]
        kinds = [_kind(state) for state in states]
        order = sorted(range(len(states)), key=lambda place: kinds[place])
        self._size = len(states)
        self._groups: list[_Lanes] = []
        while order:
            kind = kinds[order[0]]
            places = [place for place in order[:LANES] if kinds[place] == kind]
            self._groups.append(_Lanes(places, [states[place] for place in places], kind[0]))
            order = order[len(places) :]

    def __len__(self) -> int:
        return self._size

    @property
    def abreast(self) -> int:
        """How many of the lathes are at present worked on together."""
        return sum(group.abreast for group in self._groups)

    def advance(
        self, samples: int, *, columns: Sequence[str] = SAMPLE_COLUMNS, workers: int | None = None
    ) -> Array:
        """Cut on with all lathes.

        Args:
            samples: How many of each, 0 or more.
            columns: Which of `model.SAMPLE_COLUMNS` are wanted, in this order.
            workers: Threads; by default as many as this process may use cores.

        Returns:
            The samples (samples, lathes, columns). A lathe that its guard has ended, see
            `lathes`, stands still: its last sample is repeated, with its time.

        Raises:
            ParameterError: If an argument is not allowed.
        """
        count_of('samples', samples)
        if workers is not None:
            count_of('workers', workers, least=1)
        for name in [columns] if isinstance(columns, str) else columns:
            if isinstance(columns, str) or name not in SAMPLE_COLUMNS:
                raise ParameterError(
                    'columns', name, '', f'a list of some of {", ".join(SAMPLE_COLUMNS)}'
                )
        wanted = np.array([SAMPLE_COLUMNS.index(name) for name in columns], dtype=np.int64)
        # A column of neighbouring lathes is written at once; the caller sees it lathe by lathe.
        out = np.empty((samples, len(wanted), self._size))
        workers = min(workers or len(os.sched_getaffinity(0)), len(self._groups))
        if workers == 1:
            for group in self._groups:
                group.advance(out, wanted)
        else:
            with ThreadPoolExecutor(workers) as pool:
                list(pool.map(lambda group: group.advance(out, wanted), self._groups))
        return out.transpose(0, 2, 1)

    def lathes(self) -> list[VirtualLathe]:
        """The lathes as they stand, each to be looked at, changed and continued by itself."""
        states = {place: state for group in self._groups for place, state in group.states()}
        return [VirtualLathe.continued(states[place]) for place in range(self._size)]


def sample_rate_for(cut: Cut, samples_per_turn: int) -> float:
    """The sample rate, Hz, at which a turn of this cut is a whole number of samples.

    Raises:
        ParameterError: If the number is not whole, or below 1.
    """
    count_of('samples_per_turn', samples_per_turn, least=1)
    return samples_per_turn * cut.spindle_speed_rpm / 60.0


def _kind(state: LatheState) -> tuple[int, int, int]:
    """What lathes abreast have in common: steps a turn, steps a sample, samples so far.

    The steps a turn are 0 where they are no whole number.
    """
    steps = int(state.counts[layout.STEPS])
    turn = state.setup.sample_rate * steps / (state.cut.spindle_speed_rpm / 60.0)
    whole = round(turn)
    regular = abs(turn - whole) <= _REGULAR and whole <= _MOST_PER_TURN
    return whole if regular else 0, steps, int(state.counts[layout.SAMPLES])


class _Lanes:
    """Up to LANES lathes side by side."""

    def __init__(self, places: list[int], states: list[LatheState], per_turn: int) -> None:
        self._given = states
        filled = [states[min(lane, len(states) - 1)] for lane in range(LANES)]
        constants = [
            constants_of(state.setup, state.cut, int(state.counts[layout.STEPS]))
            for state in filled
        ]
        longest = max(per_turn + 1, *(len(state.nodes) for state in filled))
        nodes = surface.empty_nodes(LANES, _room(2 * longest))
        for lane, state in enumerate(filled):
            nodes[lane, : len(state.nodes)] = state.nodes
        empty = LANES - len(states)
        modes = [berth.ENDED if state.guard else berth.ALONE for state in states]
        figures = surface.aligned(lanes.FIGURES, LANES)
        figures[[lanes.RATE, lanes.LIMIT]] = 1.0  # as of a lane that is not in use
        self._group = berth.Group(
            one=surface.aligned(lanes.STATE_FIGURES * LANES),
            other=surface.aligned(lanes.STATE_FIGURES * LANES),
            figures=figures.reshape(-1),
            ring=surface.aligned(max(per_turn, 1), lanes.NODE_FIGURES * LANES),
            counters=np.zeros(berth.COUNTERS, dtype=np.int64),
            modes=np.array([*modes, *[berth.ENDED] * empty]),
            places=np.array([*places, *[-1] * empty]),
            rows=np.zeros(LANES, dtype=np.int64),
            last=np.stack([_present(state) for state in filled]),
            numbers=np.stack([state.numbers for state in filled]),
            counts=np.stack([state.counts for state in filled]),
            nodes=nodes,
            settings=np.stack([constant.settings for constant in constants]),
            mechanics=np.stack([constant.mechanics for constant in constants]),
            matrices=np.stack([constant.matrices for constant in constants]),
            seeds=np.array([state.setup.seed for state in filled]),
        )
        steps = int(states[0].counts[layout.STEPS])
        self._samples = np.empty((per_turn // steps or _BLOCK, len(SAMPLE_COLUMNS)))
        self._events = np.empty((256, 3))

    @property
    def abreast(self) -> int:
        """How many lanes are in step."""
        return int(np.count_nonzero(self._group.modes == berth.ABREAST))

    def advance(self, out: Array, columns: Integers) -> None:
        """Cut on, and write each lathe's samples to its place in `out`."""
        group = self._group
        group.counters[berth.UNTIL] = 0
        group.rows[:] = 0
        status = layout.SURFACE_FULL
        while status == layout.SURFACE_FULL:
            status = advance_abreast(group, columns, self._samples, self._events, out)
            if status == layout.SURFACE_FULL:
                room = _room(2 * group.nodes.shape[1])
                group = group._replace(nodes=surface.with_room(group.nodes, room))
        self._group = group

    def states(self) -> list[tuple[int, LatheState]]:
        """The lathes' places and memories."""
        group = self._group
        store_lanes(group)
        result = []
        for lane, given in enumerate(self._given):
            state = LatheState(
                given.setup, given.cut, group.numbers[lane], group.counts[lane],
                group.nodes[lane], given.guard,
            ).copy()  # fmt: skip
            if group.modes[lane] == berth.ENDED and not state.guard:
                state.end()
            result.append((int(group.places[lane]), state))
        return result


def _room(nodes: int) -> int:
    """A capacity of at least so many nodes.

    Lanes a power of two apart would share the same few places of the processor's cache.
    """
    return 64 * (nodes // 64 + 1) + 9


def _present(state: LatheState) -> Array:
    """What a lathe that ends before its next sample stands still at (8,)."""
    numbers, counts = state.numbers, state.counts
    time = counts[layout.SAMPLES] / state.setup.sample_rate
    angle = counts[layout.TURNS] + numbers[layout.ANGLE]
    return np.array([time, angle, *numbers[:4], 0.0, 0.0])
