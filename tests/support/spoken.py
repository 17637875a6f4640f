"""What modules can say, read from their code; tables of when that is true, and what shows it."""

from __future__ import annotations

import ast
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

TESTS = Path(__file__).parents[1]
Said = Mapping[str, Mapping[str, tuple[str, str]]]
"""By module, each sentence with what must be true when it is said, and the test that shows it."""


def sentences(module: Path, no_sentence: Collection[str] = ()) -> Iterator[str]:
    """The texts with a space in a module, its docstrings aside; `{}` for what is filled in."""
    tree = ast.parse(module.read_text())
    aside: set[ast.AST] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            aside.add(node.value)
        if isinstance(node, ast.JoinedStr):
            aside.update(part for part in ast.walk(node) if part is not node)
    for node in ast.walk(tree):
        text = ''
        if isinstance(node, ast.JoinedStr):
            parts = node.values
            text = ''.join(str(p.value) if isinstance(p, ast.Constant) else '{}' for p in parts)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            text = node.value
        if node not in aside and ' ' in text.strip() and text not in no_sentence:
            yield text


def unshown(said: Said, module: str) -> list[str]:
    """The sentences of a module without a condition, or whose test is not there."""
    found = []
    for sentence, (holds, test) in said[module].items():
        file, _, name = test.partition('::')
        tree = ast.parse((TESTS / file).read_text())
        names = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        if not holds or name not in names:
            found.append(f'{sentence}: no {test}')
    return found
