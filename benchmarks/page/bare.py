"""The least that such a page can cost: two bare plots of 2000 points, 20 times a second."""

from __future__ import annotations

import contextlib
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from files import STATIC
from live import SETTLING, family_of, taken
from support.browser import Browser
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

_POINTS, _FRAME = 2000, 0.05
_PAGE = """<!DOCTYPE html><style>{style}</style><body><script>{uplot}</script><script>
const plots = ['tool', 'workpiece'].map(label => new uPlot(
  {{width: 760, height: 260, cursor: {{show: false}}, scales: {{x: {{time: false}}}},
    series: [{{}}, {{label, stroke: 'blue', width: 1, points: {{show: false}}}}]}},
  [[], []], document.body));
const socket = new WebSocket('ws://127.0.0.1:{port}/');
let frames = 0;
socket.binaryType = 'arraybuffer';
socket.onmessage = message => {{
  const all = new Float32Array(message.data), n = all.length / 3;
  plots.forEach((u, k) => u.setData([all.subarray(0, n), all.subarray((k + 1) * n, (k + 2) * n)]));
  frames += 1;
}};
</script>"""


def _send(socket: ServerConnection) -> None:
    """Noisy sines that move, as the first page that was tried had them."""
    rng, phase = np.random.default_rng(0), np.arange(_POINTS) / 100.0
    with contextlib.suppress(ConnectionClosed):
        while True:
            moved = phase + time.monotonic()
            noise = 0.05 * rng.standard_normal((2, _POINTS))
            socket.send(np.stack([phase, *(np.sin(6.0 * moved) + noise)]).astype('f4').tobytes())
            time.sleep(_FRAME)


def bare(seconds: float) -> Iterator[str]:
    """Processor time of a browser that draws these and nothing else."""
    with tempfile.TemporaryDirectory() as name, serve(_send, '127.0.0.1', 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        text = _PAGE.format(
            style=(STATIC / 'uPlot.min.css').read_text(),
            uplot=(STATIC / 'uPlot.iife.min.js').read_text(),
            port=server.socket.getsockname()[1],
        )
        page = Path(name) / 'bare.html'
        page.write_text(text)
        browser = Browser(Path(name))
        try:
            browser.open(page.as_uri())
            browser.until('frames > 20', 'the bare page')
            time.sleep(SETTLING)
            family = family_of(browser.process.pid)
            before, shown = taken(family), browser.run('frames')
            time.sleep(seconds)
            share = 100.0 * (taken(family) - before) / seconds
            rate = (browser.run('frames') - shown) / seconds
        finally:
            browser.close()
    yield f'two bare plots of {_POINTS} points at {rate:.1f} frames/s: {share:.1f} % of a core'
