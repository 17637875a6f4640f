"""`lathe-chatter simulate` and `report` as a user calls them."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from lathe_chatter.cli import main as cli
from lathe_chatter.knocks import resting_state
from lathe_chatter.model import Cut, Machine
from lathe_chatter.recording import read_run


def test_a_knocked_cut_is_simulated_and_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """At 0.65 mm and 10 um the cut comes to rest, and the knock leaves 41.9 um of chatter."""
    run = tmp_path / 'run'
    call = [
        'simulate', '--output', str(run), '--depth-of-cut', '0.00065',
        '--bearing-clearance', '1e-5', '--duration', '9', '--knock', '6:0.002', '--json',
    ]  # fmt: skip
    assert cli.main(call) == 0
    simulated = json.loads(capsys.readouterr().out)
    assert simulated['samples'] == 90_000
    assert cli.main(['report', str(run), '--json']) == 0
    figures = json.loads(capsys.readouterr().out)
    assert [entry['what'] for entry in figures['occurrences']][1] == 'knock, 2 mN s'
    before, moment = figures['moments']
    assert before['tool_peak_to_peak'] < 0.1 * moment['tool_peak_to_peak']
    assert moment['tool_peak_to_peak'] == pytest.approx(41.9e-6, abs=0.1e-6)
    assert 0.0 < moment['on_bearing'] < 1.0
    assert 120.0 < moment['frequency'] < 140.0
    rest = resting_state(Machine(), Cut(3000.0, 0.65e-3, 1e-5))
    assert rest[2] < 1e-5
    assert (run / 'report.png').read_bytes().startswith(b'\x89PNG')
    assert ET.parse(run / 'report.svg').getroot().tag.endswith('svg')


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='a device of Linux')
def test_a_full_disk_names_the_file_that_it_refuses(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / 'run'
    assert cli.main(['simulate', '--output', str(run), '--duration', '0.5']) == 0
    capsys.readouterr()
    (run / 'report.png').symlink_to('/dev/full')
    assert cli.main(['report', str(run / 'run_0.mcap')]) == 2
    said = capsys.readouterr().err.strip()
    assert (
        said
        == f'lathe-chatter report: {run}/report.png cannot be written: No space left on device.'
    )


def test_an_interrupted_simulation_says_where_its_run_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(*_values: object, **_options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr('lathe_chatter.cli.console.Bar.show', interrupt)
    run = tmp_path / 'run'
    assert cli.main(['simulate', '--output', str(run), '--duration', '2']) == 130
    assert f'Interrupted: the run up to there is in {run}.' in capsys.readouterr().out
    assert 0 < read_run(run).samples().columns['time'].size < 20_000


def test_a_scenario_whose_expectation_fails_is_exit_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = tmp_path / 'quiet.yaml'
    scenario.write_text('duration: 0.5\nexpect: {flagged: true}\n')
    call = ['simulate', '--scenario', str(scenario), '--output', str(tmp_path / 'run')]
    assert cli.main(call) == 1
    assert 'times real time' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['--duration', '0'], '--duration is 0.0 s'),
        (['--knock', '3'], "--knock is '3'"),
        (['--knock=-1:0.1'], '--knock is -1.0 s'),
        (['--knock', '5:0.1', '--duration', '1'], '--knock is 5.0 s: it must be a finite number'),
        (['--depth-of-cut', '1'], 'depth_of_cut is 1 m'),
        (['--scenario', 'nothing'], 'There is no scenario'),
        (['--bearing-contact', 'gap', '--seed', '1.5'], 'seed is 1.5'),
    ],
)
def test_a_mistake_is_one_sentence(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(['simulate', '--output', str(tmp_path / 'run'), *arguments]) == 2
    told = capsys.readouterr().err
    assert words in told
    assert told.count('\n') == 1
    assert not (tmp_path / 'run').exists()


def test_a_run_is_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call = ['simulate', '--duration', '0.1', '--output', str(tmp_path / 'run')]
    assert cli.main(call) == 0
    assert cli.main(call) == 2
    assert 'exists already' in capsys.readouterr().err
