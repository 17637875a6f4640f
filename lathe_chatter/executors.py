"""`executor=`: where wide work is done, which may be threads, processes or other machines.

Any `concurrent.futures.Executor` will do: threads (where none is given), `Processes`, Dask's
`Client.get_executor()`, mpi4py's MPIPoolExecutor. Work goes out in batches, and what comes back
is put where it belongs: results do not depend on how many workers there are, of which kind, in
which order they end, or whether one was lost.
"""

from __future__ import annotations

import itertools
import math
import multiprocessing
import os
import pickle
import platform
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent import futures
from concurrent.futures import Executor, Future
from contextlib import nullcontext
from functools import partial
from typing import Any, NamedTuple, TypeVar

from lathe_chatter.code_identity import code_identity, processor_name
from lathe_chatter.errors import WorkerError

Item = TypeVar('Item')
Result = TypeVar('Result')

_AHEAD = 2
"""Batches that are out at once for each worker."""
_PER_WORKER, _PER_WORKER_HERE = 8, 32
"""Batches in all for each worker: fewer where each costs its way to another machine, more where
workers that are done would wait for the last."""
RETRIES = 3
_NOT_FROM_HERE = 'import sys; sys.path[:1] == [""] and sys.path.pop(0)'
_MODULE = 'import runpy; runpy.run_module(sys.argv.pop(1), run_name="__main__", alter_sys=True)'


class Done(NamedTuple):
    """A batch that came back: its place, a result for each item, and on which processor."""

    place: int
    results: list[Any]
    processor: str


def python_command(program: str, *arguments: str) -> list[str]:
    """A command that runs a program in another process of this Python.

    Where the user is may lie a folder `lathe_chatter`, as beside a clone, or a script of any name:
    unlike `python -m`, it imports nothing from there.
    """
    return [sys.executable, '-c', f'{_NOT_FROM_HERE}\n{program}', *arguments]


def module_command(module: str, *arguments: str) -> list[str]:
    """The same of a module, as `python -m` runs it."""
    return python_command(_MODULE, module, *arguments)


def spread(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    *,
    executor: Executor | None = None,
    progress: Callable[[int], object] = lambda _count: None,
) -> list[Result]:
    """The results of a function of each item, in the order of the items.

    Args:
        function: Of one item; for other processes one that they can import.
        items: What it is called with.
        executor: Where; threads, one a core, where None.
        progress: Is told, now and then, how many more are done.

    Raises:
        WorkerError: If workers are lost, or have another version.
    """
    found: dict[int, Result] = {}
    for batch in spread_out(function, items, executor=executor):
        found.update(batch)
        progress(len(batch))
    return [found[place] for place in range(len(items))]


def spread_out(
    function: Callable[[Item], Result], items: Sequence[Item], *, executor: Executor | None
) -> Iterator[list[tuple[int, Result]]]:
    """`spread`, each batch as it comes back: the places of its items, and their results."""
    places = batches_of(range(len(items)), executor)
    batches = ([items[place] for place in batch] for batch in places)
    for done in run_batches(function, batches, executor=executor):
        yield [*zip(places[done.place], done.results, strict=True)]


def batches_of(items: Sequence[Item], executor: Executor | None) -> list[Sequence[Item]]:
    """Items as they go out together, as a task costs some milliseconds on other machines."""
    here = executor is None or isinstance(executor, (futures.ThreadPoolExecutor, Processes))
    count = (_PER_WORKER_HERE if here else _PER_WORKER) * width_of(executor)
    size = max(1, math.ceil(len(items) / count))
    return [items[k : k + size] for k in range(0, len(items), size)]


def run_batches(
    function: Callable[[Item], Any],
    batches: Iterable[Sequence[Item]],
    *,
    executor: Executor | None,
) -> Iterator[Done]:
    """`spread`, each batch as it comes back; no more are out than keep the workers busy."""
    packed = hasattr(executor, '_client')  # Dask would send each array by itself
    # Dask would also name a task by a hash of its text, which takes longer than sending it.
    unnamed = {'pure': False} if packed else {}
    waiting = enumerate(map(pickle.dumps, batches) if packed else batches)
    running: dict[Future[tuple[Any, str]], int] = {}
    task, processors = partial(_work, code_identity(), function), set[str]()
    with nullcontext(executor) if executor else futures.ThreadPoolExecutor(cores()) as pool:
        try:
            for place, batch in itertools.islice(waiting, _AHEAD * width_of(pool)):
                running[pool.submit(task, batch, **unnamed)] = place
            while running:
                done = futures.wait(running, return_when=futures.FIRST_COMPLETED).done
                # In order: after a batch that failed none is taken.
                for future in sorted(done, key=running.__getitem__):
                    here = running.pop(future)
                    for place, batch in itertools.islice(waiting, 1):
                        running[pool.submit(task, batch, **unnamed)] = place
                    results, processor = future.result()
                    processors.add(processor)
                    results = pickle.loads(results) if packed else results  # noqa: S301 -- ours
                    yield Done(here, results, processor)
        except (futures.BrokenExecutor, futures.CancelledError):
            reason = 'killed, perhaps for want of memory, or without their scheduler'
            raise WorkerError(f'The workers are gone: {reason}.') from None
        except ModuleNotFoundError as error:
            raise WorkerError(f'The workers cannot do this: {error}.') from None
        finally:
            for future in running:
                future.cancel()
    if len(processors) > 1:
        names = ', '.join(sorted(processors))
        warnings.warn(f'Last bits may differ between the processors {names}.', stacklevel=2)


def _work(code: str, function: Callable[[Item], Any], batch: Sequence[Item] | bytes) -> Any:
    """What a worker does."""
    if code != code_identity():
        other = f'The worker {platform.node()} computes with {code_identity()}'
        raise WorkerError(f'{other} and not, as asked, with {code}: install the same on both.')
    if not isinstance(batch, bytes):
        return [function(item) for item in batch], processor_name()
    return pickle.dumps([function(item) for item in pickle.loads(batch)]), processor_name()  # noqa: S301 -- ours


def _end_alone() -> None:
    """End this worker when its parent is gone, as by a SIGKILL: nobody else would end it.

    Not by Linux' signal at the death of a parent, which comes also when but the thread ends that
    has started the worker.
    """

    def wait() -> None:
        if parent := multiprocessing.parent_process():
            parent.join()
            os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def cores() -> int:
    """Those that this process may use."""
    return len(os.sched_getaffinity(0))


def width_of(executor: Executor | None) -> int:
    """How many workers an executor has, as far as it says."""
    if client := getattr(executor, '_client', None):  # Dask's
        return max(int(sum(client.nthreads().values())), 1)
    said: int | None = getattr(executor, '_max_workers', None)
    return said or cores()


class Processes(Executor):
    """Processes of this machine (None: a core each); where one is killed, others do its work."""

    def __init__(self, workers: int | None = None) -> None:
        """Begin none yet."""
        self._max_workers = workers or cores()
        self._lock, self._pool, self._closed = threading.Lock(), self._new(), False

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """See Executor."""
        outer: Future[Any] = Future()
        self._begin(outer, partial(fn, *args, **kwargs), RETRIES)
        return outer

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: FBT001, FBT002 -- Executor's
        """See Executor."""
        self._closed = True
        self._pool.shutdown(wait, cancel_futures=cancel_futures)

    def __exit__(self, kind: object, *_rest: object) -> None:
        """Wait for what was begun; where something went wrong here, end it at once."""
        self._closed = True  # nobody does the work of those that end here
        begun = getattr(self._pool, '_processes', None) if kind else None
        for process in list((begun or {}).values()):
            process.terminate()
        self.shutdown(cancel_futures=kind is not None)

    def _new(self) -> futures.ProcessPoolExecutor:
        # Not forked: threads of a library that has begun to compute do not survive that.
        context = multiprocessing.get_context('spawn')
        return futures.ProcessPoolExecutor(self._max_workers, context, initializer=_end_alone)

    def _begin(self, outer: Future[Any], call: Callable[[], Any], retries: int) -> None:
        with self._lock:
            if self._closed:
                raise RuntimeError('The processes were ended: they take no more work.')
            # Ctrl-C does not reach what is started here: this process ends it.
            before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            try:
                inner = self._pool.submit(call)
            except futures.BrokenExecutor:
                self._pool = self._new()
                inner = self._pool.submit(call)
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)
        inner.add_done_callback(partial(self._ended, outer, call, retries))

    def _ended(
        self, outer: Future[Any], call: Callable[[], Any], retries: int, inner: Future[Any]
    ) -> None:
        error = futures.CancelledError() if inner.cancelled() else inner.exception()
        broken = isinstance(error, futures.BrokenExecutor)
        if broken and retries and not self._closed and not outer.cancelled():
            # Not in this thread: it may hold the lock of the pool that broke.
            threading.Thread(target=self._again, args=(outer, call, retries - 1)).start()
        elif outer.set_running_or_notify_cancel():
            outer.set_exception(error) if error else outer.set_result(inner.result())

    def _again(self, outer: Future[Any], call: Callable[[], Any], retries: int) -> None:
        try:
            self._begin(outer, call, retries)
        except RuntimeError as error:
            if outer.set_running_or_notify_cancel():
                outer.set_exception(error)
