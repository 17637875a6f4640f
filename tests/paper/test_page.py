"""The page needs no other file, and its pictures are whole."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree as ET

from lathe_chatter.paper import PAPER_RUNS, find, reproduce_run
from lathe_chatter.paper.figures import draw_paper_picture, paper_pictures
from lathe_chatter.paper.page import write_page


class _Page(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.sources: list[str] = []
        self.names: set[str] = set()
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or '' for name, value in attrs}
        if tag == 'img':
            self.sources.append(values['src'])
        elif tag == 'a':
            self.links.append(values['href'].removeprefix('#'))
        if 'id' in values:
            self.names.add(values['id'])


def test_pictures_stand_within_the_page(tmp_path: Path) -> None:
    chosen = [p for p in paper_pictures() if p.name in {'fig07', 'fig13'}]
    for picture in chosen:
        draw_paper_picture(picture.name, tmp_path)
        assert ET.parse(tmp_path / f'{picture.name}.svg').getroot().tag.endswith('svg')
        assert (tmp_path / f'{picture.name}.png').read_bytes().startswith(b'\x89PNG')
    results = [reproduce_run(run) for run in PAPER_RUNS[:5]]
    text = write_page(tmp_path, results, find(), chosen).read_text(encoding='utf-8')
    page = _Page()
    page.feed(text)
    assert len(page.sources) == len(chosen)
    assert all(source.startswith('data:image/svg+xml;base64,') for source in page.sources)
    assert set(page.links) == {p.name for p in chosen} <= page.names
    assert 'http' not in text
    words = ' '.join(text.split())
    assert 'from 119.8 to 123.2 ms' in words
    assert 'holds 20, the second 19' in words
    assert 'excludes neither' in words
    assert 'dde23' in words
    assert 'Only with the screening' not in words
    for result in results:
        assert f'{result.root.real:+.6f}' in text
        assert result.run.title in text


def test_the_same_picture_is_the_same_bytes(tmp_path: Path) -> None:
    for folder in ('a', 'b'):
        (tmp_path / folder).mkdir()
        draw_paper_picture('fig09', tmp_path / folder)
    for kind in ('png', 'svg'):
        first, second = ((tmp_path / f / f'fig09.{kind}').read_bytes() for f in ('a', 'b'))
        assert first == second


def test_every_table_and_figure_with_a_simulation_is_there() -> None:
    places = {picture.place for picture in paper_pictures()}
    named = {place for run in PAPER_RUNS for place in run.places}
    assert places == named
