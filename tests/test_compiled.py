"""Where machine code is kept, and that nothing is done before it is needed."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from lathe_chatter.compiled import _bases, _cache_folder, before_compiling, compiled
from lathe_chatter.precompile import precompile

WATCH = """
import os
made = []
import sys
sys.addaudithook(lambda name, arguments: made.append(arguments) if name == 'os.mkdir' else None)
"""


def run(program: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, '-c', program],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_an_import_makes_no_folder(tmp_path: Path) -> None:
    modules = 'lathe_chatter.lathe, lathe_chatter.detection, lathe_chatter.cli.main'
    done = run(
        f'{WATCH}\nimport {modules}\nassert not made, made', NUMBA_CACHE_DIR=str(tmp_path / 'new')
    )
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / 'new').exists()


def test_each_version_of_numba_keeps_its_own_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two environments with one folder each start would compile what the other had kept."""
    monkeypatch.setattr(numba.config, 'CACHE_DIR', str(tmp_path / 'cache'))
    folders = set()
    for version in ('0.59.0', '0.68.1', '0.68.1'):
        monkeypatch.setattr(numba, '__version__', version)
        folders.add(_cache_folder.__wrapped__(tmp_path))
    assert len(folders) == 2


def test_a_cache_that_cannot_be_written_is_made_elsewhere(tmp_path: Path) -> None:
    """Here a file stands where the folder should be, which stops root too."""
    obstacle = tmp_path / 'file'
    obstacle.write_text('')
    program = 'from lathe_chatter.compiled import _bases; print(*_bases(), sep="\\n")'
    environment = {name: str(obstacle) for name in ('NUMBA_CACHE_DIR', 'XDG_CACHE_HOME')}
    done = run(program, TMPDIR=str(tmp_path), **environment)
    *_, last = done.stdout.splitlines()
    assert last == str(tmp_path / f'lathe_chatter-{os.getuid()}')
    assert stat.S_IMODE(Path(last).stat().st_mode) == 0o700
    small = (
        'import os\nfrom lathe_chatter.lathe.integrator.random_numbers import standard_normal\n'
        'print(standard_normal(0, 0, 0))'
    )
    done = run(small, TMPDIR=str(tmp_path), **environment)
    assert done.returncode == 0, done.stderr
    assert list(Path(last).rglob('*.nbi'))


@pytest.mark.parametrize('kind', ['open to others', 'a link', 'of another user'])
def test_a_cache_that_others_could_write_is_not_used(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr('tempfile.tempdir', str(tmp_path))
    folder = tmp_path / f'lathe_chatter-{os.getuid()}'
    if kind == 'a link':
        (tmp_path / 'theirs').mkdir()
        folder.symlink_to(tmp_path / 'theirs')
    else:
        folder.mkdir(mode=0o700)
        if kind == 'open to others':
            folder.chmod(0o777)
        elif os.getuid() == 0:
            os.chown(folder, 65534, 65534)
        else:
            pytest.skip('only root can make a folder of another user')
    assert folder not in list(_bases())


def test_an_inner_function_refuses_a_call_from_python() -> None:
    @compiled(inner=True)
    def twice(value: float) -> float:
        return 2.0 * value

    with pytest.raises(TypeError, match='twice is called by compiled functions only'):
        twice(1.0)


def test_compiling_is_said_before_and_once() -> None:
    twice, said = numba.njit(lambda number: 2 * number), list[int]()
    for _ in range(2):
        with before_compiling(lambda: said.append(len(twice.overloads))):
            assert twice(1) + twice(0.5) == 3.0
    assert said == [0]


def test_what_is_compiled_is_said_nothing_of() -> None:
    precompile()
    said: list[str] = []
    precompile(say=said.append)
    assert not said


def test_a_run_and_its_picture_compile_nothing_that_was_not_compiled_before(
    tmp_path: Path,
) -> None:
    """Whether from a cache or not: what `precompile` has not called is called here first."""
    program = f"""
import gc
from numba.core.registry import CPUDispatcher
from lathe_chatter.cli.main import main
from lathe_chatter.precompile import precompile

def entered():
    found = [each for each in gc.get_objects() if isinstance(each, CPUDispatcher)]
    return {{(each.__name__, str(kind)) for each in found for kind in each.overloads}}

precompile()
before = entered()
assert main(['simulate', '--scenario', 'clearance', '--output', {str(tmp_path / 'run')!r}]) == 0
assert main(['report', {str(tmp_path / 'run')!r}]) == 0
assert before and entered() == before, entered() - before
"""
    done = run(program)
    assert done.returncode == 0, done.stderr
