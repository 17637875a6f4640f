from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def no_width(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is printed does not depend on the terminal of whoever runs the tests."""
    monkeypatch.delenv('COLUMNS', raising=False)
