"""The layouts for viewers show what a recorded run has, by the names that it has there."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

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


def value_at(run: Run, topic: str, place: str) -> Any:
    """What stands at `data` or `data[k]` in the first message of a topic."""
    message = next(iter(run.messages(topic))).message
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
            shown.setdefault(topic, set()).add(shown_of(run, topic, place))
    assert shown == {**expected, '/chatter_monitor/state': {'data'}}

    def leaves(node: Any) -> Iterator[str]:
        if isinstance(node, str):
            yield node
        else:
            yield from (leaf for side in ('first', 'second') for leaf in leaves(node[side]))

    assert sorted(leaves(layout['layout'])) == sorted(layout['configById'])


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
