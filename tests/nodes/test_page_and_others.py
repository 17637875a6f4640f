"""The page with a supervisor, several lathes, a scenario and a token, in a real browser."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

import pytest
from support.browser import Browser, chromium
from support.page_cell import LAMP, PATIENCE, Page, cell, header_of, looking_at, operate
from websockets.sync.client import connect

if chromium() is None:
    pytest.skip('no Chromium is here', allow_module_level=True)

TOKEN = 'a token of a test'  # noqa: S105 -- none of a secret


@pytest.fixture(scope='module')
def page(domain: int, compiled: None, tmp_path_factory: Any) -> Iterator[Page]:  # noqa: ARG001
    with cell(tmp_path_factory.mktemp('cell')) as page:
        page.start('operator_page', 'port:=0', f'token:={TOKEN}')
        page.start('chatter_monitor')
        page.start('chatter_supervisor', 'mode:=ask', 'hands_off:=0.5')
        page.start('lathe', 'bearing_contact:=none')
        yield page


@pytest.fixture(scope='module')
def browser(page: Page, tmp_path_factory: Any) -> Iterator[Browser]:
    url = f'{page.url()}#token={TOKEN.replace(" ", "%20")}'
    with looking_at(url, tmp_path_factory.mktemp('profile')) as browser:
        # Only now: a page shows the lathe that it finds first.
        page.nodes.start('lathe', namespace='/second')
        yield browser


def answer_to(socket: Any, **wish: Any) -> dict[str, Any]:
    """What the page says to a wish."""
    socket.send(json.dumps({**wish, 'id': 7}))
    while True:
        socket.send('{"do": "next"}')
        for answer in header_of(socket.recv(timeout=PATIENCE)).get('answers', []):
            if answer['id'] == 7:
                return dict(answer)


def test_who_holds_no_token_looks_and_does_not_act(page: Page, browser: Browser) -> None:
    url, origin = page.url().replace('http', 'ws') + 'feed', page.url().rstrip('/')
    assert browser.run('server.trusted')
    assert 'token' not in browser.run('location.href')
    with connect(url, origin=origin, proxy=None, max_size=None) as stranger:
        refused = answer_to(stranger, do='operate')
        assert refused == {**refused, 'ok': False}
        assert refused['text'] == 'Without the token you may look, and not act.'
        assert not answer_to(stranger, do='token', token=TOKEN[:-1])['ok']
        assert not answer_to(stranger, do='operate')['ok']
        assert answer_to(stranger, do='token', token=TOKEN)['ok']
        assert answer_to(stranger, do='operate')['ok']


def test_the_page_says_who_has_no_token(page: Page) -> None:
    stranger = Browser(page.folder / 'profile of a stranger')
    try:
        stranger.open(page.url())
        said = 'document.querySelector("#viewers").textContent'
        told = 'without the token: you may look, and not act.'
        stranger.until(f'{said}.endsWith("{told}")', 'that it may not act')
        assert stranger.run('document.querySelector("#operate").disabled')
    finally:
        stranger.close()


def test_the_supervisor_asks_in_the_page_and_is_answered_there(browser: Browser) -> None:
    operate(browser)
    browser.until('document.querySelector("#mode").value === "ask"', 'its mode', PATIENCE)
    browser.enter('#p-depth_of_cut', '1')
    browser.until(f'{LAMP} === "CHATTER"', 'the lamp', PATIENCE)
    asked = 'document.querySelector("#action").textContent'
    browser.until(f'{asked}.includes("press Accept")', 'the question', PATIENCE)
    question = browser.text('#question-text')
    assert re.search(r'set spindle speed from 3000 to \d[\d.]* rev/min \(', question)
    assert not re.search(r'_rpm|~/| um\b|1/s', question)
    seen = browser.run('document.querySelector("#question").getBoundingClientRect().bottom')
    assert 0 < seen <= browser.run('innerHeight')
    assert browser.run('cell.lathe_values.spindle_speed_rpm') == 3000.0
    browser.click('[data-call=accept]')
    notice = 'document.querySelector("#notice").textContent'
    answer = browser.until(f'/I set/.test({notice}) && {notice}', 'the answer')
    assert not re.search(r'_rpm| um\b|1/s', answer)
    browser.until('cell.lathe_values.spindle_speed_rpm !== 3000', 'the move', PATIENCE)
    browser.until('document.querySelector("#question").hidden', 'no question any more')
    browser.until(f'{LAMP} === "stable"', 'the lamp out', PATIENCE)
    browser.until(f'{asked}.includes("has ended")', 'what came of it', PATIENCE)
    browser.run('document.querySelector("#mode").focus()')
    browser.key('s', 83, 's')  # shadow, by the keyboard
    browser.until('cell.supervisor_values.mode === "shadow"', 'another mode', PATIENCE)
    assert browser.complaints == []


def test_a_scenario_is_played_from_the_page_and_stopped(browser: Browser) -> None:
    operate(browser)
    browser.run('document.querySelector("#scenario").value = "no_clearance"')
    browser.click('#play')
    said = 'document.querySelector("#scenario-text").textContent'
    browser.until(f'{said} && document.querySelector("#play").textContent === "Stop"', 'it')
    browser.until('signals.time < 3 && cell.lathe_values.depth_of_cut === 0.0005', 'its start')
    browser.until('cell.lathe_values.depth_of_cut === 0.00062', 'its step', PATIENCE)
    browser.click('#play')
    browser.until(f'{said}.includes("is stopped")', 'its end')


def test_a_scenario_that_needs_a_supervisor_is_refused_without(
    page: Page, browser: Browser
) -> None:
    operate(browser)
    page.kill('chatter_supervisor')
    browser.until('!cell.alive.supervisor', 'its silence', PATIENCE)
    answer = browser.run('ask({do: "play", scenario: "asked"})')
    assert 'needs a chatter_supervisor, and none is here' in answer['text']


def test_another_lathe_is_chosen_and_driven(browser: Browser) -> None:
    operate(browser)
    chosen = 'document.querySelector("#lathes")'
    browser.until(f'{chosen}.options.length === 2', 'both lathes', PATIENCE)
    before = browser.run('cell.lathe_values.depth_of_cut')
    browser.run(f'{chosen}.value = "/second/lathe"; {chosen}.onchange()')
    browser.until('cell.name === "/second/lathe" && cell.lathe_values', 'the other', PATIENCE)
    browser.until('document.querySelector("#supervisor").hidden', 'no supervisor there')
    browser.enter('#p-depth_of_cut', '0.41')
    browser.until('cell.lathe_values.depth_of_cut === 0.00041', 'the change', PATIENCE)
    browser.run(f'{chosen}.value = "/lathe"; {chosen}.onchange()')
    browser.until('cell.name === "/lathe" && cell.lathe_values', 'the first', PATIENCE)
    assert browser.run('cell.lathe_values.depth_of_cut') == before
    assert browser.complaints == []


def test_another_page_is_told_of(browser: Browser, page: Page) -> None:
    viewers = 'document.querySelector("#viewers").textContent'
    assert 'Another operator page' not in browser.run(viewers)
    page.nodes.start('operator_page', 'port:=0', namespace='/second')
    browser.until(f'{viewers}.includes("Another operator page serves")', 'the other', PATIENCE)
