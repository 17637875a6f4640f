"""What a killed process leaves half-made in shared memory: on it a node would wait for ever."""

from __future__ import annotations

import errno
import os
import threading
from pathlib import Path

import pytest
from std_msgs.msg import Float64MultiArray
from support.node_bench import Bench
from support.node_processes import NodeProcesses

from lathe_chatter.nodes.shared_memory import SHARED_MEMORY, free_ports

KINDS = ('fastrtps', 'fastdds')
READY = (2).to_bytes(4, 'little') + bytes(100)


@pytest.mark.parametrize('content', [b'', bytes(100), (1).to_bytes(4, 'little') + bytes(100)])
@pytest.mark.parametrize('name', ['fastrtps_port7400', 'fastdds_port7411'])
def test_a_half_made_port_is_removed(name: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    (sentence,) = free_ports(tmp_path)
    assert sentence.startswith(
        f'{tmp_path / name} was left half-made by a process that was killed;'
    )
    assert not (tmp_path / name).exists()
    assert free_ports(tmp_path) == []


def test_a_semaphore_that_a_killed_process_had_is_removed(tmp_path: Path) -> None:
    semaphore = tmp_path / 'sem.fastrtps_port7413_mutex'
    semaphore.write_bytes(bytes(32))
    (sentence,) = free_ports(tmp_path)
    assert sentence.startswith(f'{semaphore} was left locked by a process')
    assert not semaphore.exists()


def test_what_another_user_left_is_named_and_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = tmp_path / 'fastrtps_port7400'
    port.touch()

    def refuse(_path: Path, **_options: bool) -> None:  # as the system does, but not to root
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(Path, 'unlink', refuse)
    (sentence,) = free_ports(tmp_path)
    assert sentence.endswith(
        'and a node may wait on it for ever; to remove it: Operation not permitted.'
    )
    assert port.exists()


def test_a_port_that_somebody_is_making_stays(tmp_path: Path) -> None:
    port = tmp_path / 'fastrtps_port7400'
    port.touch()
    maker = threading.Timer(0.5, port.write_bytes, [READY])
    maker.start()
    assert free_ports(tmp_path) == []
    maker.join()
    assert port.read_bytes() == READY


def test_what_is_ready_or_no_port_stays(tmp_path: Path) -> None:
    files = {'sem.fastdds_port7413_mutex': (1).to_bytes(32, 'little'), 'sem.other': bytes(32)}
    files |= {'fastrtps_port7400': READY, 'fastrtps_port7411_el': b'', 'fastdds_0123_port': b''}
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    assert free_ports(tmp_path) == []
    assert {path.name for path in tmp_path.iterdir()} == set(files)


@pytest.mark.skipif(not SHARED_MEMORY.is_dir(), reason='no shared memory is mounted')
def test_a_lathe_starts_where_another_was_killed_amid_its_start(
    bench: Bench, nodes: NodeProcesses, domain: int
) -> None:
    ports = [7400 + 250 * domain + 11 + 2 * participant for participant in range(1, 4)]
    paths = [SHARED_MEMORY / f'{kind}_port{port}' for kind in KINDS for port in ports]
    made = [path for path in paths if not path.exists()]
    try:
        for path in made:
            path.touch()
        nodes.start('lathe')
        samples = bench.listen(Float64MultiArray, '/lathe/samples')
        bench.spin_until(lambda: samples, 'samples')
        # By this lathe, or by a node of another test that started in these seconds.
        assert not [path for path in made if path.exists() and not path.stat().st_size]
    finally:
        for path in made:
            if path.exists() and path.stat().st_size == 0:
                path.unlink()
