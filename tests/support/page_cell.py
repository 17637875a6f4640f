"""The nodes of a cell with its page, for tests with a real browser."""

from __future__ import annotations

import json
import re
import signal
import struct
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from support.browser import Browser
from support.node_processes import NodeProcesses

PATIENCE = 120.0
LAMP = 'document.querySelector("#lamp-word").textContent'


class Page:
    """Nodes of one cell with a page, and a browser that has it open."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.nodes = NodeProcesses(folder)
        self.started: dict[str, Any] = {}

    def start(self, node: str, *parameters: str) -> None:
        self.started[node] = self.nodes.start(node, *parameters)

    def kill(self, node: str) -> None:
        self.started[node].send_signal(signal.SIGKILL)
        self.started[node].wait()

    def url(self) -> str:
        """Where the page is, once it says so."""
        until = time.monotonic() + PATIENCE
        while not (found := re.findall(r'The page is at (\S+)', self.nodes.said())):
            assert time.monotonic() < until, self.nodes.said()
            time.sleep(0.1)
        return str(found[-1])


@contextmanager
def cell(folder: Path) -> Iterator[Page]:
    """Nodes to start; what they said is printed when they have ended."""
    page = Page(folder)
    yield page
    page.nodes.end()
    sys.stdout.write(page.nodes.said())


@contextmanager
def recorded_cell(folder: Path, *of_lathe: str) -> Iterator[Page]:
    """A page with recorder, monitor and a lathe that has some parameters."""
    with cell(folder) as page:
        page.start('operator_page', 'port:=0')
        page.start('run_recorder', f'output:={page.folder / "run"}')
        page.start('chatter_monitor')
        page.start('lathe', *of_lathe)
        yield page


@contextmanager
def looking_at(url: str, profile: Path) -> Iterator[Browser]:
    """A browser with the page of a lathe that cuts."""
    browser = Browser(profile)
    browser.open(url)
    browser.until(f'{LAMP} === "stable"', 'a stable cut', PATIENCE)
    browser.until('document.querySelector("#p-depth_of_cut")', 'the controls', PATIENCE)
    yield browser
    browser.close()


def header_of(frame: bytes) -> dict[str, Any]:
    """What a frame of the page begins with: its length in four bytes, then JSON."""
    (length,) = struct.unpack_from('<I', frame)
    return dict(json.loads(frame[4 : 4 + length]))


def operate(browser: Browser) -> None:
    if browser.run('document.querySelector("#operate").getAttribute("aria-pressed")') != 'true':
        browser.click('#operate')
        browser.until('server.operating', 'the right to act')


def old_words(browser: Browser) -> str:
    """What a page has to say whose figures hold no more, by what it has lost before."""
    lost = browser.run('signals?.lost ?? 0')
    return 'What you see is old.' + (f' Lost: {lost} by this page.' if lost else '')
