"""Every example and notebook runs, and draws."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib import image
from support.page_blocks import ROOT

SCRIPTS = sorted((ROOT / 'examples').glob('plot_*.py'))
NOTEBOOKS = sorted((ROOT / 'docs' / 'notebooks').glob('*.ipynb'))


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The figures that are drawn, on no screen."""
    plt.switch_backend('agg')
    monkeypatch.setattr(plt, 'show', lambda: None)
    plt.close('all')
    yield plt.get_fignums
    plt.close('all')


@pytest.mark.parametrize('script', SCRIPTS, ids=lambda script: script.stem)
def test_an_example_runs_and_leaves_its_picture_where_there_is_no_screen(
    script: Path,
    figures: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    lines = script.read_text(encoding='utf-8').splitlines()
    assert 20 <= len(lines) <= 60
    exec(compile('\n'.join(lines), str(script), 'exec'), {'__name__': '__main__'})  # noqa: S102 -- ours
    assert figures()
    picture = tmp_path / f'{script.stem.removeprefix("plot_")}.png'
    assert image.imread(picture).std() > 0.05
    assert f'the picture is in {picture}\n' in capsys.readouterr().out


def run_notebook(notebook: Path) -> None:
    """Run its cells, in its folder."""
    names: dict[str, Any] = {'__name__': '__main__'}
    for cell in json.loads(notebook.read_text(encoding='utf-8'))['cells']:
        if cell['cell_type'] == 'code':
            assert not cell['outputs'], 'outputs belong to the site, which makes them'
            exec(compile(''.join(cell['source']), notebook.name, 'exec'), names)  # noqa: S102


@pytest.mark.parametrize('notebook', NOTEBOOKS, ids=lambda notebook: notebook.stem)
def test_a_notebook_runs_and_draws(
    notebook: Path,
    figures: Any,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(notebook.parent)
    run_notebook(notebook)
    assert figures()
    if check := globals().get(f'check_{notebook.stem}'):
        check(capsys.readouterr().out)


def check_many_cuts(printed: str) -> None:
    """The chart is right, and so is what is said of it."""
    assert printed == '40 of 40 as the chart has them\n'


def check_regeneration(printed: str) -> None:
    """Turns lie apart, each with larger waves than the one below, as far on as is said."""
    axes = plt.gcf().axes[0]
    turns = [line.get_ydata() for line in axes.lines if len(line.get_ydata()) == 200]
    assert len(turns) == 5
    said = re.search(r'([\d.]+) waves to a turn: .* ([\d.]+) of a wave further on', printed)
    assert said is not None
    waves, further = map(float, said.groups())
    angle = np.arange(200) / 200
    before = None
    for turn in map(np.asarray, turns):
        phase = np.angle(np.sum((turn - turn.mean()) * np.exp(-2j * np.pi * waves * angle)))
        if before is not None:
            assert turn.min() > before[0].max()
            assert 1.1 < np.ptp(turn) / np.ptp(before[0]) < 1.5
            assert abs((before[1] - phase) / (2 * np.pi) % 1.0 - further) < 0.1
        before = turn, phase
