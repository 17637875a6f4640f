"""Where the page is, as a person is told, and what it answers to whom, over real sockets."""

from __future__ import annotations

import asyncio
import http.client
import json
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import Any

import pytest
from support.page_cell import PATIENCE, header_of
from support.served_page import serving
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from lathe_chatter.errors import StartError
from lathe_chatter.page.server import PageServer, Viewer

TOKEN = 'a tökén of a test'  # noqa: S105 -- none of a secret


class Source:
    """Has nothing to show, and does what it is told once it may go on."""

    def __init__(self) -> None:
        self.goes_on = asyncio.Event()

    def frame(self, viewer: Viewer) -> tuple[dict[str, Any], dict[str, Any]]:  # noqa: ARG002
        return {}, {}

    async def look(self, viewer: Viewer, wish: Mapping[str, Any]) -> bool:  # noqa: ARG002
        return False

    async def act(self, viewer: Viewer, wish: Mapping[str, Any]) -> str:  # noqa: ARG002
        if wish['do'] == 'wait':
            await self.goes_on.wait()
        if wish['do'] == 'burst':
            raise SystemError  # as a message of ROS of 2 ** 70
        return f'Did {wish["what"]}.'


class Somebody:
    """Somebody with the page open."""

    def __init__(self, url: str) -> None:
        feed, origin = url.replace('http', 'ws') + 'feed', url.rstrip('/')
        self.socket = connect(feed, origin=origin, proxy=None, max_size=None)
        self.told: list[dict[str, Any]] = []

    def look(self) -> dict[str, Any]:
        """A frame, whose answers are kept."""
        self.socket.send('{"do": "next"}')
        header = header_of(self.socket.recv(timeout=PATIENCE))
        self.told += header.get('answers', [])
        return header

    def ask(self, **wish: Any) -> tuple[bool, str]:
        self.socket.send(json.dumps({**wish, 'id': (number := len(self.told) + 1000)}))
        while not (found := [each for each in self.told if each.get('id') == number]):
            self.look()
        return found[0]['ok'], found[0]['text']

    def sent_away(self) -> str:
        """The reason for which it is."""
        with suppress(ConnectionClosed):
            while True:
                self.socket.recv(timeout=PATIENCE)
        return str(self.socket.close_reason)


@pytest.fixture
def come(request: pytest.FixtureRequest) -> Iterator[Callable[[], Somebody]]:
    """A page on this machine, which wants the token that a test gives, and people who come."""
    source, people = Source(), list[Somebody]()
    server = PageServer(source, '127.0.0.1', 0, getattr(request, 'param', ''))

    def come() -> Somebody:
        people.append(Somebody(server.url))
        return people[-1]

    with serving(server) as loop:
        yield come
        loop.call_soon_threadsafe(source.goes_on.set)
        for each in people:
            each.socket.close()


@pytest.mark.parametrize(
    ('host', 'token', 'said'),
    [
        ('127.0.0.1', 'short', 'token has 5 characters: it must have 16 or more.'),
        (
            'elsewhere',
            '',
            'host elsewhere may let other machines in: give a token of 16 characters or more, ',
        ),
        ('a..b', TOKEN, 'port 0 of a..b cannot be had: '),
        ('192.0.2.1', TOKEN, 'port 0 of 192.0.2.1 cannot be had: Cannot assign requested address'),
    ],
)
def test_a_page_that_cannot_be_served_says_why(host: str, token: str, said: str) -> None:
    nobody: Any = None
    with pytest.raises(StartError) as refused:
        PageServer(nobody, host, 0, token)
    assert str(refused.value).startswith(said)


def test_the_page_is_there_under_the_name_that_it_was_given_and_no_foreign_one() -> None:
    server = PageServer(Source(), '127.1', 0, TOKEN)  # 127.0.0.1, as resolvers of names have it
    with serving(server):
        for host, status in ((server.url.split('/')[2], 200), ('elsewhere.example', 403)):
            asked = http.client.HTTPConnection('127.0.0.1', server.port)
            asked.request('GET', '/', headers={'Host': host})
            answer = asked.getresponse()
            assert answer.status == status
            text = answer.read().decode()
        assert text == "There is nothing for 'elsewhere.example' here.\n"


Come = Callable[[], Somebody]


def test_one_at_a_time_operates(come: Come) -> None:
    one, other = come(), come()
    act = {'do': 'cut', 'what': 'so'}
    assert one.ask(**act) == (False, 'You are looking on: press Operate first.')
    assert one.ask(do='operate') == (True, 'You operate the machine now.')
    assert one.ask(**act) == (True, 'Did so.')
    name = one.look().get('server', {}).get('you') or '127.0.0.1 (viewer 1)'
    assert other.ask(do='operate') == (False, f'{name} operates already.')
    assert other.ask(do='operate', take_over=True)[0]
    one.ask(**act)
    said = '127.0.0.1 (viewer 2) has taken over: you are looking on.'
    assert said in [answer['text'] for answer in one.told]
    assert other.ask(do='release') == (True, 'You are looking on.')
    assert one.ask(do='operate')[0]


@pytest.mark.parametrize('come', [TOKEN], indirect=True)
def test_whoever_has_the_token_acts_in_whatever_letters(come: Come) -> None:
    one = come()
    assert one.ask(do='operate') == (False, 'Without the token you may look, and not act.')
    for wrong in ('another tökén of one', 'plain'):
        assert one.ask(do='token', token=wrong) == (False, 'That is not the token.')
    assert one.ask(do='token', token=TOKEN) == (True, '')
    assert one.ask(do='operate')[0]


def test_what_makes_no_sense_is_answered_and_so_is_too_much(come: Come) -> None:
    one = come()
    one.ask(do='operate')
    for do in ('cut', 'burst'):  # without what; and what no message of ROS holds
        assert one.ask(do=do) == (False, f"The request '{do}' makes no sense.")
    one.socket.send('[]')
    for _ in range(9):
        one.socket.send('{"do": "wait", "what": "so"}')
    while 'Too much at once: wait for the answers.' not in [a['text'] for a in one.told]:
        one.look()
    assert 'A message made no sense.' in [answer['text'] for answer in one.told]


def test_who_floods_or_talks_nonsense_is_sent_away_with_the_reason(come: Come) -> None:
    flood, nonsense = come(), come()
    for _ in range(12):
        nonsense.socket.send('nonsense')
    assert nonsense.sent_away() == 'Too many bad messages.'
    with suppress(ConnectionClosed):
        for _ in range(100_000):
            flood.socket.send('{"do": "next"}')
    assert flood.sent_away() == 'Too many messages.'


def test_more_viewers_than_there_is_room_for_are_told(come: Come) -> None:
    for _ in range(32):
        come().look()
    assert come().sent_away() == '32 viewers are here already.'


@pytest.mark.parametrize('host', ['0.0.0.0', ''])  # noqa: S104 -- what it is of
def test_on_every_address_the_page_is_named_by_its_machine(host: str) -> None:
    nobody: Any = None
    server = PageServer(nobody, host, 0, 16 * 'x')
    assert server.url == f'http://{socket.gethostname()}:{server.port}/'


def test_on_one_address_the_page_is_named_by_it() -> None:
    nobody: Any = None
    server = PageServer(nobody, '127.0.0.1', 0)
    assert server.url == f'http://127.0.0.1:{server.port}/'
