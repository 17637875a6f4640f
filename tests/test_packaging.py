"""The package installs by pip and by colcon, and `ros2 run` finds its executables either way."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

import lathe_chatter

ROOT = Path(__file__).resolve().parents[1]
EXECUTABLES = {'lathe', 'chatter_monitor', 'run_recorder', 'cell', 'lathe-chatter'}
SOURCES = ('setup.py', 'setup.cfg', 'package.xml', 'pyproject.toml', 'resource', 'config')


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


def test_package_xml_is_valid_and_agrees_on_the_version() -> None:
    root = ET.parse(ROOT / 'package.xml').getroot()
    assert root.attrib['format'] == '3'
    assert root.findtext('name') == 'lathe_chatter'
    assert root.findtext('export/build_type') == 'ament_python'
    shown = run([sys.executable, 'setup.py', '--version'], cwd=ROOT).stdout.split()[-1]
    assert root.findtext('version') == shown == lathe_chatter.__version__


def test_changelog_has_the_version() -> None:
    assert f'\n{lathe_chatter.__version__} (' in (ROOT / 'CHANGELOG.rst').read_text()


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
    installed = next(prefix.glob('l*/python3*/site-packages'))
    started = start_wrong(
        folder / 'lathe', PYTHONPATH=os.pathsep.join([str(installed), *sys.path])
    )
    assert 'depth_of_cut' in started.stderr
    assert 'Traceback' not in started.stderr
    assert started.returncode == 2
