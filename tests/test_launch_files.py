"""The launch files: their arguments are those of docs/how_to/launch.md, and reach every node.

Where `launch` and `launch_ros` are, which no wheels have, each file is launched, with executables
that write down what they were given; what the sources alone tell is looked at everywhere.
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import yaml

from lathe_chatter.nodes.parameter_tables import LATHE, MONITOR, PAGE, RECORDER, SUPERVISOR

TABLES = {
    'lathe': LATHE,
    'chatter_monitor': MONITOR,
    'run_recorder': RECORDER,
    'chatter_supervisor': SUPERVISOR,
    'operator_page': PAGE,
}
ROOT = Path(__file__).resolve().parents[1]
FILES = sorted((ROOT / 'launch').glob('*.launch.py'))
CELL: dict[str, dict[str, Any]] = {
    '/hall/cell7/lathe': {},
    '/hall/cell7/chatter_monitor': {},
    '/hall/cell7/run_recorder': {'output': '2026'},
}
STARTED: dict[str, dict[str, dict[str, Any]]] = {
    'cell': CELL,
    'supervised_cell': {
        **CELL,
        '/hall/cell7/chatter_supervisor': {'mode': 'shadow'},
        '/hall/cell7/operator_page': {'port': 8080},
    },
    'three_cells': {
        f'/cell{k}/{node}': {} if node == 'run_recorder' else {'machine': machine}
        for k, machine in enumerate(('paper', 'chucked_shaft', 'boring_bar'), 1)
        for node in ('lathe', 'chatter_monitor', 'run_recorder')
    },
    'replay': {'/hall/cell7/chatter_monitor': {}},
}
LAUNCHER = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

source = PythonLaunchDescriptionSource(sys.argv[1])
arguments = [argument.split(':=') for argument in sys.argv[2:]]
service = LaunchService()
service.include_launch_description(
    LaunchDescription([IncludeLaunchDescription(source, launch_arguments=arguments)])
)
sys.exit(service.run())
"""
WRITES_DOWN = """#!/bin/sh
printf '%s\\n' "$0" "$@" > "$WRITTEN_DOWN/$$"
"""


def has_launch() -> bool:
    """Whether a ROS 2 installation is sourced; the folder `launch` of this checkout is none."""
    try:
        return hasattr(import_module('launch'), 'LaunchService') and bool(
            import_module('launch_ros.actions')
        )
    except ImportError:
        return False


def literal(file: Path, name: str) -> Any:
    """A constant of a launch file, of which nothing is run."""
    for statement in ast.parse(file.read_text(encoding='utf-8')).body:
        if isinstance(statement, ast.Assign) and ast.unparse(statement.targets[0]) == name:
            return ast.literal_eval(statement.value)
    raise AssertionError(f'{file.name} has no {name}')


def calls(file: Path, name: str) -> list[dict[str, str]]:
    """The keywords of each call of a class in a launch file."""
    tree = ast.walk(ast.parse(file.read_text(encoding='utf-8')))
    return [
        {str(keyword.arg): ast.unparse(keyword.value) for keyword in node.keywords}
        for node in tree
        if isinstance(node, ast.Call) and ast.unparse(node.func) == name
    ]


def test_the_page_has_every_argument_of_every_file() -> None:
    page = (ROOT / 'docs' / 'how_to' / 'launch.md').read_text(encoding='utf-8')
    parts = re.split(r'^## `(\w+)\.launch\.py`$', page, flags=re.MULTILINE)
    described = {
        name: dict(re.findall(r'^\| `(\w+)` \| (.*?) \|', text, re.MULTILINE))
        for name, text in zip(parts[1::2], parts[2::2], strict=True)
    }
    declared = {
        file.name.partition('.')[0]: {
            name: {None: '(must be given)', '': 'empty'}.get(default, f'`{default}`')
            for name, (default, _) in literal(file, 'ARGUMENTS').items()
        }
        for file in FILES
    }
    assert described == declared


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.name)
def test_every_node_is_given_namespace_clock_and_parameter_file(file: Path) -> None:
    source = file.read_text(encoding='utf-8')
    nodes, included = calls(file, 'Node'), 'IncludeLaunchDescription' in source
    assert nodes or included
    assert all(node['namespace'] == "given['namespace']" for node in nodes)
    for name in ('use_sim_time', 'params_file') if nodes else ():
        assert f"given['{name}']" in source
    if included:  # what is not passed on is there as it was given
        (passed,) = (each['launch_arguments'] for each in calls(file, 'IncludeLaunchDescription'))
        names = set(re.findall(r"'(\w+)':", passed))
        assert names <= set(literal(ROOT / 'launch' / 'cell.launch.py', 'ARGUMENTS'))
        assert not names & {'use_sim_time', 'params_file'}


def test_the_parameters_are_those_of_the_nodes() -> None:
    file = ROOT / 'launch' / 'cell.launch.py'
    declared = literal(file, 'ARGUMENTS')
    for node, origins in literal(file, 'PARAMETERS').items():
        assert set(origins) <= {row.name for row in TABLES[node]}
        assert set(origins.values()) <= set(declared)


@pytest.mark.skipif(not has_launch(), reason='no launch here: only the sources were looked at')
@pytest.mark.parametrize('file', FILES, ids=lambda file: file.name)
def test_what_is_started_has_what_was_asked_for(file: Path, tmp_path: Path) -> None:
    packages = tmp_path / 'share' / 'ament_index' / 'resource_index' / 'packages'
    packages.mkdir(parents=True)
    (packages / 'lathe_chatter').touch()
    executables = tmp_path / 'lib' / 'lathe_chatter'
    executables.mkdir(parents=True)
    for path in (*(ROOT / 'scripts' / 'ros2_run').iterdir(), Path('ros2')):
        (executables / path.name).write_text(WRITES_DOWN, encoding='utf-8')
        (executables / path.name).chmod(0o755)
    written = tmp_path / 'written'
    written.mkdir()
    everything = tmp_path / 'all.yaml'
    everything.write_text('/**: {ros__parameters: {}}', encoding='utf-8')
    asked = [
        'namespace:=hall/cell7',
        'use_sim_time:=true',
        f'params_file:={everything}',
        'output:=2026',
    ]
    done = subprocess.run(
        [sys.executable, '-c', LAUNCHER, str(file), *asked, 'run:=2026'],
        cwd=tmp_path,
        env={
            **os.environ,
            'AMENT_PREFIX_PATH': str(tmp_path),
            'PATH': f'{executables}{os.pathsep}{os.environ["PATH"]}',
            'WRITTEN_DOWN': str(written),
        },
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    calls = [path.read_text(encoding='utf-8').splitlines() for path in written.iterdir()]
    started = {}
    for words in calls:
        if words[0].endswith('/ros2'):
            continue
        (namespace,) = (word.removeprefix('__ns:=') for word in words if '__ns:=' in word)
        files = [words[k + 1] for k, word in enumerate(words) if word == '--params-file']
        assert files[0] == str(everything)
        ((name, given),) = yaml.safe_load(Path(files[1]).read_text(encoding='utf-8')).items()
        assert name == f'{namespace}/{Path(words[0]).name}'
        started[name] = given['ros__parameters']
        assert started[name].pop('use_sim_time') is True
    kind = file.name.partition('.')[0]
    assert started == STARTED[kind]
    players = [' '.join(words[1:]) for words in calls if words[0].endswith('/ros2')]
    assert players == ['bag play 2026 --rate 1.0 --topics /hall/cell7/lathe/samples --clock'] * (
        kind == 'replay'
    )
