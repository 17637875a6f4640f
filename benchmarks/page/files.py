"""How large the page is: what a browser loads, what its libraries take, and its source."""

from __future__ import annotations

import gzip
import re
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

from lathe_chatter.page import server

STATIC = Path(server.__file__).with_name('static')
PACKAGE = STATIC.parents[1]
_LIBRARIES = ('starlette', 'uvicorn', 'websockets')


def sizes() -> Iterator[str]:
    """Bytes that a browser gets, and those that are installed for it."""
    loaded = [file for file in STATIC.iterdir() if file.suffix in {'.html', '.css', '.js', '.svg'}]
    compressed = sum(len(gzip.compress(file.read_bytes())) for file in loaded)
    yield f'page, all files: {compressed / 1e3:.0f} kB compressed'
    names = _with_needs(set(_LIBRARIES), set())
    bytes_ = {name: _size_of(name) for name in sorted(names)}
    own = sum(file.stat().st_size for file in STATIC.parent.rglob('*') if file.is_file())
    listed = ', '.join(f'{name} {size / 1e6:.1f}' for name, size in bytes_.items())
    total = (sum(bytes_.values()) + own) / 1e6
    yield f'installed: {total:.1f} MB ({listed}, page {own / 1e6:.1f})'


def _with_needs(wanted: set[str], found: set[str]) -> set[str]:
    """Packages and what they need, without extras."""
    for name in wanted - found:
        found.add(name)
        needed = metadata.requires(name) or []
        plain = [re.match(r'[\w.-]+', each) for each in needed if 'extra ==' not in each]
        names = {each[0].lower().replace('_', '-') for each in plain if each is not None}
        _with_needs({each for each in names if _is_installed(each)}, found)
    return found


def _is_installed(name: str) -> bool:
    try:
        metadata.distribution(name)
    except metadata.PackageNotFoundError:
        return False
    return True


def _size_of(name: str) -> int:
    """Bytes of the files of a package."""
    places = [Path(str(file.locate())) for file in metadata.files(name) or []]
    return sum(place.stat().st_size for place in places if place.is_file())


def lines() -> Iterator[str]:
    """Lines of source."""
    nodes = PACKAGE.glob('nodes/operator_page*.py')
    python = [*STATIC.parent.glob('*.py'), *nodes, PACKAGE / 'cli' / 'page.py']
    scripts = [STATIC / f'{name}.js' for name in ('page', 'draw', 'recorded')]
    for kind, places in (('Python', python), ('JavaScript', scripts)):
        count = sum(len(place.read_text().splitlines()) for place in places)
        yield f'{count} lines of {kind} in {len(places)} files'
