"""What the page of a recorded run says of what is not in it, in a real browser."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from support.browser import Browser, chromium
from support.served_page import serving

from lathe_chatter.lathe.config import recorded_config
from lathe_chatter.model.lathe_parameter_table import parameters_of
from lathe_chatter.page.recorded_run import RecordedRun
from lathe_chatter.page.server import PageServer
from lathe_chatter.recording import LatheRun

PATIENCE = 120.0
GONE = 'document.querySelector("#gone")'


@pytest.fixture
def unheard(tmp_path: Path) -> Path:
    """Eight seconds that no monitor heard, three of which are missing."""
    lathe = recorded_config({}).lathe()
    with LatheRun(tmp_path / 'run', parameters_of(lathe)) as written:
        for k in range(80):
            block = lathe.advance(1000)
            if not 30 <= k < 60:
                written.write(block)
    return tmp_path / 'run'


def page_of(path: Path, port: int = 0) -> PageServer:
    """The page of a run that is read, on a port."""
    shown = RecordedRun(path)
    asyncio.run(shown.read())
    return PageServer(shown, '127.0.0.1', port)


@pytest.mark.skipif(chromium() is None, reason='no Chromium is here')
def test_it_claims_nothing_of_what_is_not_in_the_record(unheard: Path, tmp_path: Path) -> None:
    browser = Browser(tmp_path / 'profile')
    drawn = '["tool-portrait", "spectrum"].map(id => plots.get(id)?.root.ariaLabel)'
    try:
        page = page_of(unheard)
        with serving(page):
            browser.open(page.url)
            browser.until(f'{drawn}.every(text => text?.includes("\\u00b5m"))', 'the last of it')
            assert browser.text('#lamp-word') == 'unknown'
            browser.run('look(5.5, 1)')
            none = 'Nothing has come to be shown here.'
            browser.until(f'{drawn}.every(text => text === "{none}")', 'that there is nothing')
            assert browser.complaints == []
        browser.until(f'{GONE}.textContent.includes("does not answer")', 'that it is gone')
        with serving(page_of(unheard, page.port)):
            browser.until(f'{GONE}.hidden', 'that it is back', PATIENCE)
            unheard.rename(tmp_path / 'elsewhere')
            browser.run('look(2.5, 0.1)')
            said = 'document.querySelector("#notice").textContent'
            browser.until(f'{said}.includes("cannot be read: No such file")', 'that it is away')
        # That nobody answered meanwhile the browser itself notes.
        assert all('ERR_CONNECTION_REFUSED' in each for each in browser.complaints)
    finally:
        browser.close()
