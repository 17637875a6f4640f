"""The texts of the operator's page, read from its scripts and its HTML."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

_CODE = re.compile(r"//[^\n]*|'((?:\\.|[^'\\])*)'|[`{}]")
_TEMPLATE = re.compile(r'((?:\\.|[^`\\$]|\$(?!\{))*)(`|\$\{)', re.DOTALL)
_READ_ALOUD = {'aria-label', 'title', 'alt', 'placeholder', 'aria-valuetext'}


def texts(file: Path) -> set[str]:
    """The texts in a script, `{}` for what is filled in, or those that HTML shows and reads."""
    source = file.read_text(encoding='utf-8')
    if file.suffix == '.js':
        return set(_of_script(source))
    parser = _Shown()
    parser.feed(source)
    return parser.found


def _of_script(source: str) -> Iterator[str]:
    place = 0
    inside: list[str | None] = []  # templates as far as read; None for a brace of code
    while True:
        template = inside[-1] if inside else None
        found = (_CODE.search if template is None else _TEMPLATE.match)(source, place)
        if found is None:
            assert not inside
            return
        place = found.end()
        if template is not None:
            inside[-1] = template + found[1] + ('{}' if found[2] == '${' else '')
            if found[2] == '`':
                yield str(inside.pop())
            else:
                inside.append(None)
        elif found[0] in {'`', '{'}:
            inside.append('' if found[0] == '`' else None)
        elif found[0] == '}':
            inside.pop()
        elif found[1] is not None:
            yield found[1]


class _Shown(HTMLParser):
    """Collects texts, and attributes that are read aloud or shown beside the pointer."""

    def __init__(self) -> None:
        super().__init__()
        self.found: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:  # noqa: ARG002
        self.found |= {str(value) for name, value in attrs if name in _READ_ALOUD}

    def handle_data(self, data: str) -> None:
        self.found |= {data.strip()} - {''}
