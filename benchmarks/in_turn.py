"""A benchmark of this version and of an earlier one, in turn on the same machine.

    python benchmarks/in_turn.py [--rounds 3] REVISION BENCHMARK [ARGUMENT ...]
    python benchmarks/in_turn.py 7d96424 recording reading

Times of two machines, or of two days, do not compare; those of one machine in turn do. The earlier
version is checked out beside this one for that long, and runs in the environment of this one. What
both print stands under each other, the version first. 7d96424 is the version from which the goals
of most figures were set.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]


def main() -> None:
    """Run both, and print what they print."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--rounds', type=int, default=3, help='how often each runs')
    parser.add_argument('revision', help='of the earlier version, as git knows it')
    parser.add_argument('benchmark', nargs=argparse.REMAINDER, help='with its arguments')
    options = parser.parse_args()
    with TemporaryDirectory() as name:
        earlier = Path(name) / 'earlier'
        _git('worktree', 'add', '--quiet', '--detach', str(earlier), options.revision)
        try:
            for number in range(options.rounds):
                for version, tree in ((options.revision, earlier), ('now', ROOT)):
                    for line in _printed(tree, *options.benchmark):
                        print(f'{number + 1} {version:10} {line}', flush=True)
        finally:
            _git('worktree', 'remove', '--force', str(earlier))


def _git(*arguments: str) -> None:
    subprocess.run(['git', '-C', str(ROOT), *arguments], check=True)  # noqa: S603, S607 -- its own


def _printed(tree: Path, benchmark: str, *arguments: str) -> list[str]:
    """What a benchmark of a checked out version prints."""
    folder = tree / 'benchmarks'
    file = folder / benchmark if (folder / benchmark).is_dir() else folder / f'{benchmark}.py'
    command = [sys.executable, str(file), *arguments]
    paths = {**os.environ, 'PYTHONPATH': str(tree)}
    done = subprocess.run(  # noqa: S603 -- our own
        command, cwd=tree, env=paths, check=True, stdout=subprocess.PIPE, text=True
    )
    return done.stdout.splitlines()


if __name__ == '__main__':
    main()
