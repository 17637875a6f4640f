"""The layouts for viewers show what a recorded run has, by the names that it has there."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from support.browser import Browser, chromium

from lathe_chatter.cli import main as cli
from lathe_chatter.recording import Run, read_run
from lathe_chatter.samples import SAMPLE_COLUMNS

LAYOUTS = Path(__file__).resolve().parents[1] / 'config' / 'layouts'
SHOWN = {
    '/lathe/samples': {
        f'{part}_{kind}' for part in ('tool', 'workpiece') for kind in ('displacement', 'velocity')
    },
    '/chatter_monitor/growth_rate': {'data'},
    '/chatter_monitor/chatter': {'data'},
}


@pytest.fixture(scope='module')
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp('runs') / 'run'
    call = ['simulate', '--output', str(folder), '--duration', '2', '--depth-of-cut', '0.001']
    assert cli.main([*call, '--monitor']) == 0
    return read_run(folder)


@pytest.fixture(scope='module')
def unrolled(run: Run) -> Run:
    assert cli.main(['export', str(run.path), '--unrolled', '--end', '1.5']) == 0
    return read_run(f'{run.path}-unrolled')


UNROLLED = {
    **{f'/lathe/samples/{column}': {'data'} for column in SHOWN['/lathe/samples']},
    **{topic: places for topic, places in SHOWN.items() if topic != '/lathe/samples'},
}


@pytest.fixture(params=['', '_unrolled'])
def shape(request: pytest.FixtureRequest) -> tuple[Run, str, dict[str, set[str]]]:
    """A run, the ending of the name of its layouts, and what these show."""
    ending = request.param
    run: Run = request.getfixturevalue('unrolled' if ending else 'run')
    return run, ending, UNROLLED if ending else SHOWN


@cache
def first_message(run: Path, topic: str) -> Any:
    """Of a topic: to read what is unrolled takes a second, and many curves are of few topics."""
    return next(iter(read_run(run).messages(topic))).message


def value_at(run: Run, topic: str, place: str) -> Any:
    """What stands at `data` or `data[k]` in the first message of a topic."""
    message = first_message(run.path, topic)
    found = re.fullmatch(r'data(?:\[(\d+)\])?', place)
    assert found, place
    return message.data if found[1] is None else message.data[int(found[1])]


def shown_of(run: Run, topic: str, place: str) -> str:
    """The name of what is shown, once it is known to be in the run."""
    assert topic in run.topics, topic
    value = value_at(run, topic, place)
    assert isinstance(value, str) or np.isfinite(float(value))
    number = re.fullmatch(r'data\[(\d+)\]', place)
    return SAMPLE_COLUMNS[int(number[1])] if number else place


SCRIPT = '/studio_script/portraits'
POINT = re.compile(r'(tool|workpiece)\[:\]\.(displacement|velocity)')


def foxglove_paths(panel: dict[str, Any]) -> Iterator[str]:
    yield from (path['value'] for path in panel['paths'] if path.get('enabled', True))
    if 'xAxisPath' in panel:
        yield panel['xAxisPath']['value']


def test_the_foxglove_layout_shows_what_a_run_has(
    shape: tuple[Run, str, dict[str, set[str]]],
) -> None:
    run, ending, expected = shape
    layout = json.loads((LAYOUTS / f'foxglove{ending}.json').read_text())
    shown: dict[str, set[str]] = {}
    for panel in layout['configById'].values():
        for path in foxglove_paths(panel):
            topic, _, place = path.partition('.')
            if topic == SCRIPT and (point := POINT.fullmatch(place)):  # the batches of a topic
                topic, named = '/lathe/samples', '_'.join(point.groups())
            else:
                named = shown_of(run, topic, place)
            shown.setdefault(topic, set()).add(named)
    assert shown == {**expected, '/chatter_monitor/state': {'data'}}

    def leaves(node: Any) -> Iterator[str]:
        if isinstance(node, str):
            yield node
        else:
            yield from (leaf for side in ('first', 'second') for leaf in leaves(node[side]))

    assert sorted(leaves(layout['layout'])) == sorted(layout['configById'])


def test_the_script_of_the_live_layout_makes_portraits_of_batches(
    run: Run, tmp_path: Path
) -> None:
    if chromium() is None:
        pytest.skip('no Chromium is here')
    layout = json.loads((LAYOUTS / 'foxglove.json').read_text())
    (script,) = layout['userNodes'].values()
    assert script['name'] == SCRIPT
    plain = script['sourceCode']
    # The types of TypeScript, which a browser does not know.
    for kind in (r'^import .*$', r'^type .*$', r'\bexport (default )?', r': number\[\](\[\])?',
                 r': Input<.*?>', r': Portraits \| undefined', r': string'):  # fmt: skip
        plain = re.sub(kind, '', plain, flags=re.MULTILINE)
    messages = [each.message for each in islice(run.messages('/lathe/samples'), 100)]
    events = [
        {'message': {'layout': {'dim': [{'label': dim.label} for dim in message.layout.dim]},
                     'data': [float(value) for value in message.data]}}
        for message in messages
    ]  # fmt: skip
    browser = Browser(tmp_path / 'profile')
    try:
        made = browser.run(
            f'(() => {{ {plain}; return {json.dumps(events)}.map(script).filter(Boolean); }})()'
        )
    finally:
        browser.close()
    assert len(made) == len(events) // 25
    samples = np.vstack([np.reshape(message.data, (-1, 8)) for message in messages])
    newest = samples[: len(made) * 25 * len(samples) // len(events)][-1000:]
    for k, body in ((2, 'tool'), (4, 'workpiece')):
        found = np.array([[p['displacement'], p['velocity']] for p in made[-1][body]])
        np.testing.assert_allclose(found, newest[:, k : k + 2] * (1e6, 1e3), rtol=1e-12)


def test_the_plotjuggler_layout_shows_what_a_run_has(
    shape: tuple[Run, str, dict[str, set[str]]],
) -> None:
    run, ending, expected = shape
    root = ET.parse(LAYOUTS / f'plotjuggler{ending}.xml').getroot()
    shown: dict[str, set[str]] = {}
    for plot in root.iter('plot'):
        for curve in plot.iter('curve'):
            portrait = plot.get('mode') == 'XYPlot'
            for key in ('curve_x', 'curve_y') if portrait else ('name',):
                topic, _, place = str(curve.get(key)).rpartition('/')
                shown.setdefault(topic, set()).add(shown_of(run, topic, place))
    assert shown == expected
    assert len([plot for plot in root.iter('plot') if plot.get('mode') == 'XYPlot']) == 2
