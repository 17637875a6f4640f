"""The figures of wide work: data sets, executors, truth, and the environment to learn in.

    python benchmarks/scale.py [PART ...] [--windows N] [--workers N] [--picture FILE]

Parts: truth windows hashes workers environment (all of these by default; some six minutes
on two idle cores) and picture. Where others use the machine the time on its clock says little:
processor time stands beside it, and the load at the beginning. `picture` draws how time falls with
workers that have a core each. Measured is, of 1 to 4 of them, the processor time of the busiest
process; beyond that it is simulated, from the processor time of each batch and of what the one
process that writes does.
"""

from __future__ import annotations

import os

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import argparse
import hashlib
import heapq
import pickle
import resource
import shutil
import signal
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.cli.console import Screen
from lathe_chatter.cli.worker_options import open_executor
from lathe_chatter.dataset import Plan, generation, load_plan, make_dataset
from lathe_chatter.executors import Processes, cores, run_batches
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.many_lathes import LatheSweep
from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.stability.stability_of_many_cuts import operating_points

ROOT = Path(__file__).resolve().parents[1]
MEASURED, PICTURED = (1, 2, 4), 16_000
"""Workers of which the picture has measured values, and windows of which they are."""
_PER_MACHINE = 1000
"""Windows of a machine: ten runs of a hundred."""
_PLAN = """
machines: {machines}
runs: 10
duration: 10.5 s
machine:
  tool.natural_frequency: {{uniform: [550 rad/s, 1100 rad/s]}}
  workpiece.natural_frequency: {{uniform: [450 rad/s, 900 rad/s]}}
  workpiece.damping_ratio: {{uniform: [0.03, 0.08]}}
  cutting_coefficient: {{log_uniform: [2 MPa, 6 MPa]}}
cut:
  spindle_speed_rpm: {{uniform: [2000, 6000]}}
  depth_of_cut: {{of_limit: {{uniform: [0.2, 1.4]}}}}
  bearing_contact: {{choice: [none, seated]}}
  force_noise: {{log_uniform: [0.0003, 0.003]}}
  sensor_noise: 0.1 um
windows: {{length: 0.1 s, first: 0.5 s}}
"""


def main() -> None:
    """Measure what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('parts', nargs='*', metavar='PART')
    parser.add_argument('--windows', type=int, default=100_000, help='of the data set (100000)')
    parser.add_argument('--workers', type=int, default=cores(), help='(a core each)')
    parser.add_argument(
        '--picture', type=Path, default=ROOT / 'docs' / 'workers.png', metavar='FILE',
        help='how time falls with workers (docs/workers.png)',
    )  # fmt: skip
    options = parser.parse_args()
    parts: dict[str, Callable[[Any], None]] = {
        'truth': truth,
        'windows': windows,
        'hashes': hashes,
        'workers': workers,
        'environment': environment,
        'picture': picture,
    }
    unknown = set(options.parts) - set(parts)
    if unknown:
        parser.error(f'no such part: {", ".join(unknown)}; there are {", ".join(parts)}')
    Screen().compile()
    show('load of the machine at the beginning', f'{os.getloadavg()[0]:.1f}', 'below 0.5')
    for name in options.parts or [*parts][:-1]:
        parts[name](options)


def show(what: str, value: str, goal: str = '') -> None:
    """A line of the table."""
    print(f'{what:72} {value:>16}  {goal and f"goal {goal}"}', flush=True)


def truth(_options: Any) -> None:
    """Of machines that are all different."""
    rng = np.random.default_rng(1)
    machines = [
        Machine(Mode(0.05, rng.uniform(550.0, 1100.0), 0.05), Mode(0.05, 650.0, 0.05))
        for _ in range(5000)
    ]
    speeds = rng.uniform(2000.0, 6000.0, 5000).tolist()
    cuts = [Cut(speed, 5e-4) for speed in speeds]
    operating_points(machines[:2], cuts[:2])
    spent = []
    for _ in range(5):
        begin = time.process_time()
        operating_points(machines, cuts)
        spent.append((time.process_time() - begin) / len(machines))
    told = f'{1e3 * np.median(spent):.3f} ms'
    show('truth of a random machine, among 5000, processor time', told, '0.1 ms')


def plan_of(count: int, folder: Path) -> Plan:
    """A plan of about so many windows, a third of a cut that chatters."""
    path = folder / 'plan.yaml'
    path.write_text(_PLAN.format(machines=max(2, count // _PER_MACHINE)), encoding='utf-8')
    return load_plan(path)


def windows(options: Any) -> None:
    """A data set, its time and its memory."""
    with tempfile.TemporaryDirectory() as name:
        plan, folder = plan_of(options.windows, Path(name)), Path(name) / 'data'
        with Processes(options.workers) as pool:
            warm(plan, pool)
            theirs = -sum(run_everywhere(pool, options.workers).values())
            begin, own = time.perf_counter(), processor_time()
            entries = make_dataset(plan, folder, executor=pool)
            spent = time.perf_counter() - begin
            own = processor_time() - own
            theirs += sum(run_everywhere(pool, options.workers).values())
        stable = sum(entry['stable'] for entry in entries) / plan.windows
        written = sum(file.stat().st_size for file in folder.rglob('*') if file.is_file())
    what = (
        f'{plan.windows} windows of 2 x 1000, {1 - stable:.0%} unstable, {options.workers} workers'
    )
    goal = f'{300 * plan.windows / 1e6:.0f} s'
    show(what, f'{spent:.0f} s', goal)
    show('  processor time: the workers', f'{theirs:.0f} s')
    show('  processor time: the process that writes', f'{own:.0f} s')
    show(
        '  on as many cores of their own that is',
        f'{(theirs + own) / options.workers:.0f} s',
        goal,
    )
    show('  on disk', f'{written / 1e6:.0f} MB')
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    most += resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * options.workers
    show('  memory at most: this process and its workers', f'{most / 1e3:.0f} MB', '1000 MB')


def processor_time() -> float:
    """Of this process, s."""
    return time.process_time()


def run_everywhere(pool: Executor, count: int) -> dict[int, float]:
    """The processor time of each worker, s, by its number."""
    found: dict[int, float] = {}
    while len(found) < count:
        for done in run_batches(_who_and_how_long, [[0]] * (2 * count), executor=pool):
            found |= dict(done.results)
    return found


def _who_and_how_long(_item: int) -> tuple[int, float]:
    time.sleep(0.05)  # so that one does not do it for all
    return os.getpid(), processor_time()


def warm(plan: Plan, pool: Executor) -> None:
    """Have the workers load what they load once."""
    one = [('', range(1))]
    list(run_batches(partial(generation.make_part, plan), [one] * (2 * cores()), executor=pool))


def digest(folder: Path) -> str:
    """Of every file of a folder."""
    found = hashlib.sha256()
    for file in sorted(file for file in folder.rglob('*') if file.is_file()):
        found.update(file.relative_to(folder).as_posix().encode() + file.read_bytes())
    return found.hexdigest()[:12]


def hashes(_options: Any) -> None:
    """The same bytes from everybody, also where one is killed or the call is interrupted."""
    kinds: dict[str, Callable[[], Any]] = {
        '1 thread': partial(ThreadPoolExecutor, 1),
        '2 threads': partial(ThreadPoolExecutor, 2),
        '4 threads': partial(ThreadPoolExecutor, 4),
        '1 process': partial(Processes, 1),
        '2 processes': partial(Processes, 2),
        '4 processes': partial(Processes, 4),
        'Dask, 2 workers': partial(open_executor, 2, 'local'),
    }
    found = {}
    with tempfile.TemporaryDirectory() as name:
        plan = plan_of(8000, Path(name))
        for kind, open_ in kinds.items():
            with open_() as pool:
                make_dataset(plan, Path(name) / kind, executor=pool)
            found[kind] = digest(Path(name) / kind)
            shutil.rmtree(Path(name) / kind)

        def interrupt(done: int, total: int) -> None:
            if done > 0.4 * total:
                raise KeyboardInterrupt

        with Processes(2) as pool:
            try:
                make_dataset(plan, Path(name) / 'again', executor=pool, progress=interrupt)
            except KeyboardInterrupt:
                make_dataset(plan, Path(name) / 'again', executor=pool)
        found['interrupted and continued'] = digest(Path(name) / 'again')
    for kind, value in found.items():
        show(f'data set of {plan.windows} windows: {kind}', value)
    equal = 'equal' if len(set(found.values())) == 1 else 'DIFFERENT'
    show('hashes', equal, 'equal')


def lathes(count: int) -> LatheSweep:
    """Lathes of many speeds."""
    cuts = [Cut(speed, 6e-4, force_noise=1e-3) for speed in np.linspace(2000.0, 6000.0, count)]
    return LatheSweep(VirtualLathe(cut=cut, seed=k) for k, cut in enumerate(cuts))


def workers(options: Any) -> None:
    """Dask and processes against one thread, and where a worker is killed at 40 % of the time.

    By processor time it is that of the thread over that of the busiest worker. What two processes
    gain that only compute is beside it: no more can be had from the cores of this machine.
    """
    sizes, rounds = ((1000, 100_000), (300, 400_000)), 3  # cuts of 10 s, and of 40 s
    ends = dict[tuple[int, int], set[bytes]]()

    def swept(pool: Executor, number: int, samples: int) -> tuple[float, float]:
        sweep = lathes(number)
        begin, own = time.perf_counter(), time.process_time()
        sweep.advance(samples, columns=[], executor=pool)
        spent = time.perf_counter() - begin, time.process_time() - own
        last = np.concatenate([lathe.advance(10) for lathe in sweep.lathes()]).tobytes()
        ends.setdefault((number, samples), set()).add(last)
        return spent

    lathes(1).advance(1000)
    kinds = {
        'processes': partial(Processes, options.workers),
        'Dask': partial(open_executor, options.workers, 'local'),
    }
    for kind, open_ in kinds.items():
        goal = '1.8' if kind == 'Dask' and options.workers == 2 else ''
        with open_() as pool, ThreadPoolExecutor(1) as thread:
            run_everywhere(pool, options.workers)
            for _ in range(3):  # they load what they need
                lathes(4 * options.workers).advance(1000, executor=pool)
            for count, samples in sizes:
                found = []
                for _ in range(rounds):
                    alone, own = swept(thread, count, samples)
                    before = run_everywhere(pool, options.workers)
                    whole, _ = swept(pool, count, samples)
                    after = run_everywhere(pool, options.workers)
                    busiest = max(after[k] - before.get(k, 0.0) for k in after)
                    found.append((alone / whole, own / busiest, gain(pool, options.workers)))
                by_clock, by_processor, plain = np.median(found, axis=0)
                what = f'{count} lathes x {samples}: {options.workers} {kind} against a thread'
                show(what, f'{by_clock:.2f} times', goal)
                show('  by processor time', f'{by_processor:.2f} times', goal)
                show('  the same workers, of plain compute', f'{plain:.2f} times')
            whole, _ = swept(pool, 3000, 100_000)
            victim = next(iter(run_everywhere(pool, options.workers)))
            threading.Timer(0.4 * whole, os.kill, (victim, signal.SIGKILL)).start()
            killed, _ = swept(pool, 3000, 100_000)
            show(
                f'  of {whole:.0f} s, a worker killed at 40 %',
                f'{killed / whole:.2f} times',
                '1.4',
            )
    equal = all(len(found) == 1 for found in ends.values())
    show('  bits', 'equal' if equal else 'DIFFERENT', 'equal')


def gain(pool: Executor, count: int) -> float:
    """How many times as much workers do at once as one alone, of what needs no memory."""
    times = []
    for number in (1, count):
        begin = time.perf_counter()
        list(run_batches(_plain, [[0]] * number, executor=pool))
        times.append(time.perf_counter() - begin)
    return count * times[0] / times[1]


def _plain(_item: int) -> float:
    value = 1.0
    for _ in range(20_000_000):
        value = 0.999 * value + 0.001
    return value


def environment(_options: Any) -> None:
    """Steps of 20 ms, where the setting is held and where it is another each time."""
    from lathe_chatter.gym_environment import LatheEnv

    env = LatheEnv(steps=10**9)
    for what, count, moves in (
        ('held', 20_000, np.zeros(16)),
        ('one of 16', 20_000, np.linspace(-1.0, 1.0, 16)),
        ('never the same', 500, np.linspace(-1.0, 1.0, 190)),
    ):
        env.reset(seed=1)
        actions = np.column_stack((moves, np.full(len(moves), -0.5), np.zeros(len(moves))))
        for k in range(20):
            env.step(actions[k % len(actions)])
        begin = time.process_time()
        for k in range(count):
            env.step(actions[k % len(actions)])
        rate = count / (time.process_time() - begin)
        goal = '10000' if what == 'held' else ''
        show(
            f'environment, steps of 20 ms a s and core: the setting is {what}', f'{rate:.0f}', goal
        )


def simulated(batches: Array, serial: float, count: int) -> float:
    """The time, s, in which workers do batches that one process takes from them and writes."""
    free, taken = [0.0] * count, 0.0
    for length in batches:
        ready = heapq.heappop(free) + length
        taken = max(taken, ready) + serial
        heapq.heappush(free, ready)
    return taken


def picture(options: Any) -> None:
    """Draw time over workers."""
    from lathe_chatter.plot_style import OPEN, SEATED, grid, new_figure, save

    with tempfile.TemporaryDirectory() as name:
        plan = plan_of(PICTURED, Path(name))
        parts, lengths, serial = generation.parts_of(plan), [], 0.0
        generation.make_part(plan, next(iter(parts.items())))
        for part in parts.items():
            begin = processor_time()
            files, entry = generation.make_part(plan, part)
            lengths.append(processor_time() - begin)
            begin = processor_time()
            generation._write(Path(name) / entry['part'], files)  # noqa: SLF001 -- what it takes
            pickle.loads(pickle.dumps((files, entry)))  # noqa: S301 -- as it comes from a worker
            serial += (processor_time() - begin) / len(parts)
        measured = {}
        for count in MEASURED:
            with Processes(count) as pool:
                warm(plan, pool)
                before, own = run_everywhere(pool, count), processor_time()
                make_dataset(plan, Path(name) / str(count), executor=pool)
                own = processor_time() - own
                after = run_everywhere(pool, count)
                measured[count] = max(own, *(after[k] - before.get(k, 0.0) for k in after))
    # The million windows of the table, in batches that take as long as these did.
    batches = np.random.default_rng(1).choice(lengths, round(1e6 / plan.windows * len(parts)))
    counts = np.unique(np.geomspace(1, 1024, 31).round().astype(int))
    times = np.array([simulated(batches, serial, int(count)) for count in counts])
    figure = new_figure(7.0, 4.6)
    axes = figure.subplots()
    scale = 1e6 / plan.windows / 60.0
    axes.loglog(counts, times / 60.0, '-', color=OPEN, label='simulated, from measured batches')
    axes.loglog(counts, times[0] / 60.0 / counts, ':', color='0.5', label='ideal')
    axes.loglog(
        [*measured], [scale * value for value in measured.values()], 'o', color=SEATED, ms=8,
        label='measured on 16 000 windows: the busiest process',
    )  # fmt: skip
    axes.set_xlabel('workers')
    axes.set_ylabel('time of a million windows, a core each / min')
    axes.xaxis.set_major_formatter('{x:g}')
    axes.yaxis.set_major_formatter('{x:g}')
    axes.legend()
    grid(axes)
    save(figure, options.picture)
    for count in (1, 2, 8, 64, 512):
        spent = simulated(batches, serial, count) / 60.0
        show(f'a million windows, simulated, {count} workers', f'{spent:.2f} min')
    for count, value in measured.items():
        what = f'a million windows, the busiest of {count} workers on {plan.windows}'
        show(what, f'{scale * value:.2f} min')
    show('what the one process does for a batch, processor time', f'{1e3 * serial:.1f} ms')
    show(f'a batch of {plan.windows // len(parts)} windows', f'{1e3 * np.mean(lengths):.0f} ms')


if __name__ == '__main__':
    main()
