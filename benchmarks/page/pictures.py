"""The pictures of the page in README and docs: a real cell that chatters, in a real browser."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

from live import browser_at, page
from processes import LATHE, MONITOR, RECORDER, running

_DEPTH = 0.62
"""mm, at which the clearance of the bearing makes the cut chatter."""


def take(folder: Path) -> Iterator[str]:
    """On a wide screen and on a phone, at chatter."""
    run = folder.resolve() / 'run-of-the-pictures'
    with (
        running(LATHE),
        running(MONITOR),
        running(RECORDER, '-p', f'output:={run}', '-p', 'autostart:=false'),
        running('chatter_supervisor', '-p', 'mode:=ask'),
        page() as (_, url),
        browser_at(url) as browser,
    ):
        browser.until('document.querySelector("#lamp-word").textContent === "stable"', 'it', 600)
        browser.until('cell.supervisor_rows', 'the supervisor', 600)
        time.sleep(4.0)
        browser.click('#operate')
        browser.until('server.operating', 'the right to act')
        browser.enter('#p-depth_of_cut', str(_DEPTH))
        browser.until('cell.flag?.up && cell.figures?.recommended_speed_rpm', 'chatter', 600)
        browser.until('cell.action?.includes("~/accept")', 'the question', 600)
        for name, width, height in (('page', 1440, 1000), ('page_phone', 390, 1400)):
            browser.resize(width, height)
            browser.run('scrollTo(0, 0)')
            time.sleep(2.0)
            browser.picture(folder / f'{name}.png', whole=False)
            yield f'{folder / name}.png'
