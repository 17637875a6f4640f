"""A flood of sentences is a few lines and a count, and nothing goes untold."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

import lathe_chatter.nodes
from lathe_chatter.nodes.log_rate_limit import BURST, MAX_KINDS, PERIOD, BoundedLog, QuickLog


class Lines(QuickLog):
    """Where a log goes, with the time that it is."""

    def __init__(self) -> None:
        super().__init__(None)
        self.lines: list[tuple[str, str]] = []
        self.time = 100.0

    def log(self, severity: Any, sentence: str) -> None:
        self.lines.append((severity.name, sentence))

    def now(self) -> float:
        return self.time


def flooded(seconds: int, rate: int) -> tuple[Lines, int]:
    """A log into which one kind of sentence was poured, and how often."""
    out = Lines()
    bounded = BoundedLog(out, out.now)
    for k in range(seconds * rate):
        out.time += 1.0 / rate
        bounded.warning(f'{k} samples are missing.', 'missing')
    out.time += PERIOD
    bounded.look()
    return out, seconds * rate


def test_a_flood_is_a_burst_and_then_one_line_a_period_that_counts_the_rest() -> None:
    out, poured = flooded(seconds=100, rate=1000)
    assert len(out.lines) <= BURST + 100 / PERIOD + 1
    counts = [int(m[1]) for _, t in out.lines if (m := re.search(r'\((\d+) of this kind', t))]
    assert BURST + sum(counts) == poured


def test_the_last_word_of_a_flood_is_told() -> None:
    out, poured = flooded(seconds=3, rate=100)
    assert out.lines[-1][0] == 'WARN'
    assert out.lines[-1][1].startswith(f'{poured - 1} samples are missing. (')


def test_kinds_do_not_hold_each_other_back() -> None:
    out = Lines()
    bounded = BoundedLog(out, out.now)
    for _ in range(100):
        bounded.info('the same')
    bounded.error('another')
    assert out.lines == [('INFO', 'the same')] * BURST + [('ERROR', 'another')]


def test_after_a_quiet_period_a_kind_begins_anew() -> None:
    out = Lines()
    bounded = BoundedLog(out, out.now)
    for k in range(20):
        out.time += PERIOD
        bounded.info(f'At {k} s.', 'time')
    assert len(out.lines) == 20


def test_names_without_end_are_one_kind_beyond_a_bound() -> None:
    out = Lines()
    bounded = BoundedLog(out, out.now)
    for k in range(10 * MAX_KINDS):
        bounded.info(f'topic {k}')
    assert len(out.lines) == MAX_KINDS + BURST


def test_what_is_held_back_when_the_node_ends_is_told() -> None:
    out = Lines()
    bounded = BoundedLog(out, out.now)
    for k in range(BURST + 3):
        bounded.warning(f'{k} samples are missing.', 'missing')
    bounded.end()
    assert out.lines[-1][1] == f'{BURST + 2} samples are missing. (3 of this kind in 0 s.)'
    bounded.end()
    assert len(out.lines) == BURST + 1


def test_a_sentence_is_bounded_too_whatever_others_sent() -> None:
    out = Lines()
    bounded = BoundedLog(out, out.now)
    for _ in range(BURST + 1):
        bounded.warning('x' * 1_000_000, 'sent')
    bounded.end()
    assert len(out.lines) == BURST + 1
    assert max(len(text) for _, text in out.lines) < 3000


def test_no_node_logs_past_its_bounds() -> None:
    """But for the record of a cut, which its ticks bound and `LatheRecord` keeps."""
    folder = Path(lathe_chatter.nodes.__file__).parent
    for file in folder.glob('*.py'):
        tree = ast.parse(file.read_text(encoding='utf-8'))
        calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
        allowed = {id(arg) for call in calls for arg in call.args if named(call) == 'QuickLog'}
        asked = [call for call in calls if named(call) == 'get_logger' and id(call) not in allowed]
        places = [f'{file.name}:{call.lineno}' for call in asked]
        # Before there is a node there is the line that a file of parameters reaches nobody.
        assert len(places) == (file.name == 'node_main.py'), places


def named(call: ast.Call) -> str:
    function = call.func
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, 'id', '')
