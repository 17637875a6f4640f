"""Maps of the smallest lasting knock: computed by every worker, kept in a file, continued."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from lathe_chatter.code_identity import code_identity
from lathe_chatter.errors import ResultFileError
from lathe_chatter.executors import run_batches
from lathe_chatter.knocks.knock_threshold import KnockLimit, Margin, smallest_lasting_knock
from lathe_chatter.lathe.config import LatheConfig, config_from
from lathe_chatter.model import Cut
from lathe_chatter.resumable_results import ResultFile

_KIND = 'lathe_chatter knock map 1'


class Point(NamedTuple):
    """Where a margin is wanted: rev/min, m and m."""

    spindle_speed_rpm: float
    depth_of_cut: float
    bearing_clearance: float


@dataclass(frozen=True)
class KnockGrid:
    """What a map is of: every speed with every depth and every clearance.

    Attributes:
        config: Machine and cut; speed, depth and clearance are those below.
        speeds: rev/min.
        depths: m.
        clearances: m.
        reach: See `smallest_lasting_knock`.
        step: The same.
        tolerance: The same.
    """

    config: LatheConfig
    speeds: tuple[float, ...]
    depths: tuple[float, ...]
    clearances: tuple[float, ...]
    reach: float = 30.0
    step: float = 1.12
    tolerance: float = 0.01

    def points(self) -> Iterator[Point]:
        """Every point, the speed varying slowest."""
        for values in itertools.product(self.speeds, self.depths, self.clearances):
            yield Point(*values)

    def cut_at(self, point: Point) -> Cut:
        """The cut at a point."""
        return self.config.cut.with_changes(**point._asdict())

    def limit_at(self, point: Point) -> KnockLimit:
        """Compute a point."""
        return smallest_lasting_knock(
            self.config.machine,
            self.cut_at(point),
            reach=self.reach,
            step=self.step,
            tolerance=self.tolerance,
        )

    def header(self) -> dict[str, Any]:
        """The first line of the file."""
        names = ('speeds', 'depths', 'clearances')
        axes = {name: list(getattr(self, name)) for name in names}
        search = {name: getattr(self, name) for name in ('reach', 'step', 'tolerance')}
        of = {'kind': _KIND, 'parameters': self.config.parameters(), **axes, **search}
        return of | {'code': code_identity()}


@dataclass(frozen=True)
class KnockMap:
    """A map as far as it is computed.

    Attributes:
        grid: What it is of.
        limits: By point.
    """

    grid: KnockGrid
    limits: dict[Point, KnockLimit] = field(default_factory=dict)

    @property
    def complete(self) -> bool:
        """Whether every point is there."""
        return all(point in self.limits for point in self.grid.points())


def read_knock_map(path: Path) -> KnockMap:
    """Read a map; a last line that was cut off is passed over.

    Raises:
        ResultFileError: If the file is none.
    """
    try:
        header, *entries = [json.loads(line) for line in path.read_bytes().split(b'\n')[:-1]]
        grid, limits = _grid(header), dict(map(_limit, entries))
    except OSError as error:
        raise ResultFileError(f'{path} cannot be read: {error.strerror}.') from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise ResultFileError(f'{path} is no map of knocks.') from None
    return KnockMap(grid, limits)


def _limit(entry: dict[str, Any]) -> tuple[Point, KnockLimit]:
    """A point of a map from its line."""
    point = Point(*(entry[name] for name in Point._fields))
    names = ('impulse', 'survived', 'linear', 'searched', 'amplitude')
    values = {name: _number(entry[name]) for name in names}
    return point, KnockLimit(Margin(entry['margin']), trials=entry['trials'], **values)


def _grid(header: dict[str, Any]) -> KnockGrid:
    """What a map is of, from its first line."""
    if header['kind'] != _KIND:
        raise ValueError(header['kind'])
    speeds, depths, clearances = (
        tuple(header[name]) for name in ('speeds', 'depths', 'clearances')
    )
    return KnockGrid(
        config_from(header['parameters']), speeds, depths, clearances,
        header['reach'], header['step'], header['tolerance'],
    )  # fmt: skip


def run_knock_map(
    grid: KnockGrid,
    path: Path,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
    *,
    executor: Executor | None = None,
) -> KnockMap:
    """Compute a map into a file, or what is still missing of it.

    Args:
        grid: What is wanted.
        path: Of the file; one that exists must be of the same grid, and is continued.
        progress: Is told how many points of how many are there.
        executor: Where it is computed, see `executors`; by default threads, one a core.

    Raises:
        ResultFileError: If the file is of something else or cannot be written.
        WorkerError: If workers are lost, or have another version.
    """
    points = list(grid.points())
    file = ResultFile(path, grid.header(), _limit)
    with closing(file):
        done = dict(file.entries)
        wanted = [point for point in points if point not in done]
        progress(len(done), len(points))
        # One by one: a point may take seconds, and an interruption loses those in progress.
        for found in run_batches(grid.limit_at, [[point] for point in wanted], executor=executor):
            point, (limit,) = wanted[found.place], found.results
            done[point] = limit
            file.add(point._asdict() | _values(limit))
            progress(len(done), len(points))
    return KnockMap(grid, done)


def _values(limit: KnockLimit) -> dict[str, Any]:
    """As JSON holds them, which has no nan and no infinity."""
    values = asdict(limit) | {'margin': limit.margin.value}
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in values.items()
    }


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)
