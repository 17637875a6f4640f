"""A recorded run in the page: what is sent is what is in the file, and a browser scrubs it."""

from __future__ import annotations

import asyncio
import http.client
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from support.browser import Browser, chromium
from support.served_page import serving
from support.two_lathes import FLAGS, record_two_lathes

from lathe_chatter.cli.main import main
from lathe_chatter.errors import LatheChatterError, RunReadError
from lathe_chatter.lathe.config import recorded_config
from lathe_chatter.model.lathe_parameter_table import parameters_of
from lathe_chatter.page.live_signals import SIGNALS
from lathe_chatter.page.recorded_run import RecordedRun
from lathe_chatter.page.server import PageServer, Viewer
from lathe_chatter.recording import LatheRun, RunWriter, read_run
from lathe_chatter.recording.ros_messages import topic_of_type
from lathe_chatter.samples.codec import SAMPLES_TYPE, encode_block

PATIENCE = 120.0
NO_CRC = 'a chunk does not have its CRC'


@pytest.fixture(scope='module')
def run(tmp_path_factory: Any) -> Path:
    """Twelve seconds: a cut that chatters when it gets deeper, and is cured."""
    folder = Path(tmp_path_factory.mktemp('recorded')) / 'run'
    assert main(['simulate', '--scenario', 'clearance', '--output', str(folder)]) == 0
    return folder


def look(shown: RecordedRun, **wish: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    viewer = Viewer('a test', trusted=False)
    assert asyncio.run(shown.look(viewer, wish))
    return shown.frame(viewer)


def columns(arrays: dict[str, Any]) -> Any:
    """Smallest and largest values by signal (2, n, 4)."""
    return np.asarray(arrays['values'])


@pytest.mark.parametrize('read', [False, True])
@pytest.mark.parametrize(('begin', 'end'), [(4.0, 4.05), (3.9, 4.6), (11.99, 20.0)])
def test_a_close_look_is_every_sample_before_and_after_all_is_read(
    run: Path, begin: float, end: float, read: bool
) -> None:
    shown = RecordedRun(run)
    if read:
        asyncio.run(shown.read())
    header, arrays = look(shown, do='view', plot='part', **{'from': begin, 'to': end})
    samples = read_run(run).samples(start=begin, end=end)
    assert header['view'] == {'from': begin, 'to': end, 'plot': 'part'}
    low, high = columns(arrays)
    assert len(low) <= 1001
    for k, name in enumerate(SIGNALS):
        assert low[:, k].min() == pytest.approx(samples.columns[name].min(), rel=1e-6)
        assert high[:, k].max() == pytest.approx(samples.columns[name].max(), rel=1e-6)
    if end - begin < 0.1:
        times = begin + np.asarray(arrays['times'])
        np.testing.assert_allclose(times, samples.columns['time'], atol=1e-9)
        np.testing.assert_array_equal(low[:, 0], samples.columns[SIGNALS[0]])


def test_the_whole_is_the_smallest_and_largest_of_all(run: Path) -> None:
    shown = RecordedRun(run)
    asyncio.run(shown.read())
    _, arrays = look(shown, do='view', plot='overview', **{'from': 0.0, 'to': 12.0})
    samples = read_run(run).samples()
    low, high = columns(arrays)
    for k, name in enumerate(SIGNALS):
        assert low[:, k].min() == pytest.approx(samples.columns[name].min(), rel=1e-6)
        assert high[:, k].max() == pytest.approx(samples.columns[name].max(), rel=1e-6)


def test_a_moment_has_the_cut_the_flag_and_the_frequency_of_then(run: Path) -> None:
    shown = RecordedRun(run)
    asyncio.run(shown.read())
    header, arrays = look(shown, do='at', time=4.1)
    figures, cell = header['closeup'], header['cell']
    assert figures['depth'] == 0.00062
    assert figures['speed'] == pytest.approx(3000.0, rel=1e-6)
    assert cell['flag']['up'] is True
    assert 3.0 < cell['flag']['since'] < 4.1
    peak = np.argmax(arrays['spectrum'][1:]) + 1
    assert peak * figures['hertz'] == pytest.approx(cell['figures']['frequency'], rel=0.02)
    before, _ = look(shown, do='at', time=2.0)
    assert before['cell']['flag'] == {'up': False, 'since': None}
    assert before['cell']['state'] == 'stable'
    first, _ = look(shown, do='at', time=0.01)
    assert first['cell']['state'] in {None, 'unknown'}
    assert before['closeup']['depth'] == 0.0005


def test_the_list_of_what_happened_goes_to_the_end_of_the_record(run: Path) -> None:
    shown = RecordedRun(run)
    asyncio.run(shown.read())
    events = look(shown, do='at', time=4.1)[0]['page']['events']
    assert [time for time, _ in events] == sorted(time for time, _ in events)
    assert 'chatter flagged' in [text for _, text in events]
    assert events[-1] == [pytest.approx(12.0), 'the record ends']


def test_sessions_follow_each_other_and_what_is_missing_stays_open(tmp_path: Path) -> None:
    config = recorded_config({})
    with LatheRun(tmp_path / 'run', parameters_of(config.lathe())) as written:
        for _ in range(2):  # the second begins at time zero again
            lathe = config.lathe()
            for k in range(20):
                block = lathe.advance(500)
                if k != 10:
                    written.write(block)
    shown = RecordedRun(tmp_path / 'run')
    asyncio.run(shown.read())
    _, arrays = look(shown, do='view', plot='overview', **{'from': 0.0, 'to': 2.0})
    times = np.asarray(arrays['times'])
    assert times[-1] == pytest.approx(2.0, abs=0.01)
    steps = np.diff(times)
    assert np.count_nonzero(steps > 0.04) == 2
    _, arrays = look(shown, do='view', plot='part', **{'from': 1.2, 'to': 1.21})
    first = read_run(tmp_path / 'run').samples()
    restart = int(np.argmax(np.diff(first.columns['time']) < 0)) + 1
    time, place = first.columns['time'][restart:], first.columns[SIGNALS[0]][restart:]
    expected = place[(time >= 0.2 - 1e-9) & (time <= 0.21 + 1e-9)]
    np.testing.assert_allclose(columns(arrays)[0][:, 0], expected, atol=1e-12)


@pytest.mark.parametrize('step', [-2.0, 2.0])
def test_a_close_look_does_not_end_where_the_clock_was_set(step: float, tmp_path: Path) -> None:
    lathe, period = recorded_config({}).lathe(), 2_000_000
    with RunWriter(tmp_path / 'run') as written:
        written.add_topic(topic_of_type('/lathe/samples', SAMPLES_TYPE))
        for k in range(1200):
            stamp = 10**18 + k * period + (round(step * 1e9) if k >= 600 else 0)
            block = encode_block(lathe.advance(20))
            written.write('/lathe/samples', block, log_time=stamp, publish_time=stamp)
            if k % 50 == 49:
                written.commit()
    shown = RecordedRun(tmp_path / 'run')
    asyncio.run(shown.read())
    for begin, end in ((1.17, 1.2), (1.19, 1.21), (1.2, 1.23)):
        _, arrays = look(shown, do='view', plot='part', **{'from': begin, 'to': end})
        times = begin + np.asarray(arrays['times'])
        expected = read_run(tmp_path / 'run').samples(start=begin, end=end).columns['time']
        np.testing.assert_allclose(times, expected, atol=1e-9)


@pytest.mark.parametrize('cell', FLAGS)
def test_one_lathe_of_several_is_shown(cell: str, tmp_path: Path) -> None:
    folder = record_two_lathes(tmp_path)
    with pytest.raises(RunReadError, match='name one by its topic'):
        RecordedRun(folder)
    shown = RecordedRun(folder, f'/{cell}/lathe/samples')
    asyncio.run(shown.read())
    ((begin, _),) = look(shown, do='at', time=0.9)[0]['page']['flags']
    assert begin == pytest.approx(0.02 * (FLAGS[cell] + 1))


def test_the_first_picture_ends_where_the_run_does(run: Path) -> None:
    shown = RecordedRun(run)
    page = look(shown, do='at', time=4.1)[0]['page']
    assert page['run']['end'] == pytest.approx(12.0)
    size = sum(file.stat().st_size for file in run.glob('*.mcap')) / 1e6
    assert page['reading'] == f'Reading: 0 of {size:.0f} MB.'
    asyncio.run(shown.read())
    page = look(shown, do='at', time=4.1)[0]['page']
    assert page['run']['end'] == pytest.approx(12.0)
    assert page['reading'] == ''


def said_of(shown: RecordedRun, what: str) -> str:
    """What a viewer who has just come is told."""
    news = shown.frame(Viewer('another', trusted=False))[0]['page']
    return str(news['run']['state'] if what == 'state' else news[what])


def test_how_far_it_is_read_is_said_as_it_is(run: Path) -> None:
    shown = RecordedRun(run)
    size = sum(file.stat().st_size for file in run.glob('*.mcap')) / 1e6
    assert said_of(shown, 'state') == 'The first picture is of some places only.'
    assert said_of(shown, 'reading') == f'Reading: 0 of {size:.0f} MB.'
    shown._read_all()
    assert said_of(shown, 'state') == ''
    assert said_of(shown, 'reading') == f'What happened is sought in all {size:.0f} MB.'
    asyncio.run(shown.read())
    assert said_of(shown, 'reading') == ''
    with pytest.raises(LatheChatterError) as refused:
        asyncio.run(shown.act(Viewer('a test', trusted=True), {'do': 'knock'}))
    assert str(refused.value) == "A recorded run is only looked at: 'knock' cannot be."


def test_what_cannot_be_read_is_said(run: Path, tmp_path: Path) -> None:
    damaged = tmp_path / 'damaged'
    shutil.copytree(run, damaged)
    (file,) = damaged.glob('*.mcap')
    with file.open('r+b') as stream:
        summary = make_reader(stream).get_summary()
        assert summary is not None
        chunk = max(summary.chunk_indexes, key=lambda each: each.chunk_length)
        stream.seek(chunk.chunk_start_offset + 33)  # its CRC, as the format has it
        stream.write(b'CRC!')
    shown = RecordedRun(damaged)
    shown._read_all()
    assert said_of(shown, 'state') == f'Not all can be read: {file.name}: {NO_CRC}.'
    asyncio.run(shown.read())
    assert said_of(shown, 'state').startswith('What happened cannot be read: ')
    assert said_of(shown, 'reading') == ''


def test_what_is_no_run_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(RunReadError):
        RecordedRun(tmp_path)


@pytest.fixture(scope='module')
def served(run: Path) -> Iterator[str]:
    """The verb as a user starts it; it ends at Ctrl-C with nothing but what it said."""
    command = [sys.executable, '-u', '-m', 'lathe_chatter.cli', 'page', str(run)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    said = ''  # one line, or two where the terminal is narrow
    while 'http://' not in said and (line := process.stdout.readline()):
        said += line
    found = re.search(r'http://\S+', said)
    assert found, process.stderr.read() if process.stderr else ''
    yield found[0]
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, errors) == (0, '')


@pytest.mark.skipif(chromium() is None, reason='no Chromium is here')
@pytest.mark.parametrize('width', [390, 1280])
def test_a_browser_scrubs_through_the_run(served: str, tmp_path: Path, width: int) -> None:
    browser = Browser(tmp_path / 'profile')
    try:
        browser.open(served, width)
        browser.until('document.querySelectorAll("#log button").length >= 4', 'what happened')
        browser.until('document.querySelector("#overview canvas")', 'the whole')
        browser.run('document.querySelector("#at").focus()')
        browser.key('Home', 36)
        browser.until('parseFloat(document.querySelector("#clock").textContent) < 0.1', 'zero')
        browser.until('document.querySelector("#lamp-word").textContent !== "CHATTER"', 'no lamp')
        assert browser.run('trail.length') == 1  # the way as far as the moment that is shown
        browser.run('look(4.1, 0.1)')
        assert browser.run('trail.length') == 2
        browser.until('document.querySelector("#lamp-word").textContent === "CHATTER"', 'the lamp')
        browser.until('document.querySelector("#chart-text").textContent.includes("0.62")', 'it')
        for plot in ('displacement-0', 'velocity-0', 'tool-portrait', 'spectrum', 'chart'):
            browser.until(f'document.querySelector("#{plot} canvas")', plot)
        # The whole run is drawn, and its slider ends where its axis does.
        assert browser.run('plots.get("overview").scales.x.max') == pytest.approx(12.0, abs=0.1)
        ends = browser.run(
            '(u => [u.over, document.querySelector("#at")].flatMap(e => '
            '(r => [r.left, r.right])(e.getBoundingClientRect())))(plots.get("overview"))'
        )
        assert ends[2:] == pytest.approx(ends[:2], abs=9.0)  # half of its knob further
        begun = time.monotonic()
        browser.click('#log button')  # the change of depth
        browser.until('document.querySelector("#clock").textContent === "3.000 s"', 'that moment')
        assert time.monotonic() - begun < PATIENCE
        assert browser.run('document.documentElement.scrollWidth') <= width
        assert browser.complaints == []
    finally:
        browser.close()


@pytest.mark.skipif(chromium() is None, reason='no Chromium is here')
def test_what_is_not_read_yet_is_said_to_be_so(run: Path, tmp_path: Path) -> None:
    shown = RecordedRun(run)
    server = PageServer(shown, '127.0.0.1', 0)
    browser = Browser(tmp_path / 'profile')
    state = 'document.querySelector("#run-state").textContent'
    lamp = 'document.querySelector("#lamp-word").textContent'
    with closing(browser), serving(server) as loop:
        browser.open(server.url)
        browser.until(f'{state}.startsWith("Reading: 0 of ")', 'that it is read')
        browser.until('document.querySelector("#overview canvas")', 'the first picture')
        assert browser.run(lamp) == 'reading'
        assert browser.text('#clock') == ''
        assert browser.text('#at-text').startswith('about ')
        assert 'come when all is read' in browser.text('#chart-text')
        asyncio.run_coroutine_threadsafe(shown.read(), loop).result(PATIENCE)
        browser.until(f'["stable", "CHATTER"].includes({lamp})', 'the lamp')
        browser.until('document.querySelector("#clock").textContent === "12.000 s"', 'the end')
        browser.until('document.querySelector("#chart-text").textContent.includes("mm")', 'it')
        assert browser.run('run.at') == pytest.approx(12.0)
        assert browser.text('#at-text') == '12.00 s'
        assert browser.text('#run-state') == ''
        assert browser.complaints == []


def test_it_is_only_looked_at(served: str) -> None:
    host = served.split('/')[2]
    asked = http.client.HTTPConnection(host)
    asked.request('GET', '/', headers={'Host': 'elsewhere.example'})
    assert asked.getresponse().status == 403
