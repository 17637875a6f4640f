"""The pages of the documentation that talk to ROS, typed as a reader would."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from support.page_blocks import ROOT, Reader, blocks, pages

WITH_ROS = [page for page in pages() if any(block.talks_to_ros for block in blocks(page))]


@pytest.mark.parametrize('page', WITH_ROS, ids=lambda page: str(page.relative_to(ROOT)))
def test_what_a_page_says_can_be_typed(
    page: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    domain: int,
    compiled: None,  # noqa: ARG001
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(os.environ, 'ROS_DOMAIN_ID', str(domain))
    reader = Reader(tmp_path)
    try:
        for block in blocks(page):
            if not block.why_not:
                reader.run(block)
    finally:
        reader.end()
