"""What the page says of who is silent, itself included, in a real browser over real nodes."""

from __future__ import annotations

import re
import signal
from collections.abc import Iterator
from typing import Any

import pytest
from support.browser import Browser, chromium
from support.page_cell import LAMP, PATIENCE, Page, cell, old_words, operate

if chromium() is None:
    pytest.skip('no Chromium is here', allow_module_level=True)

SEEN = 'document.querySelector("%s").textContent'
GONE = SEEN % '#gone'
WATCH = (
    'window.told = []; (gone => new MutationObserver(() => told.push(gone.textContent))'
    '.observe(gone, {childList: true}))(document.querySelector("#gone"))'
)
"""Notes whatever the banner says from now on."""
UNANSWERED = f'{GONE}.startsWith("The server of this page does not answer. What you see is old.")'


@pytest.fixture(scope='module')
def page(domain: int, compiled: None, tmp_path_factory: Any) -> Iterator[Page]:  # noqa: ARG001
    with cell(tmp_path_factory.mktemp('cell')) as page:
        page.start('operator_page', 'port:=0')
        yield page


@pytest.fixture(scope='module')
def browser(page: Page, tmp_path_factory: Any) -> Iterator[Browser]:
    """One that had the page open before there was a lathe."""
    browser = Browser(tmp_path_factory.mktemp('profile'))
    browser.open(page.url())
    browser.until(GONE, 'that there is none')
    browser.run(f'window.alone = [{GONE}, {SEEN % "#recording"}]')
    page.start('run_recorder', f'output:={page.folder / "run"}')
    page.start('chatter_monitor')
    page.start('lathe')
    browser.until(f'{LAMP} === "stable"', 'a stable cut', PATIENCE)
    yield browser
    browser.close()


def calls_nobody_silent(browser: Browser) -> None:
    """Wait until it is as before, and look at what was said on the way."""
    browser.until('document.querySelector("#gone").hidden && signals', 'the page', PATIENCE)
    browser.until(f'{LAMP} === "stable"', 'the lamp', PATIENCE)
    told = browser.run('told')
    assert told
    assert [text for text in told if re.search('silent|No (recorder|samples)', text)] == []


def test_a_page_without_a_lathe_waits_for_one(browser: Browser) -> None:
    none = 'No lathe has been found. The page waits for one.'
    assert browser.run('alone') == [none, 'No recorder has spoken.']


def test_a_page_that_stands_still_is_told_and_then_blames_nobody(
    page: Page, browser: Browser
) -> None:
    operate(browser)
    browser.until('document.querySelector("#gone").hidden', 'that all speak', PATIENCE)
    browser.run(WATCH)
    process = page.started['operator_page']
    process.send_signal(signal.SIGSTOP)
    try:
        browser.until(UNANSWERED, 'that it does not answer')
        assert browser.run(LAMP) == 'unknown'
        assert browser.text('#health') == old_words(browser)
        assert 'Not known' in browser.text('#recording')
        assert browser.text('#viewers') == ''
        assert browser.run('document.querySelector("#knock").disabled')
        assert browser.run('document.querySelector("#operate").disabled')
    finally:
        process.send_signal(signal.SIGCONT)
    calls_nobody_silent(browser)
    assert 'you operate' in browser.text('#viewers')


def test_a_page_that_has_just_begun_calls_nobody_silent_and_plays_nothing(
    page: Page, browser: Browser
) -> None:
    operate(browser)
    play = 'ask({do: "play", scenario: "no_clearance"}).then(answer => answer.ok)'
    browser.until(play, 'a scenario')  # which a busy lathe may not answer in time
    browser.until('document.querySelector("#play").textContent === "Stop"', 'its button')
    browser.run(WATCH)
    port = page.url().split(':')[2].strip('/')
    page.started['operator_page'].send_signal(signal.SIGSTOP)
    browser.run('void ask({do: "step"}).then(answer => { window.answer = answer.text; })')
    page.kill('operator_page')
    browser.until(f'{UNANSWERED} && {GONE}.includes("Trying again")', 'that it is gone')
    page.start('operator_page', f'port:={port}')
    calls_nobody_silent(browser)
    assert browser.run('answer') == 'The connection was lost before an answer came.'
    assert browser.text('#play') == 'Play'
    assert browser.text('#notice') == 'The connection was lost: you are looking on.'


def test_without_a_monitor_no_figure_holds_though_the_cut_stands_still(
    page: Page, browser: Browser
) -> None:
    operate(browser)
    browser.until(f'{SEEN % "#amplitude"} !== "\\u2013"', 'a figure', PATIENCE)
    browser.click('[data-call=pause]')
    browser.until('document.querySelector("[data-call=resume]")', 'the pause')
    # Whatever else is wrong with its pace, which then is what that says.
    seen = browser.run(
        '(() => { const {pace} = cell.statuses.lathe, {message, level} = pace;'
        ' Object.assign(pace, {message: "behind: time was given up", level: 1}); showAlive();'
        ' const seen = ["[data-call=resume]", "#gone:empty"].map(e => '
        '!!document.querySelector(e)); Object.assign(pace, {message, level}); return seen; })()'
    )
    assert seen == [True, True]
    page.kill('chatter_monitor')
    browser.until(f'{GONE}.includes("nothing is known of chatter")', 'its silence', PATIENCE)
    assert browser.run(LAMP) == 'unknown'
    assert browser.run(SEEN % '#amplitude') == '\u2013'
    browser.run('takeCell({flag: {up: true}, figures: {recommended_speed_rpm: 4000}})')
    assert browser.run('flagged()') is None
    assert browser.run('recommended') is None
    browser.click('[data-call=resume]')


def test_a_lathe_that_waits_for_a_clock_says_why_nothing_comes(
    page: Page, browser: Browser
) -> None:
    page.nodes.start('lathe', 'use_sim_time:=true', namespace='/waiting')
    chosen = 'document.querySelector("#lathes")'
    browser.until(f'{chosen}.options.length === 2', 'both lathes', PATIENCE)
    browser.run(f'{chosen}.value = "/waiting/lathe"; {chosen}.onchange()')
    why = 'No samples come from /waiting/lathe: waiting for /clock.'
    browser.until(f'{GONE}.startsWith("{why}")', why, PATIENCE)
