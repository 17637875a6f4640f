from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True, scope='session')
def no_width() -> Iterator[None]:
    """What is printed does not depend on the terminal of whoever runs the tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv('COLUMNS', raising=False)
        yield
