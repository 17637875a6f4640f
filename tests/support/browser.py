"""A real Chromium without a window, driven over its DevTools protocol."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import time
import urllib.request
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

FLAGS = (
    *('--headless', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-extensions'),
    *('--disable-background-networking', '--disable-component-update', '--disable-sync'),
    *('--hide-scrollbars', '--remote-debugging-port=0', '--mute-audio'),
)
PATIENCE = 60.0


def chromium() -> str | None:
    """The browser of this machine, None where there is none."""
    names = ('chromium', 'chromium-browser', 'google-chrome')
    return next(filter(None, map(shutil.which, names)), None)


class Browser:
    """One page in one browser.

    Args:
        profile: An empty folder.
    """

    def __init__(self, profile: Path) -> None:
        program = chromium()
        assert program is not None
        root = ['--no-sandbox'] if hasattr(os, 'geteuid') and os.geteuid() == 0 else []
        self.process = subprocess.Popen(
            [program, *FLAGS, *root, f'--user-data-dir={profile}', 'about:blank'],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self._number = 0
        self.complaints: list[str] = []
        self.requests: list[str] = []
        file = profile / 'DevToolsActivePort'
        until = time.monotonic() + PATIENCE
        while not (file.exists() and len(file.read_text().splitlines()) == 2):
            assert time.monotonic() < until, 'the browser did not start'
            time.sleep(0.05)
        port = file.read_text().splitlines()[0]
        with urllib.request.urlopen(f'http://127.0.0.1:{port}/json') as answer:
            target = next(each for each in json.load(answer) if each['type'] == 'page')
        self._socket: ClientConnection = connect(
            target['webSocketDebuggerUrl'], max_size=None, proxy=None
        )
        for domain in ('Page', 'Runtime', 'Log', 'Network'):
            self.command(f'{domain}.enable')

    def command(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Give a command and return its result."""
        self._number += 1
        self._socket.send(json.dumps({'id': self._number, 'method': method, 'params': parameters}))
        while True:
            message = json.loads(self._socket.recv(timeout=PATIENCE))
            if message.get('id') == self._number:
                assert 'error' not in message, message['error']
                return dict(message['result'])
            self._note(message)

    def _note(self, message: dict[str, Any]) -> None:
        method, given = message.get('method'), message.get('params', {})
        if method == 'Runtime.exceptionThrown':
            details = given['exceptionDetails']
            self.complaints.append(details.get('exception', {}).get('description', str(details)))
        elif method == 'Log.entryAdded' and given['entry']['level'] == 'error':
            self.complaints.append(f'{given["entry"]["text"]} {given["entry"].get("url", "")}')
        elif method == 'Network.requestWillBeSent':
            self.requests.append(given['request']['url'])

    def open(self, url: str, width: int = 1280, height: int = 900, *, dark: bool = False) -> None:
        """Open a page in a window of a size."""
        self.resize(width, height, dark=dark)
        self.command('Page.navigate', url=url)
        self.until('document.readyState === "complete"', 'the page')

    def resize(self, width: int, height: int = 900, *, dark: bool = False) -> None:
        """Give the window a size, and the page a scheme of colours."""
        self.command(
            'Emulation.setDeviceMetricsOverride',
            width=width, height=height, deviceScaleFactor=1, mobile=width < 600,
        )  # fmt: skip
        scheme = {'name': 'prefers-color-scheme', 'value': 'dark' if dark else 'light'}
        self.command('Emulation.setEmulatedMedia', features=[scheme])

    def run(self, script: str) -> Any:
        """The value of an expression in the page; a promise is waited for."""
        found = self.command(
            'Runtime.evaluate', expression=script, returnByValue=True, awaitPromise=True
        )
        if 'exceptionDetails' in found:
            raise AssertionError(found['exceptionDetails'])
        return found['result'].get('value')

    def until(self, script: str, what: str, patience: float = PATIENCE) -> Any:
        """Wait until an expression is true; its value."""
        until = time.monotonic() + patience
        plain = f'(async v => (v = await v) instanceof Element ? v.outerHTML : v)({script})'
        while not (value := self.run(plain)):
            if time.monotonic() >= until:
                seen = self.run('document.body?.innerText')
                raise AssertionError(f'{what} did not come: {self.complaints}; one sees:\n{seen}')
            time.sleep(0.05)
        return value

    def text(self, selector: str) -> str:
        """What stands in an element."""
        return str(self.run(f'document.querySelector({json.dumps(selector)}).innerText'))

    def click(self, selector: str) -> None:
        """Click an element, by a mouse, once it lies still under it: what comes above moves it."""
        place = self.until(
            f'(async e => {{ e.scrollIntoView({{block: "center"}});'
            f' const middle = () => {{ const r = e.getBoundingClientRect();'
            f' return [r.x + r.width / 2, r.y + r.height / 2]; }};'
            f' const [x, y] = middle(); await new Promise(requestAnimationFrame);'
            f' await new Promise(requestAnimationFrame); const now = middle();'
            f' return now[0] === x && now[1] === y && e.contains(document.elementFromPoint(x, y))'
            f' && now; }})(document.querySelector({json.dumps(selector)}))',
            f'{selector} under the mouse',
        )
        for kind in ('mousePressed', 'mouseReleased'):
            self.command(
                'Input.dispatchMouseEvent',
                type=kind, x=place[0], y=place[1], button='left', clickCount=1,
            )  # fmt: skip

    def key(self, key: str, code: int, text: str = '') -> None:
        """Press a key."""
        for kind in ('keyDown', 'keyUp'):
            self.command(
                'Input.dispatchKeyEvent',
                type=kind, key=key, windowsVirtualKeyCode=code, code=key,
                **({'text': text} if text and kind == 'keyDown' else {}),
            )  # fmt: skip

    def enter(self, selector: str, text: str) -> None:
        """Write into a field, as by hand, and leave it by Enter."""
        self.run(f'document.querySelector({json.dumps(selector)}).focus()')
        self.run('document.activeElement.select()')
        self.command('Input.insertText', text=text)
        self.key('Enter', 13, '\r')

    def picture(self, file: Path, *, whole: bool = True) -> None:
        """Take a picture of the page."""
        found = self.command('Page.captureScreenshot', format='png', captureBeyondViewport=whole)
        file.write_bytes(base64.b64decode(found['data']))

    def close(self) -> None:
        """End the browser."""
        self._socket.close()
        self.process.terminate()
        self.process.wait(20)
