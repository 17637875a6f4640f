"""The README's two lines, small: a data set, and a forest that is tested on machines held out."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / 'examples' / 'datasets'


def test_a_forest_is_right_about_machines_that_it_has_never_seen(tmp_path: Path) -> None:
    pytest.importorskip('sklearn')
    pytest.importorskip('pyarrow')
    text = (EXAMPLE / 'chatter.yaml').read_text(encoding='utf-8')
    small = text.replace('machines: 150', 'machines: 60')
    assert small != text
    (tmp_path / 'small.yaml').write_text(small, encoding='utf-8')
    make = [sys.executable, '-m', 'lathe_chatter.cli', 'dataset', 'small.yaml', '--output', 'data']
    learn = [sys.executable, str(EXAMPLE / 'learn_chatter.py'), 'data']
    made = subprocess.run(make, cwd=tmp_path, check=True, capture_output=True, text=True)
    assert '3600 windows, ' in made.stdout
    done = subprocess.run(learn, cwd=tmp_path, check=True, capture_output=True, text=True)
    first, second = done.stdout.splitlines()
    assert first == '2520 windows to learn from, 1080 of other machines:'
    right, _, constant = second.partition('% right, where always the same answer would be ')
    assert float(right) >= 95.0
    assert float(constant.rstrip('%')) < 70.0


def test_the_forest_learns_from_whatever_signals_a_data_set_has(tmp_path: Path) -> None:
    """Those of the plan that the page on data sets shows, and a force that stands still."""
    pytest.importorskip('sklearn')
    pytest.importorskip('pyarrow')
    page = (EXAMPLE.parents[1] / 'docs' / 'how_to' / 'datasets.md').read_text(encoding='utf-8')
    (text,) = re.findall('```yaml\n(.*?)```', page, re.DOTALL)
    for old, new in (
        ('machines: 200', 'machines: 10'),
        ('columns: [', 'columns: [cutting_force, '),
        ('length: 0.1 s', 'length: 0.01 s'),
    ):
        assert old in text
        text = text.replace(old, new)
    (tmp_path / 'page.yaml').write_text(text, encoding='utf-8')
    make = [sys.executable, '-m', 'lathe_chatter.cli', 'dataset', 'page.yaml', '--output', 'data']
    learn = [sys.executable, '-W', 'error', str(EXAMPLE / 'learn_chatter.py'), 'data']
    subprocess.run(make, cwd=tmp_path, check=True, capture_output=True)
    done = subprocess.run(learn, cwd=tmp_path, check=True, capture_output=True, text=True)
    assert '% right, where always the same answer would be' in done.stdout
    learn[-1] = 'none'
    done = subprocess.run(learn, cwd=tmp_path, check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (1, 'none holds no windows of train.\n')


def test_without_scikit_learn_the_forest_says_in_a_sentence_what_it_needs() -> None:
    code = (
        'import runpy, sys; sys.modules["sklearn"] = None; sys.argv = ["learn", "data"]; '
        f'runpy.run_path({str(EXAMPLE / "learn_chatter.py")!r}, run_name="__main__")'
    )
    run = [sys.executable, '-c', code]
    done = subprocess.run(run, check=False, capture_output=True, text=True)
    assert done.returncode == 1
    said = 'The forest needs scikit-learn, which is not installed: pip install scikit-learn\n'
    assert done.stderr == said
