from __future__ import annotations

import pytest
from support.recorded import topic

from lathe_chatter.recording import Topic


@pytest.fixture
def numbers() -> Topic:
    return topic('/numbers')
