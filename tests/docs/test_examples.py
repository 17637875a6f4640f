"""Every example and notebook runs, and draws."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
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


@pytest.mark.parametrize('notebook', NOTEBOOKS, ids=lambda notebook: notebook.stem)
def test_a_notebook_runs_and_draws(
    notebook: Path, figures: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(notebook.parent)
    names: dict[str, Any] = {'__name__': '__main__'}
    for cell in json.loads(notebook.read_text(encoding='utf-8'))['cells']:
        if cell['cell_type'] == 'code':
            assert not cell['outputs'], 'outputs belong to the site, which makes them'
            exec(compile(''.join(cell['source']), notebook.name, 'exec'), names)  # noqa: S102
    assert figures()
