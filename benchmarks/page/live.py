"""The live page: what node and browser take, a slider's delay, the lathe's lateness, memory."""

from __future__ import annotations

import contextlib
import json
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from ear import Ear, ear
from processes import LATHE, MONITOR, RECORDER, cpu_seconds, resident, running
from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, QoSProfile
from support.browser import Browser
from support.page_cell import header_of
from websockets.sync.client import connect

from lathe_chatter.lathe.change_and_knock_sentences import parse_change
from lathe_chatter.page.server import answers, free_port

PAGE = 'operator_page'
TICK = 0.002
_FRAME = 0.05
SETTLING, _PATIENCE = 5.0, 60.0
_KEPT = QoSProfile(depth=5000, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@contextlib.contextmanager
def page() -> Iterator[tuple[int, str]]:
    """The node with its page; process id and address."""
    port = free_port(18080)
    with running(PAGE, '-p', f'port:={port}') as pid:
        while not answers(port):
            time.sleep(0.1)
        yield pid, f'http://127.0.0.1:{port}/'


class Viewer:
    """A client of the page that draws nothing.

    Args:
        url: Of the page.
        frames: Whether it asks for frames; without, the node listens to the lathe all the same.
    """

    def __init__(self, url: str, *, frames: bool) -> None:
        """Come, and look at the lathe."""
        self._frames, self._ended = frames, False
        socket = f'{url.replace("http", "ws")}feed'
        self.socket = connect(socket, origin=url.rstrip('/'), proxy=None, max_size=None)
        self.count = 0
        self.choose()
        self._thread = threading.Thread(target=self._follow, daemon=True)
        self._thread.start()

    def choose(self) -> None:
        """Look at the lathe, until its parameters are known."""
        until = time.monotonic() + _PATIENCE
        while time.monotonic() < until:
            self.ask(do='choose', lathe='/lathe', id=1)
            for _ in range(100):
                self.ask(do='next')
                header = header_of(bytes(self.socket.recv(timeout=_PATIENCE)))
                if 'lathe_values' in header.get('cell', {}):
                    return
                if any(not answer['ok'] for answer in header.get('answers', [])):
                    time.sleep(0.5)
                    break
        raise RuntimeError('the page has not seen the lathe')

    def ask(self, **wish: Any) -> None:
        """Send a wish."""
        self.socket.send(json.dumps(wish))

    def _follow(self) -> None:
        while self._frames and not self._ended:
            self.ask(do='next')
            with contextlib.suppress(Exception):
                self.socket.recv(timeout=5)
                self.count += 1

    def close(self) -> None:
        """Go."""
        self._ended = True
        self._thread.join(10)
        self.socket.close()


@contextlib.contextmanager
def browser_at(url: str) -> Iterator[Browser]:
    """A Chromium that shows the page of a lathe that cuts."""
    with tempfile.TemporaryDirectory() as folder:
        browser = Browser(Path(folder))
        try:
            browser.open(url)
            browser.until('cell.chart?.speed && frames > 20', 'the page', 600.0)
            yield browser
        finally:
            browser.close()


def family_of(pid: int) -> list[int]:
    """A process and all that it has started."""
    parents = {}
    for entry in Path('/proc').glob('[0-9]*/stat'):
        with contextlib.suppress(OSError):
            fields = entry.read_text().rpartition(')')[2].split()
            parents.setdefault(int(fields[1]), []).append(int(entry.parent.name))
    found = [pid]
    for each in found:
        found += parents.get(each, [])
    return found


def taken(pids: list[int]) -> float:
    """Processor time of some processes so far, s."""
    total = 0.0
    for pid in pids:
        with contextlib.suppress(OSError):
            total += cpu_seconds(pid)
    return total


def disk(seconds: float) -> Iterator[str]:
    """What a run takes that is recorded as `lathe-chatter run --page` has it, noise and all."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder, 'run')
        with (
            running(LATHE, '-p', 'force_noise:=0.001'),
            running(MONITOR),
            running(RECORDER, '-p', f'output:={run}'),
        ):
            sizes = []
            for _ in range(2):
                time.sleep(seconds)
                sizes.append(sum(file.stat().st_size for file in run.glob('*.mcap')))
    yield f'a run on disk: {(sizes[1] - sizes[0]) / seconds * 3.6e-6:.2f} GB an hour'


def feed(seconds: float) -> Iterator[str]:
    """Processor time of the node for the feed alone and with frames, and of the browser."""
    with running(LATHE), page() as (pid, url):
        silent = Viewer(url, frames=False)
        time.sleep(SETTLING)
        before = cpu_seconds(pid)
        time.sleep(seconds)
        alone = 100.0 * (cpu_seconds(pid) - before) / seconds
        yield f'node, the feed from DDS alone: {alone:.1f} % of a core'
        viewer = Viewer(url, frames=True)
        time.sleep(SETTLING)
        before, count = cpu_seconds(pid), viewer.count
        time.sleep(seconds)
        more = 100.0 * (cpu_seconds(pid) - before) / seconds - alone
        rate = (viewer.count - count) / seconds
        yield f'node, {rate:.1f} frames/s over that: {more:.1f} % of a core more'
        viewer.close()
        with browser_at(url) as browser:
            time.sleep(SETTLING)
            family = family_of(browser.process.pid)
            before, node = taken(family), cpu_seconds(pid)
            shown = browser.run('frames')
            time.sleep(seconds)
            share = 100.0 * (taken(family) - before) / seconds
            node = 100.0 * (cpu_seconds(pid) - node) / seconds
            rate = (browser.run('frames') - shown) / seconds
            yield (
                f'browser at {rate:.1f} frames/s, no graphics card: {share:.1f} % of a core; '
                f'the node then {node - alone:.1f} % more than the feed'
            )
        silent.close()


def slider(sets: int = 100) -> Iterator[str]:
    """From a wish that leaves a client to when the first sample cut with it was published."""
    with running(LATHE), page() as (_, url), ear() as listener:
        changes: list[float] = []

        def note(entry: Log) -> None:
            change = parse_change(entry.msg)
            if change is not None:
                changes.append(change.time)

        listener.listen_to_samples()
        listener.node.create_subscription(Log, '/rosout', note, _KEPT)
        listener.wait_for_samples()
        viewer = Viewer(url, frames=False)
        viewer.ask(do='operate', id=2)
        listener.spin(limit=SETTLING)
        asked = []
        for k in range(sets):
            asked.append(time.time_ns())
            depth = 0.0005 + 1e-6 * (k % 2 + 1)
            viewer.ask(do='set', node='lathe', values={'depth_of_cut': depth}, id=3 + k)
            listener.spin(
                lambda k=k: len(changes) > k and listener.ends[-1] > changes[-1], limit=10.0
            )
            viewer.ask(do='next')  # takes the answer: a viewer that takes none is not served
            viewer.socket.recv(timeout=_PATIENCE)
        first = np.searchsorted(np.array(listener.ends), np.array(changes), side='right')
        sent = np.array(listener.sent)[first]
        delay = (sent - np.array(asked[: len(sent)])) / 1e6
        p50, p95 = np.quantile(delay, [0.5, 0.95])
        yield f'slider to first sample, {len(delay)} times: {p50:.1f} ms (p50), {p95:.1f} ms (p95)'
        viewer.close()


def _late(listener: Ear, seconds: float) -> float:
    """99 % of the ticks of some seconds are late by less, ms."""
    begin = len(listener.sent)
    listener.spin(limit=seconds)
    sent = np.array(listener.sent[begin:], dtype=np.int64)
    late = (sent - sent[0]) / 1e6 - 1e3 * TICK * np.arange(sent.size)
    return float(np.quantile(late - np.quantile(late, 0.01), 0.99))


def lateness(seconds: float, pairs: int) -> Iterator[str]:
    """The lathe's ticks without and with a page and three viewers, in turn."""
    found = []
    with running(LATHE), ear() as listener:
        listener.listen_to_samples()
        listener.wait_for_samples()
        for _ in range(pairs):
            without = _late(listener, seconds)
            with page() as (_, url):
                viewers = [Viewer(url, frames=True) for _ in range(3)]
                listener.spin(limit=SETTLING)
                found.append((without, _late(listener, seconds)))
                for viewer in viewers:
                    viewer.close()
            listener.spin(limit=1.0)
    without, with_page = np.median(found, axis=0)
    ratio = float(np.median([b / a for a, b in found]))
    yield (
        f'lateness p99, {pairs} pairs of {seconds:.0f} s: {without:.3f} ms without, '
        f'{with_page:.3f} ms with page and 3 viewers; ratio {ratio:.2f} in the median'
    )


def memory(minutes: float) -> Iterator[str]:
    """What node and page have more at the end of watching than after its first fifth."""
    with running(LATHE), running(MONITOR), page() as (pid, url), browser_at(url) as browser:

        def now() -> tuple[float, float]:
            browser.command('HeapProfiler.collectGarbage')
            return resident(pid), browser.run('performance.memory.usedJSHeapSize') / 1e6

        series = []
        for _ in range(6):
            until = time.monotonic() + 10.0 * minutes
            while time.monotonic() < until:
                browser.run('0')  # takes what it tells of the feed: a browser keeps that for ever
                time.sleep(1.0)
            series.append(now())
        node, heap = np.array(series).T
        yield (
            f'{minutes:.0f} minutes of watching: node {node[0]:.1f} MB at a sixth, {node[-1]:.1f} '
            f'at the end; scripts of the page {heap[0]:.1f} and {heap[-1]:.1f} MB'
        )
