"""The lathe's own record beside the recorder's: equal arrays that can be computed again."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Float64
from support.node_bench import Bench

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.nodes.lathe_node import LatheNode
from lathe_chatter.nodes.recorder_node import RecorderNode
from lathe_chatter.recording import Samples, read_run, resimulate, verify

Start = Callable[..., Any]


def array_of(samples: Samples) -> Any:
    return np.column_stack(list(samples.columns.values()))


def test_both_ways_to_record_give_equal_arrays_that_can_be_computed_again(
    start: Start, bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    recorder = start(RecorderNode, output=str(tmp_path / 'heard'))
    lathe = start(LatheNode, record=str(tmp_path / 'own'), tick_rate=100, seed=11)
    knock = bench.talk(Float64, '/lathe/knock')
    spin_until(lambda: '/lathe' in recorder._noted, 'the parameters')
    spin_until(lambda: recorder.messages_of('/rosout') > 0, 'the log')
    assert bench.set_together('/lathe', depth_of_cut=0.0007, force_noise=1e-3).successful
    knock.publish(Float64(data=0.01 / 3.0))
    until = lathe.samples_taken + 2000
    spin_until(lambda: lathe.samples_taken > until, 'samples after the change')
    assert bench.pause('/lathe').success
    assert bench.set('/lathe', depth_of_cut=0.0006)[0].successful
    assert bench.trigger('/lathe/reset').success
    bench.steps('/lathe', 10)
    blocks = recorder.messages_of('/lathe/samples')
    lathe.executor.remove_node(lathe)
    lathe.destroy_node()
    own = read_run(tmp_path / 'own').samples()
    spin_until(
        lambda: 100 * recorder.messages_of('/lathe/samples') == len(own.columns['time']),
        f'the last samples after {blocks} blocks',
    )
    recorder.stop()
    heard = read_run(tmp_path / 'heard').samples()
    assert array_of(heard).tobytes() == array_of(own).tobytes()
    for name in ('own', 'heard'):
        assert verify(tmp_path / name).complete
        (found,) = resimulate(read_run(tmp_path / name))
        assert found.proven, found
        assert found.compared == len(own.columns['time'])


def test_a_folder_that_exists_is_refused(start: Start, tmp_path: Path) -> None:
    with pytest.raises(LatheChatterError, match='exists already'):
        start(LatheNode, record=str(tmp_path))


def test_the_lathe_cuts_on_where_its_record_cannot(
    start: Start, bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    lathe = start(LatheNode, record=str(tmp_path / 'run'))
    told = bench.listen(DiagnosticArray, '/diagnostics')
    file = tmp_path / 'run' / 'run_0.mcap'
    for link in Path('/proc/self/fd').iterdir():
        if link.resolve() == file:
            full = os.open('/dev/full', os.O_WRONLY)
            os.dup2(full, int(link.name))  # the disk is full from here on
            os.close(full)
    spin_until(
        lambda: any(
            status.name == '/lathe: own record' and os.strerror(errno.ENOSPC) in status.message
            for array in told
            for status in array.status
        ),
        'the complaint',
    )
    until = lathe.samples_taken + 100
    spin_until(lambda: lathe.samples_taken > until, 'more samples')


def test_a_record_that_cannot_be_made_is_refused_with_its_parameter(
    start: Start, tmp_path: Path
) -> None:
    (tmp_path / 'file').touch()
    with pytest.raises(LatheChatterError, match=r'record: the run .* cannot be made: '):
        start(LatheNode, record=str(tmp_path / 'file' / 'run'))


def test_a_lathe_that_records_itself_slows_down_rather_than_lose(
    start: Start, spin_until: Any, tmp_path: Path
) -> None:
    """As fast as it can: its samples come faster than a recorder could take them."""
    lathe = start(LatheNode, real_time_factor=0.0, record=str(tmp_path / 'own'))
    spin_until(lambda: lathe.samples_taken > 300_000, 'half a minute of cutting')
    lathe.executor.remove_node(lathe)
    lathe.destroy_node()
    found = verify(tmp_path / 'own')
    assert found.complete, found.findings
    assert found.samples['/lathe/samples'].samples == lathe.samples_taken
