"""Serves a page and what it shows, and lets one viewer at a time act.

A page asks for each frame when it has drawn the last one: who is slow gets fewer, and nothing
piles up anywhere. Frames are those of `versioned_values.encode_frame`; what a page sends is JSON.

A foreign page in the same browser is kept out by the headers Host (no name but this machine's
leads here) and Origin (a socket is opened by this page alone); on other hosts a token, without
which one may look and not act.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import ipaddress
import json
import os
import socket
import sys
import time
import webbrowser
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import urlsplit

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware import Middleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.responses import PlainTextResponse
from starlette.routing import Mount, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from lathe_chatter.errors import LatheChatterError, StartError, reason_of
from lathe_chatter.page.versioned_values import Board, encode_frame

FRAME_PERIOD = 0.05
"""s from one frame of a viewer to the next."""
_SHORTEST_TOKEN = 16
_STATIC = Path(__file__).with_name('static')
_MOST_VIEWERS, _MOST_CONNECTIONS = 32, 96
_MESSAGE_SIZE, _MESSAGES, _BURST = 4096, 100.0, 300.0
"""Bytes of a message; messages a second, and at once, beyond which a viewer is sent away."""
_MOST_BAD, _MOST_ACTS = 10, 8
"""Messages that make no sense before a viewer is sent away; requests that it may have open."""
_SEND_PATIENCE = 10.0
"""s that a viewer has to take a frame: one that sleeps is let go, and comes back by itself."""
_HEADERS = {
    'content-security-policy': "default-src 'none'; script-src 'self'; style-src 'self'; "
    "connect-src 'self'; img-src 'self' data:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    'x-content-type-options': 'nosniff',
    'referrer-policy': 'no-referrer',
    'cache-control': 'no-cache',
}
_TRY_AGAIN, _FORBIDDEN = 1013, 1008


@dataclass(eq=False)
class Viewer:
    """Somebody with the page open.

    Attributes:
        name: Address and number, for people.
        trusted: Whether it holds the token, where there is one.
        choice: The lathe that it looks at.
        seen: Versions of what it was sent, by board.
        cursors: What of the signals it was sent, as its source keeps count.
        answers: To what it asked for, to be sent.
    """

    name: str
    trusted: bool
    choice: str = ''
    seen: dict[str, dict[str, int]] = field(default_factory=dict)
    cursors: dict[str, Any] = field(default_factory=dict)
    answers: list[dict[str, Any]] = field(default_factory=list)
    wants: asyncio.Event = field(default_factory=asyncio.Event)
    acts: set[asyncio.Task[None]] = field(default_factory=set)
    bad: int = 0


class Source(Protocol):
    """Where the page has everything from."""

    def frame(self, viewer: Viewer) -> tuple[dict[str, Any], dict[str, Any]]:
        """What is new for a viewer: a header and arrays by name."""

    async def look(self, viewer: Viewer, wish: Mapping[str, Any]) -> bool:
        """Do what every viewer may ask for; False where it is no such thing."""

    async def act(self, viewer: Viewer, wish: Mapping[str, Any]) -> str:
        """Do what only the operator may ask for, and say what came of it.

        Raises:
            LatheChatterError: If it is refused, with the reason as a sentence.
        """


class PageServer:
    """A page on an address.

    Args:
        source: What it shows and does.
        host: To listen on.
        port: 0 for any that is free.
        token: That viewers who act need; empty where none is.

    Attributes:
        port: That it has.
        url: Of the page, by this machine's name where it listens on all addresses.

    Raises:
        StartError: If another host than this one would need no token, or the port is taken.
    """

    def __init__(self, source: Source, host: str, port: int, token: str = '') -> None:
        """Listen; `run` serves."""
        if token and len(token) < _SHORTEST_TOKEN:
            raise StartError(
                f'token has {len(token)} characters: it must have {_SHORTEST_TOKEN} or more.'
            )
        address = _in_digits(host)
        if not (token or host == 'localhost' or (address and address.is_loopback)):
            raise StartError(
                f'host {host} may let other machines in: give a token of {_SHORTEST_TOKEN} '
                'characters or more, which those who act will need.'
            )
        family = socket.AF_INET6 if ':' in host else socket.AF_INET
        try:
            self._socket = socket.create_server((host, port), family=family)
        except (OSError, UnicodeError) as error:  # the latter of a host that can be no name
            raise StartError(f'port {port} of {host} cannot be had: {reason_of(error)}.') from None
        self.port: int = self._socket.getsockname()[1]
        everywhere = address.is_unspecified if address else not host
        name = socket.gethostname() if everywhere else host
        self.url = f'http://{f"[{name}]" if ":" in name else name}:{self.port}/'
        self._source, self._token = source, token
        self.viewers: list[Viewer] = []
        self.operator: Viewer | None = None
        self._board = Board()
        self._met = 0
        names = ('localhost', host, socket.gethostname(), socket.getfqdn())
        self._names = {each.lower() for each in names}
        app = Starlette(
            routes=[
                WebSocketRoute('/feed', self._feed),
                Mount('/', StaticFiles(directory=_STATIC, html=True)),
            ],
            middleware=[Middleware(GZipMiddleware), Middleware(_Guard, names=self._names)],
        )
        self._server = _Server(
            uvicorn.Config(
                app, lifespan='off', log_config=None, access_log=False, server_header=False,
                ws='websockets-sansio', ws_max_size=_MESSAGE_SIZE, ws_per_message_deflate=False,
                ws_ping_interval=5.0, ws_ping_timeout=10.0, limit_concurrency=_MOST_CONNECTIONS,
                timeout_graceful_shutdown=1,
            )
        )  # fmt: skip

    async def run(self) -> None:
        """Serve until `end`."""
        await self._server.serve(sockets=[self._socket])

    def end(self) -> None:
        """Let all viewers go."""
        self._server.should_exit = True

    # -- viewers ---------------------------------------------------------------------------

    async def _feed(self, socket: WebSocket) -> None:
        """One viewer, from the first message to the last."""
        origin = urlsplit(socket.headers.get('origin', '')).netloc
        if not origin or origin != socket.headers.get('host'):
            await socket.close(_FORBIDDEN)  # before it is accepted: an answer 403
            return
        await socket.accept()
        if len(self.viewers) >= _MOST_VIEWERS:
            await socket.close(_TRY_AGAIN, f'{_MOST_VIEWERS} viewers are here already.')
            return
        self._met += 1
        address = socket.client.host if socket.client else 'somewhere'
        viewer = Viewer(f'{address} (viewer {self._met})', trusted=not self._token)
        self.viewers.append(viewer)
        sender = asyncio.create_task(self._send(socket, viewer))
        try:
            await self._receive(socket, viewer)
        except WebSocketDisconnect:
            pass
        finally:
            sender.cancel()
            self.viewers.remove(viewer)
            if self.operator is viewer:
                self.operator = None

    async def _receive(self, socket: WebSocket, viewer: Viewer) -> None:
        allowance, before = _BURST, time.monotonic()
        while True:
            message = await socket.receive()
            if message['type'] == 'websocket.disconnect':
                return
            now = time.monotonic()
            allowance = min(_BURST, allowance + (now - before) * _MESSAGES) - 1.0
            before = now
            if allowance < 0.0 or viewer.bad >= _MOST_BAD:
                why = 'Too many messages.' if allowance < 0.0 else 'Too many bad messages.'
                await socket.close(_FORBIDDEN, why)
                return
            try:
                wish = json.loads(message.get('text') or '')
                do = wish['do']
            except (ValueError, TypeError, KeyError, RecursionError):
                viewer.bad += 1
                viewer.answers.append({'ok': False, 'text': 'A message made no sense.'})
                continue
            if do == 'next':
                viewer.wants.set()
            elif len(viewer.acts) >= _MOST_ACTS:
                text = 'Too much at once: wait for the answers.'
                viewer.answers.append({'id': wish.get('id'), 'ok': False, 'text': text})
            else:
                task = asyncio.create_task(self._answer(viewer, wish))
                viewer.acts.add(task)
                task.add_done_callback(viewer.acts.discard)

    async def _answer(self, viewer: Viewer, wish: Mapping[str, Any]) -> None:
        """Do what a viewer wishes, and note what came of it."""
        ok, text = True, ''
        try:
            text = await self._fulfil(viewer, wish)
        except LatheChatterError as error:
            ok, text = False, str(error)
        except (KeyError, TypeError, ValueError, OverflowError, SystemError):
            # The last of a message of ROS that cannot hold a whole number of that size.
            viewer.bad += 1
            ok, text = False, f'The request {wish["do"]!r:.40} makes no sense.'
        viewer.answers.append({'id': wish.get('id'), 'ok': ok, 'text': text})

    async def _fulfil(self, viewer: Viewer, wish: Mapping[str, Any]) -> str:
        do = wish['do']
        if do == 'token':
            given, token = (text.encode() for text in (str(wish['token']), self._token))
            if token and not hmac.compare_digest(given, token):
                await asyncio.sleep(1.0)  # no guessing
                raise LatheChatterError('That is not the token.')
            viewer.trusted = True
            return ''
        if do == 'operate':
            self._check_trust(viewer)
            if self.operator not in {None, viewer} and not wish.get('take_over'):
                assert self.operator is not None  # noqa: S101 -- for the types
                raise LatheChatterError(f'{self.operator.name} operates already.')
            former, self.operator = self.operator, viewer
            if former not in {None, viewer}:
                assert former is not None  # noqa: S101 -- for the types
                former.answers.append(
                    {'ok': False, 'text': f'{viewer.name} has taken over: you are looking on.'}
                )
            return 'You operate the machine now.'
        if do == 'release':
            self.operator = None if self.operator is viewer else self.operator
            return 'You are looking on.'
        if await self._source.look(viewer, wish):
            return ''
        self._check_trust(viewer)
        if self.operator is not viewer:
            raise LatheChatterError('You are looking on: press Operate first.')
        return await self._source.act(viewer, wish)

    def _check_trust(self, viewer: Viewer) -> None:
        if not viewer.trusted:
            raise LatheChatterError('Without the token you may look, and not act.')

    async def _send(self, socket: WebSocket, viewer: Viewer) -> None:
        """Send a frame each time one is wanted."""
        while True:
            await viewer.wants.wait()
            viewer.wants.clear()
            due = time.monotonic() + FRAME_PERIOD
            try:
                await asyncio.wait_for(socket.send_bytes(self._frame(viewer)), _SEND_PATIENCE)
            except (asyncio.TimeoutError, WebSocketDisconnect, RuntimeError, OSError):
                with contextlib.suppress(RuntimeError, OSError):
                    await socket.close(_TRY_AGAIN)
                return
            await asyncio.sleep(max(0.0, due - time.monotonic()))

    def _frame(self, viewer: Viewer) -> bytes:
        header, arrays = self._source.frame(viewer)
        self._board.put('viewers', len(self.viewers))
        self._board.put('operator', self.operator.name if self.operator else '')
        news = self._board.news(viewer.seen.setdefault('server', {}))
        if news:
            mine = {'you': viewer.name, 'trusted': viewer.trusted}
            header['server'] = {**news, **mine, 'operating': self.operator is viewer}
        if viewer.answers:
            header['answers'], viewer.answers = viewer.answers, []
        return encode_frame(header, arrays)


class _Server(uvicorn.Server):
    """A server that leaves signals to the process that it is a part of."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


class _Guard:
    """Answers under this machine's own names alone, and with headers that keep pages apart."""

    def __init__(self, app: ASGIApp, names: set[str]) -> None:
        self._app, self._names = app, names

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        host = urlsplit(f'//{Headers(scope=scope).get("host", "")}').hostname or ''
        astray = scope['type'] == 'websocket' and scope['path'] != '/feed'
        if astray or (host not in self._names and not _in_digits(host)):
            text = f'There is nothing for {host!r:.80} here.\n'
            await PlainTextResponse(text, 403)(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message['type'] == 'http.response.start':
                MutableHeaders(scope=message).update(_HEADERS)
            await send(message)

        await self._app(scope, receive, send_with_headers)


def _in_digits(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """A host that is an address in digits: no foreign name leads here by it."""
    with contextlib.suppress(ValueError):
        return ipaddress.ip_address(host)
    return None


def free_port(first: int = 8080) -> int:
    """The first port from one on that nobody on this machine has."""
    while answers(first):
        first += 1
    return first


def answers(port: int) -> bool:
    """Whether somebody listens on a port of this machine."""
    with contextlib.suppress(OSError), socket.create_connection(('127.0.0.1', port), 0.5):
        return True
    return False


def open_in_browser(url: str) -> None:
    """Open a page, where there is a screen to see it on."""
    if sys.platform == 'darwin' or os.environ.get('DISPLAY') or os.environ.get('WAYLAND_DISPLAY'):
        webbrowser.open(url)
