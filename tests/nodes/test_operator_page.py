"""The operator's page in a real browser, over real nodes: what a person at it sees and does."""

from __future__ import annotations

import http.client
import http.server
import json
import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.browser import Browser, chromium
from support.page_cell import LAMP, PATIENCE, Page, header_of, old_words, operate, recorded_cell
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

if chromium() is None:
    pytest.skip('no Chromium is here', allow_module_level=True)


@pytest.fixture(scope='module')
def page(domain: int, compiled: None, tmp_path_factory: Any) -> Iterator[Page]:  # noqa: ARG001
    with recorded_cell(tmp_path_factory.mktemp('cell')) as page:
        yield page


def until_closed(socket: Any) -> None:
    while True:
        socket.recv(timeout=PATIENCE)


def value_of(browser: Browser, name: str) -> float:
    """A parameter as the lathe has told it."""
    return float(browser.run(f'cell.lathe_values.{name}'))


def test_it_shows_the_cut_and_asks_nothing_of_other_places(page: Page, browser: Browser) -> None:
    browser.until('cell.chart?.speed', 'the chart', PATIENCE)
    browser.until('document.querySelector("#chart-text").textContent', 'its text')
    # The numbers of the README: open 0.665 mm, on its bearing 0.467 mm at 3000 rev/min.
    said = browser.text('#chart-text')
    assert 'open 0.665 mm' in said
    assert 'on its bearing 0.467 mm' in said
    for plot in ('displacement-0', 'displacement-1', 'velocity-0', 'tool-portrait', 'spectrum'):
        browser.until(f'document.querySelector("#{plot} canvas")', plot)
    browser.until('document.querySelector("#health").textContent.includes("real time")', 'pace')
    assert {url.split('/')[2] for url in browser.requests} == {page.url().split('/')[2]}
    assert browser.complaints == []


def test_nobody_acts_before_he_says_so(browser: Browser) -> None:
    disabled = 'document.querySelector("#p-depth_of_cut").disabled'
    assert browser.run(disabled)
    answer = browser.run('ask({do: "set", node: "lathe", values: {depth_of_cut: 0.001}})')
    assert answer == {**answer, 'ok': False, 'text': 'You are looking on: press Operate first.'}
    operate(browser)
    assert not browser.run(disabled)


def test_a_slider_provokes_chatter_and_the_recommended_speed_cures_it(browser: Browser) -> None:
    operate(browser)
    browser.run('document.querySelector("[aria-label^=\\"depth of cut\\"]").focus()')
    for _ in range(2):
        browser.key('PageUp', 33)  # by a tenth of the slider each
    browser.until('cell.lathe_values.depth_of_cut > 0.0006', 'the deeper cut')
    browser.until(f'{LAMP} === "CHATTER"', 'the lamp', PATIENCE)
    since = 'document.querySelector("#lamp-since").textContent'
    dated = browser.until(since, 'since when').removeprefix('since ').removesuffix(' s')
    told = re.findall(r'At ([\d.]+) s: chatter', browser.text('#log'))
    assert dated in [f'{float(at):.2f}' for at in told]  # lamp and sentence tell the same
    browser.until('cell.figures.growth_rate', 'the growth rate', PATIENCE)
    browser.until('!document.querySelector("#take-recommended").disabled', 'a speed', PATIENCE)
    browser.click('#take-recommended')
    browser.until('cell.lathe_values.spindle_speed_rpm !== 3000', 'the new speed')
    browser.until(f'{LAMP} === "stable"', 'the lamp out', PATIENCE)
    assert 'depth 0.5 mm →' in browser.text('#log')
    assert browser.complaints == []


def test_a_refusal_is_read_and_the_control_goes_back(browser: Browser) -> None:
    operate(browser)
    before = value_of(browser, 'depth_of_cut')
    browser.enter('#p-depth_of_cut', '5000')
    refusal = 'document.querySelector(".refusal:not(:empty)")?.textContent'
    said = browser.until(refusal, 'the refusal')
    assert said == ('5000 mm: it must be a finite number from 0 to 100 mm. Nothing was changed.')
    shown = browser.run('Number(document.querySelector("#p-depth_of_cut").value)')
    assert shown == pytest.approx(1e3 * before)
    assert value_of(browser, 'depth_of_cut') == before


def test_a_cut_that_has_ended_says_so_and_begins_anew(browser: Browser) -> None:
    operate(browser)
    browser.run('act({do: "knock", impulse: 1e5})')
    told = browser.until(
        '/Reset/.test(document.querySelector("#gone").textContent) && '
        'document.querySelector("#gone").textContent', 'how it goes on'
    )  # fmt: skip
    assert 'displacement' in told
    browser.until(f'{LAMP} === "unknown"', 'that nothing is known of it')
    health = 'document.querySelector("#health").textContent'
    browser.until(f'{health} === "The cut has ended."', 'that it has ended')
    browser.click('#knock')
    said = 'document.querySelector("#notice").textContent'
    browser.until(f'{said} === "The cut has ended: nothing was hit."', 'that nothing was hit')
    browser.click('[data-call=reset]')
    browser.until(f'{LAMP} === "stable"', 'a stable cut', PATIENCE)
    browser.until('document.querySelector("#gone").hidden', 'nothing amiss', PATIENCE)
    assert browser.run('document.querySelector("#lamp-since").textContent') == ''


def test_pause_step_knock_and_recording(page: Page, browser: Browser) -> None:
    operate(browser)
    browser.click('[data-call=pause]')
    browser.until('document.querySelector("[data-call=resume]")', 'the pause')
    time.sleep(0.5)  # until all that was cut before has come
    time_before = browser.run('signals.time')
    browser.click('[data-call=step]')
    browser.until(f'signals.time > {time_before}', 'a step')
    assert browser.run('signals.time') == pytest.approx(time_before + 0.002)
    browser.click('[data-call=resume]')
    browser.until('document.querySelector("[data-call=pause]")', 'to go on')
    browser.click('#knock')
    browser.until('document.querySelector("#log").innerText.includes("knock of 0.002 N s")', 'it')
    browser.enter('#impulse', '1e12')
    browser.click('#knock')
    browser.until(
        'document.querySelector("#notice").textContent.includes("Nothing was hit")', 'no'
    )
    browser.enter('#impulse', '2')
    browser.until('document.querySelector("#snapshot").disabled', 'that all is written')
    log = 'document.querySelector("#log").innerText'
    browser.click('[data-call=record_split]')
    browser.until(f'{log}.includes("Going on in a new file.")', 'the new file')
    browser.click('[data-call=record_stop]')
    browser.until('document.querySelector("#recording").textContent.includes("not rec")', 'an end')
    browser.until(f'/ holds \\d+ messages/.test({log})', 'what was recorded')
    browser.click('#snapshot')
    browser.until(
        'document.querySelector("#notice").textContent.includes("Nothing is kept in memory")',
        'the refusal of the recorder',
    )
    assert (page.folder / 'run' / 'metadata.yaml').exists()


def test_a_spectrum_of_any_height_is_drawn(browser: Browser) -> None:
    """uPlot never ends dividing a logarithmic axis that begins at some values, as at 9.6e-12."""
    heights = [*np.geomspace(0.95e-6, 1.02e-6, 60), *np.geomspace(1e-12, 1e6, 80), 0.0]
    drawn = browser.run(
        f'(async () => {{ const drawn = []; for (const top of {json.dumps(heights)}'
        '.concat([NaN, Infinity])) {'
        'drawSpectrum(Float32Array.from([0, top, top / 2]), 1, 3000, null);'
        'await null; const {min, max} = plots.get("spectrum").scales.y; drawn.push([min, max]); }'
        'return drawn; })()'
    )
    assert len(drawn) == len(heights) + 2
    assert all(0 < low < high <= low * 1e6 for low, high in drawn)
    assert browser.complaints == []


def test_a_foreign_page_is_kept_out(page: Page, browser: Browser, tmp_path: Path) -> None:
    url = page.url().replace('http', 'ws') + 'feed'
    host = page.url().split('/')[2]
    with connect(url, origin=f'http://{host}', proxy=None) as socket:
        socket.send('{"do": "next"}')
        assert len(socket.recv(timeout=PATIENCE)) > 8
    for origin in ('http://elsewhere.example', None):
        with pytest.raises(InvalidStatus, match='403'):
            connect(url, origin=origin, proxy=None)
    for path in ('/', '/feed'):  # as where a foreign name is made to lead here
        asked = http.client.HTTPConnection(host)
        asked.request('GET', path, headers={'Host': 'elsewhere.example'})
        assert asked.getresponse().status == 403
    # And so in a browser: a page of another origin cannot open the socket, nor frame the page.
    (tmp_path / 'index.html').write_text('<!DOCTYPE html><title>foreign</title>')
    handler = partial(http.server.SimpleHTTPRequestHandler, directory=str(tmp_path))
    with http.server.ThreadingHTTPServer(('127.0.0.1', 0), handler) as foreign:
        threading.Thread(target=foreign.serve_forever, daemon=True).start()
        other = Browser(tmp_path / 'profile')
        try:
            other.open(f'http://127.0.0.1:{foreign.server_port}/')
            opened = other.run(
                f'new Promise(done => {{ const s = new WebSocket({json.dumps(url)});'
                's.onopen = () => done("open"); s.onerror = () => done("refused"); })'
            )
            assert opened == 'refused'
        finally:
            other.close()
            foreign.shutdown()
    assert browser.run('socket.readyState') == 1


def test_bad_frames_floods_sleepers_and_a_crowd_harm_nobody(page: Page, browser: Browser) -> None:
    url, origin = page.url().replace('http', 'ws') + 'feed', page.url().rstrip('/')
    join: Callable[[], Any] = partial(connect, url, origin=origin, proxy=None, max_size=None)
    crowd = [join() for _ in range(20)]
    for sleeper in crowd[:5]:  # they ask, and never read
        sleeper.send('{"do": "next"}')
    for bad in (crowd[5], crowd[6]):
        for text in ('no JSON', '[]', '{"do": 3}', '{"do": "set"}', '{"do": "choose"}', '1e999'):
            bad.send(text)
        bad.send(b'\x00\xff')
    for _ in range(1000):
        with suppress(ConnectionClosed):
            crowd[7].send('{"do": "next"}')
    crowd[8].send('x' * 100_000)
    for sent_away in (crowd[7], crowd[8]):
        with pytest.raises(ConnectionClosed):
            until_closed(sent_away)
    for viewer in crowd[9:]:
        viewer.send('{"do": "next"}')
        frame = viewer.recv(timeout=PATIENCE)
        assert header_of(frame)['page']['lathes'] == ['/lathe']
    before = browser.run('frames')
    browser.until(f'frames > {before} + 20', 'frames', PATIENCE)
    for viewer in crowd:
        viewer.close()
    browser.until('server.viewers === 1', 'the end of the others', PATIENCE)


def test_one_operates_and_another_may_take_over(page: Page, browser: Browser) -> None:
    operate(browser)
    other = Browser(page.folder / 'other profile')
    try:
        other.open(page.url())
        other.until('server.operator', 'who operates')
        answer = other.run('ask({do: "operate"})')
        assert answer['ok'] is False
        assert answer['text'].endswith('operates already.')
        assert other.text('#operate') == 'Take over'
        other.click('#operate')
        other.until('server.operating', 'the right to act')
        browser.until('!server.operating', 'its loss')
        browser.until('document.querySelector("#notice").textContent.includes("taken over")', '')
    finally:
        other.close()
    browser.until('!server.operator', 'nobody to operate', PATIENCE)
    operate(browser)


@pytest.mark.parametrize('width', [390, 1280])
@pytest.mark.parametrize('dark', [False, True])
def test_it_fits_the_screen_and_axe_has_nothing_to_say(
    browser: Browser, width: int, dark: bool
) -> None:
    axe = pytest.importorskip('axe_core_python', reason='axe-core is not there')
    browser.resize(width, dark=dark)
    time.sleep(1.0)  # until it is laid out and drawn anew
    assert browser.run('document.documentElement.scrollWidth') <= width
    wide = browser.run(
        '[...document.querySelectorAll("main *")].filter(e => e.getBoundingClientRect().right > '
        'innerWidth + 1 && !e.closest(".plot")).map(e => e.outerHTML.slice(0, 80))'
    )
    assert wide == []
    browser.run((Path(axe.__file__).with_name('axe.min.js')).read_text())
    found = browser.run(
        'axe.run().then(r => r.violations.map(v => v.id + ": " + v.nodes.map(n => '
        'n.html.slice(0, 120) + " " + n.failureSummary).join(" | ")))'
    )
    browser.resize(1280)
    assert found == []


def test_the_plots_stay_together_beside_controls_of_any_length(browser: Browser) -> None:
    def box(of: str, side: str) -> float:
        return float(browser.run(f'document.querySelector("{of}").getBoundingClientRect().{side}'))

    more = '[...document.querySelectorAll("#controls details")].forEach(e => { e.open = %s; })'
    browser.resize(1400)
    try:
        drawn = 'plots.get("chart") && plots.get("spectrum") && plots.get("workpiece-portrait")'
        browser.until(drawn, 'the plots', PATIENCE)
        browser.run(more % 'true')
        plots = max(box('.signals', 'bottom'), box('.closeup', 'bottom'))
        assert box('.controls', 'bottom') > plots + 200
        assert box('.log', 'top') - plots < 20
        assert box('.closeup', 'top') - box('.chart', 'bottom') < 20
    finally:
        browser.run(more % 'false')
        browser.resize(1280)


def test_legends_follow_the_theme(browser: Browser) -> None:
    browser.until('plots.get("chart") && plots.get("displacement-0")', 'chart and signals')
    mark = '.u-series:not(:first-child) .u-marker'
    marks = f'document.querySelectorAll("#chart {mark}, #displacement-0 {mark}")'
    seen = []
    try:
        for dark in (False, True):
            browser.resize(1280, dark=dark)
            browser.until(
                f'matchMedia("(prefers-color-scheme: dark)").matches === {str(dark).lower()}', ''
            )
            tool = browser.run(
                '(e => { e.style.color = "var(--tool)"; document.body.append(e); '
                'const c = getComputedStyle(e).color; e.remove(); return c; })'
                '(document.createElement("i"))'
            )
            found = browser.run(f'[...{marks}].map(e => getComputedStyle(e).borderTopColor)')
            assert tool in found
            seen.append(found)
    finally:
        browser.resize(1280)
    styles = browser.run(f'[...{marks}].map(e => getComputedStyle(e).borderTopStyle)')
    assert {'solid', 'dashed', 'dotted'} <= {*styles}
    spectrum = 'plots.get("spectrum").scales.x.max === 1000'  # of 130 Hz, not 2000
    browser.until(spectrum, 'its frequency, of the monitor', PATIENCE)
    assert len(seen[0]) == len(seen[1])
    assert all(light != dark for light, dark in zip(*seen, strict=True))


def test_a_killed_lathe_is_told_and_is_back_by_itself(page: Page, browser: Browser) -> None:
    operate(browser)
    browser.until('document.querySelector("#health").textContent.includes("real time")', 'pace')
    page.kill('lathe')
    browser.until('document.querySelector("#gone").textContent.includes("/lathe is silent")', '')
    assert browser.run(LAMP) == 'unknown'
    assert browser.run('document.querySelector("#lamp").className').strip() == 'lamp'
    assert browser.text('#health') == old_words(browser)
    browser.run('takeCell({figures: {recommended_speed_rpm: 4000}}), showFigures()')
    assert browser.run('document.querySelector("#take-recommended").disabled')
    browser.click('#knock')
    said = 'document.querySelector("#notice").textContent'
    browser.until(f'{said} === "/lathe is not there."', 'that nobody was hit')
    page.start('lathe')
    browser.until('document.querySelector("#gone").hidden', 'the lathe', PATIENCE)
    browser.until('signals.time > 1 && signals.time < 60', 'its time', PATIENCE)
    browser.until('cell.lathe_values.depth_of_cut === 0.0005', 'its parameters', PATIENCE)


def test_a_killed_page_is_told_and_is_back_by_itself(page: Page, browser: Browser) -> None:
    operate(browser)
    port = page.url().split(':')[2].strip('/')
    page.kill('operator_page')
    said = 'document.querySelector("#gone").textContent'
    browser.until(f'{said}.includes("does not answer")', 'that it is gone')
    assert browser.run(LAMP) == 'unknown'
    assert browser.text('#health') == old_words(browser)
    assert browser.run('document.querySelector("#p-depth_of_cut").disabled')
    page.start('operator_page', f'port:={port}')
    browser.until('document.querySelector("#gone").hidden && signals', 'the page', PATIENCE)
    said = 'document.querySelector("#notice").textContent'
    browser.until(f'{said}.includes("you are looking on")', 'that control is lost')
    begun = browser.run('document.querySelector("#log").lastElementChild.textContent')
    assert re.fullmatch(r'This page began at \d\d:\d\d:\d\d and lists the newest: .*', begun)
    browser.until(f'{LAMP} === "stable"', 'the lamp', PATIENCE)


def test_another_host_needs_a_token_and_a_taken_port_is_said(page: Page) -> None:
    port = page.url().split(':')[2].strip('/')
    for parameter, said in (
        ('host:=0.0.0.0', 'give a token of 16 characters'),
        ('token:=short', 'token has 5 characters: it must have 16 or more.'),
        (f'port:={port}', f'port {port} of 127.0.0.1 cannot be had'),
    ):
        page.start('operator_page', parameter)
        assert page.started['operator_page'].wait(PATIENCE) == 2
        assert said in page.nodes.said()
    assert 'Traceback' not in page.nodes.said()
