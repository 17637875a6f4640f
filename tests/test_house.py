"""The laws of the house: who may import whom, what an import may do, how long a module may be.

docs/architecture.md says why. `ARROWS` is the one place where the arrows between the packages are
stated: whoever needs another one writes it here, and thinks.
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from lathe_chatter.recording import provenance

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'lathe_chatter'
LONGEST = 400

BASE = {
    *(
        'array_types',
        'atomic_output',
        'code_identity',
        'compiled',
        'errors',
        'executors',
        'html_table',
        'plot_style',
    ),
    *('resumable_results', 'shipped_files', 'standard_streams'),
}
"""What everybody may use: they use nothing but each other."""
ARROWS = {
    'model': set(),
    'samples': set(),
    'tap_test': set(),
    'lathe': {'model', 'samples'},
    'stability': {'model'},
    'detection': {'model', 'stability'},
    'knocks': {'model', 'lathe', 'stability'},
    'supervisor': {'model', 'lathe', 'stability', 'knocks'},
    'precompile': {'model', 'samples', 'lathe', 'detection', 'stability'},
    'recording': {'model', 'samples', 'lathe', 'stability'},
    'scenario': {'model', 'lathe', 'detection', 'recording'},
    'listening': {'model', 'samples', 'detection', 'recording'},
    'dataset': {'model', 'samples', 'lathe', 'stability', 'scenario'},
    'gym_environment': {'model', 'samples', 'lathe', 'detection'},
    'report': {'model', 'samples', 'lathe', 'stability', 'knocks', 'recording', 'tap_test'},
    'paper': {'model', 'samples', 'lathe', 'stability', 'report'},
    'page': {'model', 'samples', 'stability', 'recording', 'report'},
    'nodes': {
        *('model', 'samples', 'lathe', 'detection', 'supervisor', 'recording', 'scenario'),
        'precompile',
        'page',
    },
    'cli': {
        *('model', 'samples', 'lathe', 'stability', 'detection', 'knocks', 'supervisor'),
        *('precompile', 'recording', 'scenario', 'dataset', 'report', 'paper', 'page', 'nodes'),
        'listening',
        'tap_test',
    },
}
"""The packages from the bottom to the top, each with those below that it may use."""
ROS = {
    *('rclpy', 'rcl_interfaces', 'std_msgs', 'std_srvs', 'sensor_msgs', 'diagnostic_msgs'),
    *('rosgraph_msgs', 'builtin_interfaces', 'simulation_interfaces', 'geometry_msgs'),
}


def sources(root: Path = PACKAGE) -> list[Path]:
    return sorted(root.rglob('*.py'))


def imported(file: Path) -> Iterator[tuple[str, bool]]:
    """Every module that a file imports, wherever in it, and whether only for its types.

    Of `from package import module` it is the module, as far as that is a file of ours.
    """
    tree = ast.parse(file.read_text(encoding='utf-8'))
    typing_only = {
        id(node)
        for block in ast.walk(tree)
        if isinstance(block, ast.If) and ast.unparse(block.test) == 'TYPE_CHECKING'
        for node in ast.walk(block)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((each.name, id(node) in typing_only) for each in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            for each in node.names:
                full = f'{node.module}.{each.name}'
                name = full if file_of(full) else node.module
                yield name, id(node) in typing_only


def file_of(module: str) -> Path | None:
    """The file of one of our modules."""
    place = ROOT.joinpath(*module.split('.'))
    files = (place.with_suffix('.py'), place / '__init__.py')
    return next(
        (file for file in files if module.startswith(PACKAGE.name) and file.exists()), None
    )


def room_of(file: Path) -> str:
    """The package at the top to which a file belongs, or its own name where it lies there."""
    first = file.relative_to(PACKAGE).parts[0]
    return first.removesuffix('.py')


@pytest.mark.parametrize('file', sources(), ids=lambda file: str(file.relative_to(PACKAGE)))
def test_arrows_between_packages(file: Path) -> None:
    room = room_of(file)
    if room == '__init__':
        return  # the face loads what it is asked for, and nothing at import (test_face.py)
    others = {room_of(there) for name, _ in imported(file) if (there := file_of(name))}
    allowed = BASE if room in BASE else {*BASE, *ARROWS[room], '__init__'}
    assert others - {room} <= allowed


def test_every_arrow_is_used_and_none_runs_up() -> None:
    rooms = [*ARROWS]
    assert {room_of(file) for file in sources()} == {*ARROWS, *BASE, '__init__'}
    for place, room in enumerate(rooms):
        assert ARROWS[room] <= {*rooms[:place]}, room
        files = [file for file in sources() if room_of(file) == room]
        used = {room_of(f) for file in files for name, _ in imported(file) if (f := file_of(name))}
        assert ARROWS[room] <= used, room


def test_the_picture_of_the_architecture_is_that_of_the_arrows() -> None:
    text = (ROOT / 'docs' / 'architecture.md').read_text(encoding='utf-8')
    drawn: dict[str, int] = {}
    floor = 0
    for line in text.partition('```text\n')[2].partition('```')[0].splitlines():
        number, names = line[:3].strip(), line[3:].split()
        floor = int(number) if number else floor
        drawn |= dict.fromkeys(names, floor)
    floors: dict[str, int] = {}
    for room, below in ARROWS.items():
        floors[room] = 1 + max((floors[each] for each in below), default=0)
    assert drawn == floors
    table = text.partition('| package |')[2].partition('\n\n')[0]
    first = re.findall(r'^\|.*?\|', table, re.MULTILINE)
    described = set(re.findall(r'`(\w+)`', ''.join(first)))
    assert described >= {*ARROWS}
    base = text.partition('for everybody: ')[2].partition('.\n')[0]
    assert set(re.findall(r'`(\w+)`', base)) == BASE


def test_modules_import_each_other_in_no_circle() -> None:
    graph = {
        file: {there for name, types in imported(file) if not types and (there := file_of(name))}
        for file in sources()
        if room_of(file) != '__init__'
    }
    assert [*TopologicalSorter(graph).static_order()]  # it raises CycleError, which names them


def test_ros_is_met_in_the_nodes_alone() -> None:
    for file in sources():
        met = {name.partition('.')[0] for name, _ in imported(file)} & ROS
        assert not met or room_of(file) == 'nodes', file


@pytest.mark.parametrize('file', sources(), ids=lambda file: str(file.relative_to(PACKAGE)))
def test_a_module_can_be_read_at_one_sitting(file: Path) -> None:
    assert len(file.read_text(encoding='utf-8').splitlines()) <= LONGEST


def test_tests_import_no_tests() -> None:
    for file in sources(ROOT / 'tests'):
        names = {part for name, _ in imported(file) for part in name.split('.')}
        assert not [name for name in names if name.startswith('test_')], file


def in_a_fresh_interpreter(script: str, home: Path) -> str:
    """What a script prints where nothing is loaded, and whatever makes a file makes it at home."""
    places = {name: str(home) for name in ('HOME', 'XDG_CACHE_HOME', 'XDG_CONFIG_HOME', 'TMPDIR')}
    hidden = {'NUMBA_CACHE_DIR': '', 'PYTHONDONTWRITEBYTECODE': '1'}
    environment = {**os.environ, **places, **hidden, 'MPLCONFIGDIR': str(home.parent)}
    call = [sys.executable, '-c', script]
    done = subprocess.run(call, check=True, capture_output=True, text=True, env=environment)
    return done.stdout


IMPORT_ALL = """
import contextlib, importlib, pkgutil, lathe_chatter.errors
from importlib.util import find_spec
without = ('__main__',) if find_spec('rclpy') else ('__main__', 'nodes')  # these need ROS
for found in pkgutil.walk_packages(lathe_chatter.__path__, 'lathe_chatter.'):
    if not set(found.name.split('.')) & set(without):
        with contextlib.suppress(lathe_chatter.errors.MissingPackageError):  # an extra
            importlib.import_module(found.name)
import sys
from numba.core.dispatcher import Dispatcher
ours = [module for name, module in sys.modules.items() if name.startswith('lathe_chatter.')]
things = [thing for module in ours for thing in vars(module).values()]
functions = {id(thing): thing for thing in things if isinstance(thing, Dispatcher)}
print(len(functions), *(f.__name__ for f in functions.values() if f.signatures))
"""


def test_no_work_at_import(tmp_path: Path) -> None:
    """No file is made, and no compiled function called."""
    home = tmp_path / 'home'
    home.mkdir()
    count, *called = in_a_fresh_interpreter(IMPORT_ALL, home).split()
    assert int(count) > 20
    assert not called
    assert not [*home.rglob('*')]


CORE = """
import sys, lathe_chatter.lathe.virtual_lathe
print(*(m.__file__ for n, m in sys.modules.items() if n.startswith('lathe_chatter.')), sep='\\n')
"""
NO_BITS = {'errors.py', 'samples/columns.py'}
"""What a lathe imports that no bit of a sample depends on: sentences, and names of columns."""


def test_the_core_that_a_run_names_is_what_a_lathe_imports(tmp_path: Path) -> None:
    """Whether two versions compute the same bits is told from these files, and no others."""
    loaded = {Path(name) for name in in_a_fresh_interpreter(CORE, tmp_path).splitlines()}
    named = {file for pattern in provenance._CORE for file in PACKAGE.glob(pattern)}
    without_code = {file for file in loaded | named if file.name == '__init__.py'}
    left_out = {PACKAGE / name for name in NO_BITS}
    assert named - without_code == loaded - without_code - left_out


def test_texts_name_modules_that_are_there() -> None:
    """A module that has another name now would leave docstrings that lead nowhere."""
    folders = ('lathe_chatter', 'benchmarks', 'tests', 'examples')
    files = [file for folder in folders for file in sources(ROOT / folder)]
    names = {file.name for file in files} | {'a_program.py', 'rclpy.py'}  # what tests make
    texts = {
        (file.parent if file.stem == '__init__' else file).stem: file.read_text(encoding='utf-8')
        for file in sources()
    }
    lost = []
    for file in [*files, *ROOT.glob('docs/**/*.md'), *ROOT.glob('*.md')]:
        text = file.read_text(encoding='utf-8')
        mentioned = set(re.findall(r'(?<![\w.*{}])([a-z]\w*\.py)\b', text)) - names
        lost += [f'{file.name}: {name}' for name in mentioned if name != 'setup.py']
        if file.is_relative_to(PACKAGE):
            lost += [
                f'{file.name}: {module}.{symbol}'
                for module, symbol in re.findall(r'`([a-z]\w*)\.(\w+)`', text)
                if module not in {'sys', 'tool', 'now', 'scratch'}
                and symbol not in texts.get(module, '')
            ]
    assert not lost, '\n'.join(lost)
