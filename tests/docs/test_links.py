"""Every page of the documentation is found by a reader, not only by its table of contents."""

from __future__ import annotations

import os
import re
from pathlib import Path

from support.page_blocks import ROOT

DOCS = ROOT / 'docs'
MADE = {'_build', 'auto_examples', '_made'}
"""Folders of what `make docs` leaves."""
CONTENTS = re.compile(r'```\{toctree\}.*?```', re.DOTALL)


def sources() -> list[Path]:
    files = (file for kind in ('md', 'ipynb') for file in DOCS.rglob(f'*.{kind}'))
    return [file for file in files if not MADE & {*file.relative_to(DOCS).parts}]


def test_every_page_is_linked_from_the_text_of_another() -> None:
    linked = set()
    for page in sources():
        text = CONTENTS.sub('', page.read_text(encoding='utf-8'))
        for target in re.findall(r'\]\(([^)#\s]+)', text):
            linked.add(Path(os.path.normpath(page.parent / target)))
    alone = {page for page in sources() if page not in linked} - {DOCS / 'index.md'}
    assert not alone, 'a reader finds them in the table of contents alone'


def test_a_page_stands_under_the_caption_of_its_folder() -> None:
    text = (DOCS / 'index.md').read_text(encoding='utf-8')
    captions = {'how_to': 'How to', 'tutorials': 'Tutorials', 'reference': 'Reference'}
    for contents in CONTENTS.findall(text):
        caption = re.search(r':caption: (.*)', contents)
        for folder in re.findall(r'^(\w+)/', contents, re.MULTILINE):
            assert caption is not None
            assert captions.get(folder, caption[1]) == caption[1], contents
