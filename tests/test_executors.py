"""`executor=`: the same bits from threads, processes and Dask, also after a lost worker."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from support.worker_calls import fatal, refused, square, square_unless_killed

from lathe_chatter import executors
from lathe_chatter.cli import worker_options
from lathe_chatter.cli.worker_options import open_executor
from lathe_chatter.errors import ParameterError, WorkerError
from lathe_chatter.executors import Processes, batches_of, run_batches, spread, width_of
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.many_lathes import LatheSweep
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.uncertainty import uncertainty_from
from lathe_chatter.stability import growth_map
from lathe_chatter.stability.probability import stability_probability

KINDS: dict[str, Callable[[], AbstractContextManager[Executor]]] = {
    'a thread': partial(ThreadPoolExecutor, 1),
    'four threads': partial(ThreadPoolExecutor, 4),
    'processes': partial(open_executor, 2),
    'dask': partial(open_executor, 2, 'local'),
}


@pytest.fixture(params=KINDS)
def executor(request: pytest.FixtureRequest) -> Iterator[Executor]:
    if request.param == 'dask':
        pytest.importorskip('distributed')
    with KINDS[request.param]() as found:
        yield found


def test_the_same_bits_from_everyone(executor: Executor) -> None:
    """Sweep, growth map and probability, against what one call after the other gives."""
    cuts = [Cut(speed, 0.9e-3, force_noise=0.01) for speed in np.linspace(2500.0, 3500.0, 7)]
    sweep = LatheSweep(VirtualLathe(cut=cut, seed=k) for k, cut in enumerate(cuts))
    halves = [sweep.advance(300, executor=executor) for _ in range(2)]
    for k, cut in enumerate(cuts):
        alone = VirtualLathe(cut=cut, seed=k).advance(600)
        assert np.concatenate([half[:, k] for half in halves]).tobytes() == alone.tobytes()
    chart = (Machine(), Cut(), np.linspace(2500.0, 3500.0, 9), np.linspace(1e-4, 1e-3, 6))
    here, there = growth_map(*chart), growth_map(*chart, executor=executor)
    assert here.growth_rate.tobytes() == there.growth_rate.tobytes()
    known = uncertainty_from('frequency=2%', Machine())
    draw = partial(stability_probability, Machine(), known, Cut(), [3000.0, 3100.0], machines=21)
    assert draw().limits.tobytes() == draw(executor=executor).limits.tobytes()


def test_a_mistake_comes_back_as_it_was_made(executor: Executor) -> None:
    with pytest.raises(ParameterError, match='it must be below 3') as found:
        spread(refused, range(9), executor=executor)
    assert found.value.name == 'number'


@pytest.mark.parametrize('kind', ['processes', 'dask'])
def test_a_worker_that_is_killed_is_made_up_for(kind: str, tmp_path: Path) -> None:
    if kind == 'dask':
        pytest.importorskip('distributed')
    work = partial(square_unless_killed, mark=tmp_path / 'killed')
    told: list[int] = []
    with KINDS[kind]() as executor:
        found = spread(work, range(12), executor=executor, progress=told.append)
    assert (tmp_path / 'killed').exists()
    assert found == [n * n for n in range(12)]
    assert sum(told) == 12


def test_a_pool_of_the_users_own_that_breaks_is_a_sentence(tmp_path: Path) -> None:
    work = partial(square_unless_killed, mark=tmp_path / 'killed')
    with ProcessPoolExecutor(2) as pool, pytest.raises(WorkerError, match='workers are gone'):
        spread(work, range(12), executor=pool)


@pytest.mark.parametrize('busy', [False, True])
def test_workers_leave_when_their_parent_is_killed(busy: bool) -> None:
    """Idle, or in the middle of something long: by `kill -9` nothing else is told to them."""
    code = (
        'import os, time; from lathe_chatter.executors import Processes\n'
        'if __name__ == "__main__":\n'
        '    pool = Processes(2); calls = [pool.submit(time.sleep, 0.5) for _ in range(2)]\n'
        '    print(*pool._pool._processes, flush=True); [call.result() for call in calls]\n'
        f'    [pool.submit(time.sleep, 1e4) for _ in range({2 * busy})]\n'
        '    print("ready", flush=True); time.sleep(1e4)\n'
    )
    with subprocess.Popen([sys.executable, '-c', code], stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout is not None
        workers = [int(word) for word in run.stdout.readline().split()]
        assert run.stdout.readline() == 'ready\n'
        assert len(workers) == 2
        assert all(is_alive(worker) for worker in workers)
        run.kill()
    for _ in range(600):
        if not any(is_alive(worker) for worker in workers):
            return
        time.sleep(0.1)
    for worker in workers:
        os.kill(worker, signal.SIGKILL)
    pytest.fail('workers outlive their parent')


def is_alive(process: int) -> bool:
    """Whether it is there, and not but a name in the table."""
    try:
        state = Path(f'/proc/{process}/stat').read_text(encoding='ascii').rpartition(')')[2]
    except OSError:
        return False
    return state.split()[0] != 'Z'


def test_what_kills_every_worker_ends_in_a_sentence() -> None:
    with Processes(1) as pool, pytest.raises(WorkerError, match='workers are gone'):
        spread(fatal, range(3), executor=pool)
    with Processes(1) as pool:
        assert isinstance(pool.submit(fatal, 0).exception(), BrokenExecutor)


def test_a_worker_of_another_version_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with Processes(1) as pool:
        assert spread(square, [3], executor=pool) == [9]  # it has looked at its own files
        monkeypatch.setattr(executors, 'code_identity', lambda: 'lathe_chatter 9.9.9')
        with pytest.raises(WorkerError, match=r'not, as asked, with lathe_chatter 9\.9\.9'):
            spread(square, [3], executor=pool)


def test_where_processors_differ_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every batch is done on another one, as it were."""
    names = iter('ABCDEFGH')
    monkeypatch.setattr(executors, 'processor_name', lambda: next(names))
    with pytest.warns(UserWarning, match='between the processors A, B'):
        spread(square, [1, 2])


def test_a_lost_worker_loses_little() -> None:
    """What it had in hand is a 32nd of its share, in whatever number of items."""
    with ThreadPoolExecutor(2) as pool:
        batches = batches_of(range(1600), pool)
    assert max(map(len, batches)) == 25
    assert [item for batch in batches for item in batch] == list(range(1600))


def test_no_more_is_begun_than_keeps_the_workers_busy() -> None:
    """So a map that is interrupted waits for little, and a data set needs little memory."""
    taken: list[int] = []

    def batches() -> Iterator[list[int]]:
        for k in range(100):
            taken.append(k)
            yield [k]

    with ThreadPoolExecutor(2) as pool:
        results = run_batches(square, batches(), executor=pool)
        for _ in range(3):
            next(results)
        assert len(taken) <= 8
        results.close()  # type: ignore[attr-defined]  # a generator
    assert len(taken) <= 8


def test_a_cluster_that_is_not_there_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip('distributed')
    monkeypatch.setattr(worker_options, '_DASK_TIMEOUT', 1.0)
    for address in ('tcp://127.0.0.1:1', 'nonsense'):
        with pytest.raises(ParameterError, match='a Dask scheduler that answers'):
            open_executor(2, address).__enter__()
    with open_executor(3) as pool:
        assert width_of(pool) == 3
