"""`import lathe_chatter as lc`: what it gives, and that it costs nothing until it is used."""

from __future__ import annotations

import ast
import inspect
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from support.loaded_modules import loaded_by

import lathe_chatter as lc
from lathe_chatter.html_table import html_table
from lathe_chatter.samples import SAMPLE_COLUMNS


def test_the_import_loads_nothing_but_itself() -> None:
    """Less than 50 ms by far, whatever else the machine does."""
    more = loaded_by('-c', 'import lathe_chatter') - loaded_by('-c', 'import importlib, typing')
    assert more == {'lathe_chatter'}


@pytest.mark.parametrize('name', lc.__all__)
def test_every_name_is_there(name: str) -> None:
    assert name in dir(lc)
    assert getattr(lc, name) is getattr(lc, name)


def test_dir_shows_the_names_of_the_table_and_no_tools() -> None:
    call = 'import lathe_chatter as lc; lc.Cut; print(*dir(lc), sep="\\n")'
    told = subprocess.run([sys.executable, '-c', call], check=True, capture_output=True, text=True)
    shown = {name for name in told.stdout.split() if not name.startswith('__')}
    assert shown | {'__version__'} == set(lc.__all__)


def test_a_name_that_is_not_there_is_named() -> None:
    with pytest.raises(AttributeError, match="no attribute 'Lathe'"):
        _ = lc.Lathe


def test_the_names_for_type_checkers_are_those_of_the_table() -> None:
    assert {*lc._HOME, '__version__'} == set(lc.__all__)
    assert lc.__file__ is not None
    source = ast.parse(Path(lc.__file__).read_text(encoding='utf-8'))
    (block,) = (node for node in source.body if isinstance(node, ast.If))
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    assert sorted(each.name for node in imports for each in node.names) == sorted(lc._HOME)


@pytest.mark.parametrize('name', sorted(set(lc.__all__) - {'__version__', 'Run'}))
def test_a_path_may_be_a_text_everywhere(name: str) -> None:
    called = getattr(lc, name)
    if not callable(called):
        return
    try:
        taken = inspect.signature(called).parameters.values()
    except ValueError:  # an Enum
        return
    for parameter in taken:
        kind = str(parameter.annotation)
        assert 'Path' not in kind or 'str' in kind, f'{name}({parameter})'


def test_a_run_is_made_and_proven_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    scenario = replace(lc.load_scenario('no_clearance'), duration=0.2)
    assert lc.simulate(scenario, 'run').samples == 2_000
    assert [done.compared for done in lc.resimulate('run')] == [2_000]
    lc.recover('run', 'saved')
    assert lc.verify('saved').messages['/lathe/samples'] == 20
    with lc.RunWriter('mine') as writer:
        assert writer.folder == Path('mine')
    lc.growth_map(lc.Machine(), lc.Cut(), [3000.0], [5e-4], kept_in='kept.jsonl')
    assert Path('kept.jsonl').stat().st_size > 0


def test_values_show_themselves_in_a_notebook() -> None:
    machine = lc.Machine(lc.Mode(2.0, 1900.0, 0.03))._repr_html_()
    assert (
        '<td style="text-align:left">tool.mass</td><td style="text-align:right">2</td>' in machine
    )
    assert 'N/m2' in machine
    assert 'bearing_contact' in lc.Cut()._repr_html_()
    estimate = lc.ChatterDetector().update(lc.VirtualLathe().advance(500), SAMPLE_COLUMNS)
    assert 'nan' not in estimate._repr_html_()
    assert '&lt;' in html_table('<', [])


def test_lobes_are_plotted_into_the_axes_given() -> None:
    axes = Figure().subplots()
    assert lc.plot_lobes(axes=axes) is axes
    assert [line.get_label() for line in axes.lines][:2] == [
        'limit, open',
        'limit, on its bearing',
    ]
    assert axes.get_ylim()[1] > 0.5
