"""The package installs by pip and by colcon, and `ros2 run` finds its executables either way."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import tarfile
from importlib.metadata import packages_distributions, requires
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from packaging.requirements import Requirement

import lathe_chatter

ROOT = Path(__file__).resolve().parents[1]
EXECUTABLES = {
    *('lathe', 'chatter_monitor', 'run_recorder', 'chatter_supervisor'),
    'operator_page',
    *('cell', 'lathe-chatter'),
}
PART_OF = {'llvmlite': 'numba'}
"""What comes with another package, which names the version that it needs."""
OPTIONAL_IN_ROS = {'simulation_interfaces'}
"""Used where they are; no machine needs them."""
NAMED_OTHERWISE = {'sdypy': 'sdypy-EMA'}
"""A package that Python 3.10 does not know the distribution of."""
SOURCES = (
    'setup.py',
    'setup.cfg',
    'package.xml',
    'pyproject.toml',
    'README.md',
    'resource',
    'config',
)


def run(command: list[str], **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A copy of what is built, so that no build leaves anything in the checkout."""
    copy = tmp_path / 'src' / 'lathe_chatter'
    ignored = shutil.ignore_patterns('__pycache__')
    for name in (*SOURCES, 'lathe_chatter', 'scripts'):
        source = ROOT / name
        copier = shutil.copytree if source.is_dir() else shutil.copy2
        copy.mkdir(parents=True, exist_ok=True)
        options = {'ignore': ignored} if source.is_dir() else {}
        copier(source, copy / name, **options)
    return copy


def test_package_xml_is_valid_and_every_version_is_its() -> None:
    root = ET.parse(ROOT / 'package.xml').getroot()
    assert root.attrib['format'] == '3'
    assert root.findtext('name') == 'lathe_chatter'
    assert root.findtext('export/build_type') == 'ament_python'
    shown = run([sys.executable, 'setup.py', '--version'], cwd=ROOT).stdout.split()[-1]
    assert root.findtext('version') == shown == lathe_chatter.__version__


def test_the_newest_section_of_the_changelog_is_as_catkin_and_bloom_expect() -> None:
    """`Forthcoming`, which catkin_prepare_release renames, or the version with its date."""
    text = (ROOT / 'CHANGELOG.rst').read_text()
    version = re.escape(lathe_chatter.__version__)
    first = re.search(r'^(.+)\n-+\n\* ', text, re.MULTILINE)
    assert first is not None
    assert re.fullmatch(rf'Forthcoming|{version} \(\d{{4}}-\d\d-\d\d\)', first[1])


def imported_packages() -> set[str]:
    """Top-level names that any module of the package imports, but for Python's and its own."""
    names = set()
    for file in (ROOT / 'lathe_chatter').rglob('*.py'):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                names |= {alias.name.partition('.')[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                names.add(node.module.partition('.')[0])
    return names - sys.stdlib_module_names - {'lathe_chatter'}


def declared_in_setup() -> dict[str, bool]:
    """The distributions that the package asks for, and whether each is optional."""
    return {
        re.split(r'[^\w-]', text)[0].lower().replace('_', '-'): 'extra ==' in text
        for text in requires('lathe_chatter') or ()
    }


def test_every_import_is_declared_in_setup_and_in_package_xml() -> None:
    root = ET.parse(ROOT / 'package.xml').getroot()
    keys = {element.text or '' for element in root.iter('exec_depend')}
    for_rosdep = {key.removeprefix('python3-').removesuffix('-pip') for key in keys}
    in_setup = declared_in_setup()
    providers = packages_distributions()
    lacking = []
    for name in {PART_OF.get(name, name) for name in imported_packages() - OPTIONAL_IN_ROS}:
        if name in keys:  # a package of ROS 2, which the package index has no name for
            continue
        found = {
            each.lower().replace('_', '-')
            for each in providers.get(name, [NAMED_OTHERWISE.get(name, name)])
        }
        optional = any(in_setup.get(each) for each in found)
        if not found & in_setup.keys():
            lacking.append(f'{name} in setup.py')
        if name not in for_rosdep and not optional:
            lacking.append(f'{name} in package.xml')
    assert not lacking


@pytest.mark.parametrize('lock', ['jazzy', 'kilted', 'test', 'lint'])
def test_the_lock_has_all_that_setup_asks_for(lock: str) -> None:
    text = (ROOT / 'requirements' / f'{lock}.txt').read_text()
    locked = dict(re.findall(r'^([\w.-]+?)(?:\[\w+\])?==([\w.]+)', text, re.MULTILINE))
    for line in requires('lathe_chatter') or ():
        wanted = Requirement(line)
        if wanted.marker is None:
            assert wanted.specifier.contains(locked[wanted.name.lower()]), line
    assert '://' not in text, 'a lock names no place to fetch from'


def test_the_distributions_are_fit_for_the_index_and_the_sources_are_whole(
    tmp_path: Path,
) -> None:
    if not (ROOT / '.git').exists():
        pytest.skip('not a checkout: git tells which files are its sources')
    listed = run(['git', 'ls-files'], cwd=ROOT)
    if listed.returncode:
        pytest.skip(f'git does not tell which files are sources: {listed.stderr.strip()}')
    tracked = set(listed.stdout.splitlines())
    copy = tmp_path / 'copy'
    for name in tracked:
        target = copy / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if (ROOT / name).exists():
            shutil.copy2(ROOT / name, target)
    output = tmp_path / 'dist'
    built = run([sys.executable, '-m', 'build', '--no-isolation', '-o', str(output)], cwd=copy)
    assert built.returncode == 0, built.stdout + built.stderr
    files = [str(file) for file in output.iterdir()]
    checked = run([sys.executable, '-m', 'twine', 'check', '--strict', *files])
    assert checked.returncode == 0, checked.stdout
    archive = next(output.glob('*.tar.gz'))
    with tarfile.open(archive) as sources:
        packed = {name.partition('/')[2] for name in sources.getnames()}
    lacking = sorted(tracked - packed)
    assert not lacking


def start_wrong(executable: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Start a node as `ros2 run` does, by its path, with a value that it must refuse."""
    pytest.importorskip('rclpy', reason='ROS 2 is not there')
    return run(
        [str(executable), '--ros-args', '-p', 'depth_of_cut:=.nan'],
        env={**os.environ, **environment},
        timeout=120,
    )


def test_ros2_run_finds_the_executables_after_pip_install(sources: Path, tmp_path: Path) -> None:
    index = pytest.importorskip('ament_index_python.packages', reason='ROS 2 is not there')
    prefix = tmp_path / 'prefix'
    # Without --ignore-installed pip would remove the package from this very environment.
    options = ['--no-deps', '--no-build-isolation', '--ignore-installed', '--prefix', str(prefix)]
    done = run([sys.executable, '-m', 'pip', 'install', *options, str(sources)])
    assert done.returncode == 0, done.stderr
    before = os.environ.get('AMENT_PREFIX_PATH', '')
    os.environ['AMENT_PREFIX_PATH'] = str(prefix)
    try:
        folder = Path(index.get_package_prefix('lathe_chatter'), 'lib', 'lathe_chatter')
    finally:
        os.environ['AMENT_PREFIX_PATH'] = before
    assert {file.name for file in folder.iterdir() if os.access(file, os.X_OK)} >= EXECUTABLES
    installed = next(prefix.glob('l*/python3*/site-packages'))
    started = start_wrong(
        folder / 'lathe',
        PYTHONPATH=os.pathsep.join([str(installed), *sys.path]),
        PATH=os.pathsep.join([str(Path(sys.executable).parent), os.environ['PATH']]),
    )
    assert 'depth_of_cut' in started.stderr
    assert 'Traceback' not in started.stderr
    assert started.returncode == 2
    without = "import sys; sys.modules['rclpy'] = None"
    start = 'from lathe_chatter.nodes.entry_points import lathe; lathe()'
    missing = run(
        [sys.executable, '-c', f'{without}; {start}'], cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': str(installed)},
    )  # fmt: skip
    assert missing.stderr.endswith('source an installation.\n'), 'it has no Makefile'


def test_ros2_run_finds_the_executables_after_colcon_build(sources: Path) -> None:
    colcon = Path(sys.executable).with_name('colcon')
    if not colcon.exists():
        found = shutil.which('colcon')
        if found is None:
            pytest.skip('colcon is not there')
        colcon = Path(found)
    workspace = sources.parents[1]
    done = run([str(colcon), 'build', '--event-handlers', 'console_direct+'], cwd=workspace)
    assert done.returncode == 0, done.stdout + done.stderr
    prefix = workspace / 'install' / 'lathe_chatter'
    folder = prefix / 'lib' / 'lathe_chatter'
    assert {file.name for file in folder.iterdir() if os.access(file, os.X_OK)} >= EXECUTABLES
    assert (prefix / 'share/ament_index/resource_index/packages/lathe_chatter').is_file()
    assert (prefix / 'share/lathe_chatter/package.xml').is_file()
    assert (prefix / 'share/lathe_chatter/config/scenarios/clearance.yaml').is_file()
    for name in ('foxglove.json', 'plotjuggler.xml'):
        assert (prefix / 'share/lathe_chatter/config/layouts' / name).is_file()
    if ' ' in sys.executable:
        pytest.skip('setuptools writes scripts that do not start by a path with a space')
    installed = next(prefix.glob('l*/python3*/site-packages'))
    started = start_wrong(
        folder / 'lathe', PYTHONPATH=os.pathsep.join([str(installed), *sys.path])
    )
    assert 'depth_of_cut' in started.stderr
    assert 'Traceback' not in started.stderr
    assert started.returncode == 2
