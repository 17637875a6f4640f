"""Every code block of the documentation is run, in the order in which a reader meets it."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.page_blocks import ROOT, Reader, blocks, packages_lacking, pages

WITHOUT_ROS = [page for page in pages() if not any(block.talks_to_ros for block in blocks(page))]


@pytest.mark.parametrize('page', WITHOUT_ROS, ids=lambda page: str(page.relative_to(ROOT)))
def test_what_a_page_says_can_be_typed(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if lacking := packages_lacking(page):
        pytest.skip(f'not installed: {", ".join(lacking)}')
    monkeypatch.setenv('MPLBACKEND', 'Agg')
    monkeypatch.chdir(tmp_path)
    reader = Reader(tmp_path)
    left_out = []
    for block in blocks(page):
        if block.why_not:
            left_out.append(f'line {block.line}: {block.why_not}')
        else:
            reader.run(block)
    if len(left_out) == len(blocks(page)):
        pytest.skip('; '.join(left_out))
