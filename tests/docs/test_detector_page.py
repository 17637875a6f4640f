"""The page on the detector, against what the detector can say."""

from __future__ import annotations

from pathlib import Path

import pytest

from lathe_chatter.detection.channel_watch import CAUSES

PAGE = Path(__file__).parents[2] / 'docs' / 'explanation' / 'detector.md'


@pytest.mark.parametrize('words', CAUSES.values())
def test_each_kind_of_fault_of_a_sensor_is_described(words: str) -> None:
    assert words in ' '.join(PAGE.read_text(encoding='utf-8').split())
