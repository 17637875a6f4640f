"""`LatheSweep`: many virtual lathes in one call, on all workers, each as if it were alone."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from functools import partial
from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.executors import spread_out
from lathe_chatter.lathe.state import LatheState
from lathe_chatter.lathe.virtual_lathe import VirtualLathe
from lathe_chatter.model.quantity_fields import count_of
from lathe_chatter.samples import SAMPLE_COLUMNS

_BLOCK = 4096
"""Samples in one go: a lathe's block stays in the cache until the wanted columns are taken."""


class LatheSweep:
    """Lathes that cut on together: other speeds, depths, clearances, machines or seeds.

    Each is a `VirtualLathe` of its own, so every sample is bit for bit the one that it gives
    alone; the workers of a call share the lathes among them.

        cuts = [Cut(speed, 1e-3) for speed in np.linspace(2000.0, 6000.0, 200)]
        sweep = LatheSweep(VirtualLathe(cut=cut) for cut in cuts)
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
        self._lathes = [
            _Lathe(VirtualLathe.continued(lathe.snapshot()), _present(lathe)) for lathe in given
        ]

    def __len__(self) -> int:
        return len(self._lathes)

    def advance(
        self,
        samples: int,
        *,
        columns: Sequence[str] = SAMPLE_COLUMNS,
        executor: Executor | None = None,
    ) -> Array:
        """Cut on with all lathes.

        Args:
            samples: How many of each, 0 or more.
            columns: Which of `samples.SAMPLE_COLUMNS` are wanted, in this order.
            executor: Where the lathes cut, see `executors`; by default threads, one a core.

        Returns:
            The samples (samples, lathes, columns). A lathe that its guard has ended, see
            `lathes`, stands still: its last sample is repeated, with its time.

        Raises:
            ParameterError: If an argument is not allowed.
            WorkerError: If workers are lost; then no lathe of theirs has cut on.
        """
        count_of('samples', samples)
        for name in [columns] if isinstance(columns, str) else columns:
            if isinstance(columns, str) or name not in SAMPLE_COLUMNS:
                raise ParameterError(
                    'columns', name, '', f'a list of some of {", ".join(SAMPLE_COLUMNS)}'
                )
        wanted = [SAMPLE_COLUMNS.index(name) for name in columns]
        cut_on = partial(_cut_on, samples=samples, wanted=wanted)
        out = np.empty((len(self), samples, len(wanted)))
        ends: dict[int, tuple[LatheState, Array]] = {}
        # What has come is put in its place while the others still cut.
        for batch in spread_out(cut_on, self._lathes, executor=executor):
            for place, after in batch:
                ends[place], out[place] = (after.state, after.last), after.samples
        for place, (state, last) in ends.items():
            lathe = self._lathes[place].lathe
            lathe.restore(state)
            self._lathes[place] = _Lathe(lathe, last)
        return out.transpose(1, 0, 2)

    def lathes(self) -> list[VirtualLathe]:
        """The lathes as they stand, each to be looked at, changed and continued by itself."""
        return [VirtualLathe.continued(each.lathe.snapshot()) for each in self._lathes]


def _present(lathe: VirtualLathe) -> Array:
    """What a lathe that ends before its next sample stands still at (8,)."""
    return np.array([lathe.time, lathe.spindle_angle, *lathe.snapshot().motion(), 0.0, 0.0])


class _Lathe(NamedTuple):
    """A lathe, and the sample (8,) that is repeated once its guard has ended it."""

    lathe: VirtualLathe
    last: Array


class _After(NamedTuple):
    """Of a lathe that has cut on: what its worker sends back, a third of the lathe itself."""

    state: LatheState
    last: Array
    samples: Array
    """(n, columns wanted)."""


def _cut_on(one: _Lathe, samples: int, wanted: list[int]) -> _After:
    """Cut on with one lathe."""
    lathe, last, done = one.lathe, one.last, 0
    out = np.empty((samples, len(wanted)))
    while done < samples and not lathe.guard:
        block = lathe.advance(min(_BLOCK, samples - done))
        for place, column in enumerate(wanted):
            out[done : done + len(block), place] = block[:, column]
        done += len(block)
        if len(block):
            last = block[-1].copy()
    out[done:] = last[wanted]
    return _After(lathe.snapshot(), last, out)
