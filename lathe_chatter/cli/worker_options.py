"""Where work that is wide is done, as a user says it: `--workers 4`, `--cluster tcp://host:8786`."""

from __future__ import annotations

import warnings
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager

from lathe_chatter.cli.console import Screen
from lathe_chatter.errors import ParameterError, optional
from lathe_chatter.executors import RETRIES, Processes, cores
from lathe_chatter.model.quantity_fields import count_of

_DASK_TIMEOUT = 10.0
_SETTINGS = {
    'distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_': 2**26,
    'distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_': 2**25,
    'distributed.worker.profile.enabled': False,
    'distributed.admin.tick.interval': '1s',
    'distributed.admin.large-graph-warning-threshold': '1 GB',
}
"""Of Dask. As it sets its workers, each block of samples is given back to the system and asked for
again, which takes half as long as computing it; each of its processes wakes 50 times a second; and
it warns of batches of many lathes."""


def add_executor(parser: ArgumentParser, usual: str = 'threads, one a core') -> None:
    """Declare where work that is wide may be done."""
    parser.add_argument(
        '--workers', type=int, metavar='N',
        help=f'processes of this machine that share the work (default: {usual})',
    )  # fmt: skip
    parser.add_argument(
        '--cluster', metavar='ADDRESS',
        help='Dask scheduler whose workers share the work, as tcp://host:8786; local starts one '
        "with --workers workers (pip install 'lathe_chatter[cluster]')",
    )  # fmt: skip


@contextmanager
def executor_of(options: Namespace, screen: Screen) -> Iterator[Executor]:
    """Where the user wants wide work done; that processors differ is said.

    Raises:
        ParameterError: If there is no such place.
        MissingPackageError: If Dask is asked for and not installed.
    """
    if options.workers is not None:
        count_of('--workers', options.workers, least=1)
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_: screen.say(str(message))
        with open_executor(options.workers, options.cluster) as executor:
            yield executor


@contextmanager
def open_executor(workers: int | None = None, cluster: str | None = None) -> Iterator[Executor]:
    """Processes, or a Dask cluster (the address of its scheduler, or `local`), or else threads.

    Raises:
        ParameterError: If no scheduler answers there.
        MissingPackageError: If Dask is asked for and not installed.
    """
    if cluster is None:
        with Processes(workers) if workers else ThreadPoolExecutor(cores()) as pool:
            yield pool
        return
    dask, settings = optional('distributed', 'A cluster'), optional('dask', 'A cluster').config
    with settings.set(_SETTINGS), ExitStack() as stack:
        address = cluster
        if cluster == 'local':
            count = workers or cores()
            local = dask.LocalCluster(count, threads_per_worker=1, dashboard_address=':0')
            address = stack.enter_context(local)
        try:
            client = stack.enter_context(dask.Client(address, timeout=_DASK_TIMEOUT))
        except (OSError, ValueError, TypeError):
            allowed = 'local, or the address of a Dask scheduler that answers: tcp://host:8786'
            raise ParameterError('--cluster', cluster, '', allowed) from None
        yield client.get_executor(retries=RETRIES)
