"""A recorded run of an hour: how soon it is seen, and how soon any second of it."""

from __future__ import annotations

import asyncio
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lathe_chatter.cli import main as cli
from lathe_chatter.page.recorded_run import RecordedRun
from lathe_chatter.page.server import Viewer

_ZOOMS = 40


def opened(simulated: float) -> Iterator[str]:
    """Record, open, and zoom to seconds here and there, before and after all is read."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / 'run'
        cli.main(['simulate', '--output', str(run), '--duration', str(simulated)])
        size = sum(file.stat().st_size for file in run.rglob('*')) / 1e6
        begin = time.perf_counter()
        shown = RecordedRun(run)
        viewer = Viewer('one', trusted=True)
        asyncio.run(shown.look(viewer, _part(0.0, simulated)))
        first = time.perf_counter() - begin
        yield f'{simulated:.0f} s of a run, {size:.0f} MB: first picture after {first:.2f} s'
        for state in ('before', 'after'):
            delays = asyncio.run(_zoom(shown, viewer, simulated))
            p50, p95 = np.quantile(delays, [0.5, 0.95]) * 1e3
            yield f'zoom to a second, {state} all is read: {p50:.0f} ms (p50), {p95:.0f} ms (p95)'
            if state == 'before':
                begin = time.perf_counter()
                asyncio.run(shown.read())
                yield f'all samples read after {time.perf_counter() - begin:.0f} s'


def _part(begin: float, end: float) -> dict[str, object]:
    return {'do': 'view', 'plot': 'part', 'from': begin, 'to': end}


async def _zoom(shown: RecordedRun, viewer: Viewer, end: float) -> list[float]:
    """How long some looks took, s."""
    delays = []
    for at in np.random.default_rng(0).uniform(1.0, end, _ZOOMS).tolist():
        begin = time.perf_counter()
        await shown.look(viewer, _part(at - 1.0, at))
        delays.append(time.perf_counter() - begin)
    return delays
