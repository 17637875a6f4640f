"""The main job, end to end: real processes over real DDS, and the record that they leave."""

from __future__ import annotations

import http.client
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not there')
pytest.importorskip('domain_coordinator', reason='domain_coordinator is not there')
from support.domains import own_domain

from lathe_chatter.cli.main import main
from lathe_chatter.recording import read_run

PACE = 2.0
"""Simulated seconds a second: the test need not take as long as the cut."""
SHORT = f"""
name: short
duration: 3.0
parameters: {{real_time_factor: {PACE}, depth_of_cut: 0.0005}}
steps:
  - at: 0.5
    set: {{depth_of_cut: 0.00062}}
"""


@pytest.fixture
def environment() -> Any:
    with own_domain() as domain:
        yield {
            **os.environ,
            'ROS_DOMAIN_ID': str(domain),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        }


def command(*arguments: str) -> list[str]:
    return [sys.executable, '-m', 'lathe_chatter.cli', 'run', *arguments]


def at_pace(name: str, folder: Path) -> Path:
    """A shipped scenario, played faster."""
    shipped = Path(__file__).resolve().parents[2] / 'config' / 'scenarios' / f'{name}.yaml'
    text = shipped.read_text()
    assert 'parameters:' in text
    lines = [
        f'{line}\n  real_time_factor: {PACE}' if line.startswith('parameters:') else line
        for line in text.splitlines()
    ]
    copy = folder / f'{name}.yaml'
    copy.write_text('\n'.join(lines))
    return copy


def called(
    scenario: Path, output: Path, environment: dict[str, str], *more: str
) -> subprocess.CompletedProcess[str]:
    words = command('--scenario', str(scenario), '--output', str(output), *more)
    return subprocess.run(
        words, env=environment, capture_output=True, text=True, check=False, timeout=120
    )


def play(scenario: Path, output: Path, environment: dict[str, str]) -> dict[str, Any]:
    done = called(scenario, output, environment, '--json')
    assert done.returncode == 0, done.stdout + done.stderr
    figures: dict[str, Any] = json.loads(done.stdout)
    return {**figures, 'said': done.stderr}


def test_the_clearance_makes_it_chatter_and_the_recommended_speed_cures_it(
    tmp_path: Path, environment: dict[str, str]
) -> None:
    figures = play(at_pace('clearance', tmp_path), tmp_path / 'run', environment)
    happened = [entry['what'] for entry in figures['occurrences']]
    assert happened[0].startswith('start: 3000 rev/min, depth 0.5 mm, clearance 5 µm')
    assert happened[1:3] == ['depth 0.62 mm', 'chatter flagged']
    assert happened[3].startswith('advice: ')
    others = [what for what in happened if not what.startswith('advice: ')]
    assert others[3].endswith(' rev/min')
    assert others[4:] == ['flag cleared', 'end']
    flagged, cured = figures['occurrences'][2], figures['occurrences'][-1]
    # The open machine alone would be stable at this cut, the seated one is not.
    assert flagged['roots']['open']['growth_rate'] < 0 < flagged['roots']['seated']['growth_rate']
    # Partly seated, it chatters between the frequencies of the two.
    bounds = [flagged['roots'][regime]['frequency'] for regime in ('open', 'seated')]
    assert bounds[0] - 2.0 < flagged['frequency'] < bounds[1] + 2.0
    assert flagged['growth_rate'] > 0
    # What was told while it ran is of this flag too, and not of the cut before.
    told = re.search(r'chatter flagged: (\S+) Hz', figures['said'])
    assert told is not None
    assert float(told[1]) == pytest.approx(flagged['frequency'], abs=5.0)
    assert max(root['growth_rate'] for root in cured['roots'].values()) < 0
    assert Path(figures['picture']).stat().st_size > 20_000


@pytest.mark.parametrize('name', ['supervised', 'asked'])
def test_a_supervisor_cures_it_by_itself_or_as_it_is_accepted(
    name: str, tmp_path: Path, environment: dict[str, str]
) -> None:
    figures = play(at_pace(name, tmp_path), tmp_path / 'run', environment)
    assert 'supervisor: Chatter at' in figures['said']
    assert 'supervisor: The chatter has ended' in figures['said']
    end = figures['occurrences'][-1]
    assert max(root['growth_rate'] for root in end['roots'].values()) < 0
    run = read_run(tmp_path / 'run')
    sentences = [each.message.data for each in run.messages('/chatter_supervisor/action')]
    assert any('I set' in sentence for sentence in sentences)
    assert any('as was accepted' in sentence for sentence in sentences) is (name == 'asked')


def test_without_clearance_nothing_is_flagged(tmp_path: Path, environment: dict[str, str]) -> None:
    figures = play(at_pace('no_clearance', tmp_path), tmp_path / 'run', environment)
    happened = [entry['what'] for entry in figures['occurrences']]
    assert happened[1:] == ['depth 0.62 mm', 'end']


def test_monitor_and_report_know_the_machine_and_the_cut_of_the_scenario(
    tmp_path: Path, environment: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    """The advice is that of a monitor without ROS, which has the machine of the lathe."""
    scenario = tmp_path / 'heavier.yaml'
    machine = 'tool.mass: 0.1, workpiece.mass: 0.12, workpiece.damping_ratio: 0.03'
    cut = 'spindle_speed_rpm: 3100, depth_of_cut: 0.0004'
    start = f'{{real_time_factor: 2.0, {cut}, {machine}}}'
    scenario.write_text(
        f'name: heavier\nduration: 4.0\nparameters: {start}\n'
        'steps: [{at: 1.0, set: {depth_of_cut: 0.0018}}]\nexpect: {flagged: true}\n'
    )
    call = ['simulate', '--scenario', str(scenario), '--output', str(tmp_path / 'simulated')]
    assert main([*call, '--monitor', '--report', '--json']) == 0
    told = capsys.readouterr()
    assert 'try ' in told.err
    simulated = advised(json.loads(told.out))
    figures = play(scenario, tmp_path / 'run', environment)
    assert figures['occurrences'][0]['what'].startswith('start: 3100 rev/min, depth 0.4 mm')
    assert advised(figures) == pytest.approx(simulated, rel=0.03)


def advised(figures: dict[str, Any]) -> float:
    """The last speed that a report says was recommended, rev/min."""
    words = [entry['what'] for entry in figures['occurrences']]
    return float([word for word in words if word.startswith('advice: ')][-1].split()[1])


def played_until_changed(
    folder: Path, environment: dict[str, str], act: Callable[[int], None]
) -> tuple[int, str]:
    """Exit code and words of a run to which something is done once its depth has changed."""
    scenario = folder / 'short.yaml'
    scenario.write_text(SHORT.replace('duration: 3.0', 'duration: 30.0'))
    with subprocess.Popen(
        command('--scenario', str(scenario), '--output', str(folder / 'run')),
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        assert process.stdout is not None
        seen = []
        told = False
        for line in process.stdout:
            seen.append(line)
            # Once: interrupted while it prints, the console may print that line again.
            if 'depth_of_cut = 0.00062' in line and not told:
                act(process.pid)
                told = True
        return process.wait(60), ''.join(seen)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_is_complete_up_to_then(
    number: signal.Signals, tmp_path: Path, environment: dict[str, str]
) -> None:
    code, said = played_until_changed(tmp_path, environment, lambda run: os.kill(run, number))
    output = tmp_path / 'run'
    assert code == 128 + number, said
    assert 'recorded up to that moment' in said
    assert main(['verify', str(output)]) == 0
    assert (output / 'metadata.yaml').is_file()


def test_interrupted_before_the_first_sample_it_says_so(
    tmp_path: Path, environment: dict[str, str]
) -> None:
    scenario = tmp_path / 'short.yaml'
    # A lathe that waits for readers that never come: only an interrupt ends this run early.
    parameters = f'{{real_time_factor: {PACE}, await_readers: 1000'
    scenario.write_text(SHORT.replace(f'{{real_time_factor: {PACE}', parameters))
    output = tmp_path / 'run'
    with subprocess.Popen(
        command('--scenario', str(scenario), '--output', str(output)),
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        end = time.monotonic() + 60.0
        while not output.exists() and time.monotonic() < end:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert 'Interrupted while the nodes were still starting: nothing was recorded.' in said
    assert 'Traceback' not in said
    assert not output.exists()


def test_a_refused_step_ends_the_run_with_the_reason(
    tmp_path: Path, environment: dict[str, str]
) -> None:
    scenario = tmp_path / 'wrong.yaml'
    scenario.write_text(SHORT.replace('depth_of_cut: 0.00062', 'depth_of_cut: 0.5'))
    began = time.monotonic()
    done = called(scenario, tmp_path / 'run', environment)
    assert done.returncode == 2, f'{done.stdout}{done.stderr} {time.monotonic() - began}'
    assert 'depth_of_cut' in done.stderr
    assert '0.1 m' in done.stderr
    assert 'Traceback' not in done.stdout + done.stderr


def test_a_lathe_that_is_killed_ends_the_run_with_a_report(
    tmp_path: Path, environment: dict[str, str]
) -> None:
    code, said = played_until_changed(tmp_path, environment, kill_the_lathe_of)
    output = tmp_path / 'run'
    assert code == 1, said
    assert 'lathe was ended by the signal SIGKILL.' in said
    assert 'reported up to then' in said
    assert (output / 'report.png').is_file()
    assert main(['verify', str(output)]) == 0


def kill_the_lathe_of(run: int) -> None:
    """Kill the lathe among the children of a run."""
    for child in Path(f'/proc/{run}/task/{run}/children').read_text().split():
        if b'entry_points\0lathe\0' in Path(f'/proc/{child}/cmdline').read_bytes():
            os.kill(int(child), signal.SIGKILL)


def test_a_misspelt_parameter_is_refused_before_anything_starts(
    tmp_path: Path, environment: dict[str, str]
) -> None:
    scenario = tmp_path / 'wrong.yaml'
    scenario.write_text(SHORT.replace('depth_of_cut: 0.00062', 'depth_of_cuts: 0.0006'))
    done = called(scenario, tmp_path / 'run', environment)
    assert done.returncode == 2
    assert (
        "'depth_of_cuts' cannot change while the lathe cuts: did you mean depth_of_cut?"
        in done.stderr
    )
    assert not (tmp_path / 'run').exists()


def test_a_lathe_that_is_there_already_is_left_alone(
    tmp_path: Path, environment: dict[str, str]
) -> None:
    """Its names would be taken for the run's own: the run is refused, and nothing is changed."""
    scenario = tmp_path / 'short.yaml'
    scenario.write_text(SHORT)
    node = [sys.executable, '-m', 'lathe_chatter.nodes.entry_points', 'lathe']
    node += ['--ros-args', '-p', 'await_readers:=1']
    with subprocess.Popen(node, env=environment, stderr=subprocess.PIPE, text=True) as foreign:
        assert foreign.stderr is not None
        while 'Waiting for' not in (line := foreign.stderr.readline()):
            assert line, 'the lathe ended'
        done = called(scenario, tmp_path / 'run', environment)
        foreign.send_signal(signal.SIGINT)
        said = foreign.stderr.read()
    assert done.returncode == 2, done.stdout + done.stderr
    assert 'Another lathe is in this ROS domain: end it' in done.stderr
    assert 'depth_of_cut' not in said


def test_two_runs_at_once_get_along_even_with_sigint_ignored(
    tmp_path: Path, environment: dict[str, str]
) -> None:
    """Each takes a ROS domain of its own; nodes that cannot hear SIGINT are ended all the same."""
    del environment['ROS_DOMAIN_ID']
    scenario = tmp_path / 'short.yaml'
    scenario.write_text(SHORT.replace('duration: 3.0', 'duration: 1.0'))
    runs = [
        subprocess.Popen(
            [
                *('sh', '-c', 'trap "" INT; exec "$@"', 'sh'),
                *command('--scenario', str(scenario), '--output', str(tmp_path / f'run {number}')),
            ],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        for number in range(2)
    ]
    said = [run.communicate(timeout=240)[0] for run in runs]
    assert [run.returncode for run in runs] == [0, 0], said
    assert any('this one takes' in each for each in said), said
    for number in range(2):
        assert (tmp_path / f'run {number}' / 'metadata.yaml').is_file()


def test_with_the_page_it_runs_until_it_is_told_to_end(environment: Any, tmp_path: Path) -> None:
    output = tmp_path / 'run'
    process = subprocess.Popen(
        [*command('--page', '--output', str(output))],
        env={**environment, 'PYTHONUNBUFFERED': '1', 'DISPLAY': '', 'WAYLAND_DISPLAY': ''},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    url = ''
    while not url:
        line = process.stdout.readline()
        assert line, process.stderr.read() if process.stderr else ''
        if found := re.search(r'The page is at (http://\S+) until Ctrl-C\.\n', line):
            url = found[1]
    asked = http.client.HTTPConnection(url.split('/')[2])
    asked.request('GET', '/')
    assert b'<title>Lathe</title>' in asked.getresponse().read()
    time.sleep(3.0)
    for service in ('stop', 'start'):
        call = ['service', 'call', f'/run_recorder/{service}', 'std_srvs/srv/Trigger']
        subprocess.run(
            [sys.executable, '-m', 'support.ros2_commands', *call],
            env={**environment, 'PYTHONPATH': str(Path(__file__).parents[1])}, check=True,
            timeout=60,
        )  # fmt: skip
    process.send_signal(signal.SIGINT)
    said, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    assert f'Recorded anew meanwhile, and not in this report: {output}-2' in said
    assert 'Ended: the run is finished' in said
    assert main(['verify', str(output)]) == 0
