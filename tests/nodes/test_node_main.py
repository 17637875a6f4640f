"""Nodes as processes: what a wrong start says, and how a signal ends them."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from std_msgs.msg import Float64MultiArray, String
from support.node_bench import LATCHED, Bench
from support.node_processes import NODES

from lathe_chatter.nodes import entry_points
from lathe_chatter.nodes.parameter_tables import MONITOR as TABLE
from lathe_chatter.precompile import precompile

LATHE, MONITOR = 'lathe', 'chatter_monitor'
WRONG = {
    (LATHE, 'depth_of_cut:=nan'): (
        'depth_of_cut is nan m: it must be a finite number from 0 to 0.1 m.'
    ),
    (LATHE, 'depth_of_cut:=deep'): (
        "depth_of_cut is 'deep': it must be a finite number from 0 to 0.1 m, in m, mm, um, in."
    ),
    (LATHE, 'bearing_contact:=loose'): (
        "bearing_contact is 'loose': it must be one of none, gap, seated, both_sides."
    ),
    (LATHE, 'seed:=1.0'): 'seed is 1.0: it must be a whole number from 0 to 2147483647.',
    (LATHE, 'sample_rate:=1250'): (
        'sample_rate is 1250.0 Hz: it must be a whole multiple of tick_rate, which is 500 Hz.'
    ),
    (LATHE, 'use_sim_time:=yes please'): (
        "use_sim_time is 'yes please': it must be true or false."
    ),
    (LATHE, 'qos_overrides./lathe/samples.publisher.history:=keep_all'): (
        "qos_overrides./lathe/samples.publisher.history is 'keep_all': it must be keep_last, for "
        'a node does not wait for its readers.'
    ),
    (LATHE, 'depht:=0.001'): "There is no parameter 'depht': did you mean depth_of_cut?",
    (MONITOR, 'tool.mass:=-1'): f'tool.mass is -1 kg: it must be {TABLE["tool.mass"].allowed}.',
}


def start(node: str, *parameters: str, more: Sequence[str] = ()) -> subprocess.Popen[str]:
    words = [word for parameter in parameters for word in ('-p', parameter)]
    return subprocess.Popen(
        [*NODES, node, '--ros-args', *words, *more],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.usefixtures('domain')
def test_a_wrong_parameter_at_the_start_is_one_sentence_that_names_it() -> None:
    processes = {key: start(*key) for key in WRONG}  # all at once, for each takes a second
    for key, process in processes.items():
        out, err = process.communicate(timeout=60)
        said = [line for line in (out + err).splitlines() if '[ERROR]' not in line]
        assert said == [WRONG[key]]
        assert process.returncode == 2


def test_a_node_explains_itself_and_takes_no_word_that_it_does_not_know() -> None:
    command = [*NODES, LATHE]
    told = subprocess.run(
        [*command, '--help'], check=False, capture_output=True, text=True, timeout=60
    )
    assert told.returncode == 0
    assert 'depth_of_cut: depth of cut w; a finite number from 0 to 0.1 m (default: 0.0005)' in (
        told.stdout
    )
    wrong = subprocess.run(
        [*command, '--bogus', '--ros-args', '-p', 'seed:=1'],
        check=False, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert wrong.returncode == 2
    assert wrong.stderr.startswith("There is no argument '--bogus'")
    assert len(wrong.stderr.splitlines()) == 1


@pytest.fixture
def processes() -> Iterator[list[subprocess.Popen[str]]]:
    started: list[subprocess.Popen[str]] = []
    yield started
    for process in started:
        process.kill()
        process.communicate()


def test_a_signal_ends_every_node_with_exit_0(
    bench: Bench, processes: list[subprocess.Popen[str]]
) -> None:
    precompile()  # or else each process compiles for itself
    heard = []
    for cell in ('/interrupted', '/terminated'):
        # A whole number where a double belongs is taken as one.
        space = ('-r', f'__ns:={cell}')
        processes += [
            start(LATHE, 'spindle_speed_rpm:=6000', more=space),
            start(MONITOR, more=space),
        ]
        heard += [
            bench.listen_first(Float64MultiArray, f'{cell}/lathe/samples', LATCHED),
            bench.listen_first(String, f'{cell}/chatter_monitor/state', LATCHED),
        ]
    bench.spin_until(lambda: all(heard), 'a word of all')
    signals = [signal.SIGINT] * 2 + [signal.SIGTERM] * 2
    for process, number in zip(processes, signals, strict=True):
        process.send_signal(number)
    for process in processes:
        _, err = process.communicate(timeout=60)
        assert process.returncode == 0
        assert 'Traceback' not in err


def test_a_node_is_started_by_its_entry_point_alone() -> None:
    """Started as a module it would not hear a signal while it imports others."""
    files = sorted(Path(entry_points.__file__).parent.glob('*.py'))
    assert len(files) > 30
    assert [file.stem for file in files if '__main__' in file.read_text()] == ['entry_points']


def hears(process: subprocess.Popen[str]) -> bool:
    """Whether a process has a handler of SIGTERM, which Python alone has not."""
    caught = Path(f'/proc/{process.pid}/status').read_text().partition('SigCgt:')[2].split()[0]
    return bool(int(caught, 16) >> signal.SIGTERM - 1 & 1)


@pytest.mark.usefixtures('domain')
@pytest.mark.skipif(sys.platform != 'linux', reason='/proc tells which signals are heard')
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    'node', ['lathe', 'chatter_monitor', 'run_recorder', 'chatter_supervisor', 'cell']
)
def test_a_signal_while_it_starts_ends_a_node_without_a_word(
    node: str,
    number: signal.Signals,
    tmp_path: Path,
    processes: list[subprocess.Popen[str]],
) -> None:
    """At three instants of the first second, most of which goes into imports."""
    precompile()
    for _ in range(3):
        process = subprocess.Popen(
            [*NODES, node],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        processes.append(process)
        while not hears(process):
            assert process.poll() is None, process.communicate()
            time.sleep(0.001)
        time.sleep(random.random())
        process.send_signal(number)
        _, err = process.communicate(timeout=60)
        assert process.returncode == 0, err
        assert 'Traceback' not in err
        assert 'KeyboardInterrupt' not in err
