"""The page of method holds together: its modules, equations and sources are there."""

from __future__ import annotations

import re
from itertools import chain

from support.page_blocks import ROOT

EXPLANATION = ROOT / 'docs' / 'explanation'
METHOD = (EXPLANATION / 'method.md').read_text(encoding='utf-8')


def test_every_module_that_it_names_is_there() -> None:
    package = ROOT / 'lathe_chatter'
    files = [f'/{path.relative_to(package)}' for path in package.rglob('*.py')]
    named = set(re.findall(r'`([\w/]+\.py)`', METHOD))
    assert len(named) > 40
    assert not [name for name in named if not any(path.endswith(f'/{name}') for path in files)]


def test_equations_are_numbered_in_order_and_what_is_referred_to_is_one() -> None:
    assert not re.findall(r'^%.*', METHOD, re.MULTILINE), 'that line would be a comment'
    numbers = [int(number) for number in re.findall(r'\\tag\{M(\d+)\}', METHOD)]
    assert numbers == [*range(1, len(numbers) + 1)]
    pages = (path.read_text(encoding='utf-8') for path in EXPLANATION.glob('*.md'))
    referred = chain.from_iterable(re.findall(r'\(M(\d+)\)', page) for page in pages)
    assert {int(number) for number in referred} <= set(numbers)


def test_every_source_that_is_cited_is_listed_and_the_other_way_round() -> None:
    text, _, listed = METHOD.partition('## Sources')
    sources = set(re.findall(r'^\| \[([^]]+)\]', listed, re.MULTILINE))
    cited = set(re.findall(r'\[([A-Z][A-Za-z]+(?: \d{4})?|paper|MCAP)\](?!\()', text))
    assert cited == sources
