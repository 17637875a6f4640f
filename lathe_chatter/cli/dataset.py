"""`lathe-chatter dataset`: labelled windows of simulated cuts, from a plan."""

from __future__ import annotations

import shutil
import time
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import NamedTuple

from lathe_chatter.cli.common_options import add_json, path_of, utf8
from lathe_chatter.cli.console import INTERRUPTED, Screen
from lathe_chatter.cli.worker_options import add_executor, executor_of
from lathe_chatter.dataset import Plan, load_plan, make_dataset
from lathe_chatter.dataset.generation import make_part, parts_of
from lathe_chatter.dataset.windows import drawn_machine
from lathe_chatter.errors import DatasetError
from lathe_chatter.executors import cores, width_of
from lathe_chatter.lathe.doubts import doubts

EXAMPLE = 'lathe-chatter dataset examples/datasets/chatter.yaml --output data/chatter'


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument('plan', type=path_of, metavar='PLAN.yaml', help='what the data set is')
    parser.add_argument(
        '--output', type=path_of, metavar='DIR',
        help='folder to make; one that was interrupted is continued (default: the name of the '
        'plan)',
    )  # fmt: skip
    parser.add_argument(
        '--dry-run', action='store_true',
        help='only check the plan, and estimate time and size from its first machine',
    )  # fmt: skip
    add_executor(parser, 'a process a core')
    add_json(parser)


def run(options: Namespace) -> int:
    """Estimate, and make or continue."""
    plan = load_plan(options.plan)
    folder = utf8('--output', options.output or Path(options.plan.stem))
    screen = Screen(json=options.json)
    screen.compile()
    first = drawn_machine(plan, 0)
    for doubt in (*plan.doubts, *doubts(first.setup, first.cut)):
        screen.say(f'WARNING  {doubt}')
    if options.workers is None and options.cluster is None:
        options.workers = cores()
    cost, parts = None, [folder / name for name in parts_of(plan)]
    if options.dry_run or not all(part.exists() for part in parts):
        with screen.working('Making the windows of a machine, to estimate ...'):
            cost = _estimate(plan)
    if cost and options.dry_run:
        _say_cost(plan, cost, options.workers, screen)
        screen.json({'windows': plan.windows, 'bytes': cost.size, 'core_seconds': cost.seconds})
        return 0
    try:
        with executor_of(options, screen) as executor:
            if cost:
                _say_cost(plan, cost, width_of(executor), screen)
                _check_room(folder, cost)
            with screen.progress('windows', plan.windows) as bar:
                entries = make_dataset(plan, folder, executor=executor, progress=bar.show)
    except KeyboardInterrupt:
        if there := sum(part.exists() for part in parts):
            said = f'{there} of {len(parts)} parts are in {folder}'
            screen.say(f'Interrupted: {said}, and the same call goes on from them.')
        else:
            said = 'before the first part was whole, so nothing is kept'
            screen.say(f'Interrupted {said}: the same call begins again.')
        return INTERRUPTED
    windows, stable = (sum(entry[name] for entry in entries) for name in ('windows', 'stable'))
    screen.say(f'{windows} windows, {stable / max(windows, 1):.1%} of a stable cut.')
    screen.name_file('data set', folder)
    screen.json({'folder': folder, 'windows': windows, 'stable': stable, 'parts': len(entries)})
    return 0


class _Cost(NamedTuple):
    """What a data set will take: bytes, and s on one core."""

    size: float
    seconds: float


def _estimate(plan: Plan) -> _Cost:
    """From the first machine."""
    one = ('', range(1))
    make_part(plan, one)  # what is compiled or loaded once does not count
    begin = time.perf_counter()
    files, _ = make_part(plan, one)
    spent = time.perf_counter() - begin
    return _Cost(sum(map(len, files.values())) * plan.machines, spent * plan.machines)


def _say_cost(plan: Plan, cost: _Cost, workers: int, screen: Screen) -> None:
    """What it will be and take."""
    seconds = cost.seconds / workers
    long = f'{seconds / 60.0:.0f} min' if seconds > 99.0 else f'{seconds:.0f} s'
    number = f'{workers} workers' if workers != 1 else '1 worker'
    screen.say(
        f'{plan.machines} machines x {plan.runs} runs x {len(plan.starts)} windows of '
        f'{len(plan.columns)} x {plan.length} samples in {len(parts_of(plan))} parts: about '
        f'{cost.size / 1e6:.3g} MB, and {long} with {number} such as this.'
    )


def _check_room(folder: Path, cost: _Cost) -> None:
    """Refuse what the disk has no room for.

    Raises:
        DatasetError: If it is clearly too small.
    """
    place = next(parent for parent in (folder, *folder.absolute().parents) if parent.exists())
    there = sum(file.stat().st_size for file in folder.rglob('*') if file.is_file())
    free = shutil.disk_usage(place).free
    if free + there < 0.9 * cost.size:
        raise DatasetError(
            f'The disk of {folder} has {free / 1e6:.0f} MB left, and the data set needs about '
            f'{(cost.size - there) / 1e6:.0f} MB more.'
        )
