"""What a verb does not want it does not load: half a second, of a second or two."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from support.loaded_modules import COMPUTING, loaded_by

import lathe_chatter as lc


@pytest.fixture(scope='module')
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('runs') / 'run'
    lc.simulate(replace(lc.load_scenario('no_clearance'), duration=0.2), folder)
    return folder


@pytest.mark.parametrize('words', ['verify RUN', 'export RUN', 'recover RUN', 'run --help'])
def test_a_verb_that_computes_nothing_loads_nothing_that_computes(words: str, run: Path) -> None:
    loaded = loaded_by('-m', 'lathe_chatter.cli', *words.replace('RUN', str(run)).split())
    assert 'lathe_chatter.recording.run' in loaded
    assert not loaded & COMPUTING
