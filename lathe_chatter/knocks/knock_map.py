"""Maps of the smallest lasting knock: computed on every core, kept in a file, continued.

The file is text, a JSON object in each line: first what the map is of, then a line for each
point as it is found. A run that is interrupted loses the points in progress and nothing else.
"""

from __future__ import annotations

import itertools
import json
import math
import os
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from lathe_chatter.errors import KnockMapError
from lathe_chatter.knocks.threshold import KnockLimit, Margin, smallest_lasting_knock
from lathe_chatter.lathe.config import LatheConfig, config_from
from lathe_chatter.model import Cut

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
        return {'kind': _KIND, 'parameters': self.config.parameters(), **axes, **search}


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
        KnockMapError: If the file is none.
    """
    try:
        header, *entries = [json.loads(line) for line in path.read_bytes().split(b'\n')[:-1]]
        grid = _grid(header)
        limits = {}
        for entry in entries:
            point = Point(*(entry.pop(name) for name in Point._fields))
            impulse = entry.pop('impulse')
            limits[point] = KnockLimit(
                Margin(entry.pop('margin')),
                math.nan if impulse is None else impulse,
                amplitude=_number(entry.pop('amplitude')),
                **entry,
            )
    except OSError as error:
        raise KnockMapError(f'{path} cannot be read: {error.strerror}.') from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise KnockMapError(f'{path} is no map of knocks.') from None
    return KnockMap(grid, limits)


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
    tell: Callable[[int, int], None] = lambda _done, _total: None,
) -> KnockMap:
    """Compute a map into a file, or what is still missing of it.

    Args:
        grid: What is wanted.
        path: Of the file; one that exists must be of the same grid, and is continued.
        tell: Is told how many points of how many are there.

    Raises:
        KnockMapError: If the file is of something else or cannot be written.
    """
    try:
        done = _open(grid, path)
        wanted = [point for point in grid.points() if point not in done]
        tell(len(done), len(done) + len(wanted))
        with path.open('ab') as file:
            for point, limit in _computed(grid, wanted):
                done[point] = limit
                file.write(_line(point._asdict() | _values(limit)))
                file.flush()
                tell(len(done), len(list(grid.points())))
    except OSError as error:
        raise KnockMapError(f'{path} cannot be written: {error.strerror}.') from None
    return KnockMap(grid, done)


def _open(grid: KnockGrid, path: Path) -> dict[Point, KnockLimit]:
    """What the file holds already; a new one gets its first line."""
    whole = path.read_bytes() if path.exists() else b''
    whole = whole[: whole.rfind(b'\n') + 1]
    if not whole:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(_line(grid.header()))
        return {}
    known = read_knock_map(path)
    if known.grid != grid:
        raise KnockMapError(f'{path} holds another map: give another file, or remove it.')
    with path.open('r+b') as file:
        file.truncate(len(whole))
    return known.limits


def _computed(grid: KnockGrid, points: list[Point]) -> Iterator[tuple[Point, KnockLimit]]:
    """The points as they are found. The inner loop lets other threads run."""
    waiting = iter(points)
    cores = os.cpu_count() or 1
    with ThreadPoolExecutor(cores) as pool:
        running: dict[Future[KnockLimit], Point] = {}
        # No more are begun than fit, so that an interruption waits for those alone.
        for point in itertools.islice(waiting, cores):
            running[pool.submit(grid.limit_at, point)] = point
        while running:
            finished, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in finished:
                point = running.pop(future)
                for following in itertools.islice(waiting, 1):
                    running[pool.submit(grid.limit_at, following)] = following
                yield point, future.result()


def _values(limit: KnockLimit) -> dict[str, Any]:
    """As JSON holds them, which has no nan and no infinity."""
    values = asdict(limit) | {'margin': limit.margin.value}
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in values.items()
    }


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)


def _line(values: dict[str, Any]) -> bytes:
    return json.dumps(values).encode() + b'\n'
