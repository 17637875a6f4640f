"""Where the page is, as a person is told."""

from __future__ import annotations

import socket
from typing import Any

import pytest

from lathe_chatter.page.server import PageServer


@pytest.mark.parametrize('host', ['0.0.0.0', ''])  # noqa: S104 -- what it is of
def test_on_every_address_the_page_is_named_by_its_machine(host: str) -> None:
    nobody: Any = None
    server = PageServer(nobody, host, 0, 16 * 'x')
    assert server.url == f'http://{socket.gethostname()}:{server.port}/'


def test_on_one_address_the_page_is_named_by_it() -> None:
    nobody: Any = None
    server = PageServer(nobody, '127.0.0.1', 0)
    assert server.url == f'http://127.0.0.1:{server.port}/'
