"""The code blocks of a page of the documentation, run in their order as a reader would."""

from __future__ import annotations

import io
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from contextlib import redirect_stdout
from dataclasses import dataclass
from importlib.metadata import distributions, requires
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from lathe_chatter.nodes.node_processes import die_with_parent

ROOT = Path(__file__).resolve().parents[2]
_BLOCK = re.compile(
    r'(?:<!-- (?P<mark>[^\n]*?) -->\n)?^```(?P<kind>[a-z]+)\n(?P<text>.*?)^```$',
    re.DOTALL | re.MULTILINE,
)
_NODE = re.compile(
    r'^(?:ros2 run lathe_chatter )?'
    r'(?=(?:lathe|chatter_monitor|run_recorder|cell|operator_page|chatter_supervisor)(?: |$))'
)
_FILE = 'file: '
"""Begins the mark of a block that is a file of the reader, with its name."""
_TIMEOUT = 280.0
"""s: less than that of the test, so that its failure says which command it was."""


@dataclass(frozen=True)
class Block:
    """One code block: its language, text, and what the comment before it says of it."""

    kind: str
    text: str
    mark: str
    line: int

    @property
    def why_not(self) -> str:
        """Why it is not run; empty where it is."""
        return self.mark.removeprefix('not run: ') if self.mark.startswith('not run: ') else ''

    @property
    def talks_to_ros(self) -> bool:
        """Whether it needs ROS 2."""
        return not self.why_not and ('ros2 ' in self.text or 'import rclpy' in self.text)


def pages() -> list[Path]:
    """Every page that has code."""
    found = [ROOT / 'README.md', *sorted((ROOT / 'docs').rglob('*.md'))]
    return [page for page in found if not {'_made', '_build'} & {*page.parts} and blocks(page)]


def blocks(page: Path) -> list[Block]:
    """The blocks of a page: shell, Python, what it prints, files; MATLAB, which cannot be run."""
    text = page.read_text(encoding='utf-8')
    return [
        Block(
            found['kind'],
            found['text'],
            found['mark'] or '',
            text[: found.start()].count('\n') + 1,
        )
        for found in _BLOCK.finditer(text)
        if found['kind'] in {'sh', 'python', 'matlab'}
        or (found['mark'] or '').startswith((_FILE, 'printed'))
    ]


def packages_lacking(page: Path) -> list[str]:
    """What a page asks for beside the package, as `pip install '.[cluster]'`, and is not here."""
    asked = re.findall(r"pip install '(?:\.|lathe_chatter)\[([\w,]+)\]'", page.read_text('utf-8'))
    extras = [{'extra': extra} for words in asked for extra in words.split(',')]
    optional = [each for each in map(Requirement, requires('lathe_chatter') or ()) if each.marker]
    wanted = {each.name for each in optional if any(map(each.marker.evaluate, extras))}
    here = {canonicalize_name(each.name) for each in distributions()}
    return sorted(name for name in wanted if canonicalize_name(name) not in here)


class Reader:
    """Somebody who types what a page says, in a folder of his own."""

    def __init__(self, folder: Path) -> None:
        """Nothing typed yet."""
        self.folder = folder
        self._names: dict[str, Any] = {'__name__': '__main__'}
        self._printed = ''
        self._nodes: list[subprocess.Popen[bytes]] = []

    def run(self, block: Block) -> None:
        """Do one block; an error is the test's."""
        if block.mark == 'ends the nodes':
            self.end()
        if block.mark.startswith(_FILE):
            (self.folder / block.mark.removeprefix(_FILE)).write_text(block.text)
            return
        if block.kind == 'python' and block.talks_to_ros:
            self._check([sys.executable, '-c', block.text], block.text)
            return
        if block.mark == 'printed':
            assert block.text == self._printed
            return
        if block.kind == 'python':
            with redirect_stdout(io.StringIO()) as said:
                exec(compile(block.text, '<page>', 'exec'), self._names)  # noqa: S102 -- our own
            self._printed = said.getvalue()
            return
        commands = re.sub(r'\\\n\s*', '', block.text).splitlines()
        for command in (line for line in commands if line.strip() and not line.startswith('#')):
            self._type(command, fails=block.mark == 'fails')

    def end(self) -> None:
        """End the nodes as Ctrl-C would."""
        ended, self._nodes = self._nodes, []
        for node in ended:
            node.send_signal(signal.SIGINT)
        try:
            assert [node.wait(60.0) for node in ended] == [0] * len(ended)
        finally:
            for node in ended:
                node.kill()

    def _type(self, command: str, *, fails: bool) -> None:
        if _NODE.match(command):
            words = shlex.split(_NODE.sub('', command))
            node = subprocess.Popen(
                words,
                cwd=self.folder,
                env=_environment(),
                preexec_fn=die_with_parent,  # noqa: PLW1509 -- only the main thread starts any
            )
            self._nodes.append(node)
            return
        if shutil.which('ros2') is None and command.startswith('ros2 '):
            command = f'{shlex.quote(sys.executable)} -m support.ros2_commands {command[5:]}'
        self._check(['bash', '-c', command], command, fails=fails)

    def _check(self, words: list[str], typed: str, *, fails: bool = False) -> None:
        done = subprocess.run(
            words,
            cwd=self.folder,
            env=_environment(),
            check=False,
            capture_output=True,
            text=True,
            timeout=_TIMEOUT,
        )
        said = f'{typed}\n{done.stdout}{done.stderr}'
        assert 'Traceback' not in said, said
        assert (done.returncode != 0) == fails, said


def _environment() -> dict[str, str]:
    paths = [str(Path(sys.executable).parent), os.environ['PATH']]
    return {
        **os.environ,
        'PATH': os.pathsep.join(paths),
        'MPLBACKEND': 'Agg',
        'PYTHONPATH': str(ROOT / 'tests'),
    }
