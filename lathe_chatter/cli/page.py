"""`lathe-chatter page`: a recorded run in the browser, to scrub through."""

from __future__ import annotations

import asyncio
import signal
from argparse import ArgumentParser, Namespace
from contextlib import suppress

from lathe_chatter.cli.common_options import add_run, add_topic
from lathe_chatter.cli.console import Screen
from lathe_chatter.nodes.end_signals import END_SIGNALS
from lathe_chatter.page.recorded_run import RecordedRun
from lathe_chatter.page.server import PageServer, open_in_browser

EXAMPLE = 'lathe-chatter page runs/20260401-120000'


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_run(parser)
    add_topic(parser)
    parser.add_argument(
        '--port',
        type=int,
        default=0,
        metavar='N',
        help='port to serve it on (default: a free one)',
    )


def run(options: Namespace) -> int:
    """Serve the page until Ctrl-C."""
    screen = Screen()
    shown = RecordedRun(options.run_path, options.topic)
    server = PageServer(shown, '127.0.0.1', options.port)
    screen.say(f'{options.run_path} is at {server.url} until Ctrl-C.')
    open_in_browser(server.url)

    async def serve() -> None:
        loop = asyncio.get_running_loop()
        for each in END_SIGNALS:
            if signal.getsignal(each) != signal.SIG_IGN:
                loop.add_signal_handler(each, server.end)
        reading = asyncio.create_task(shown.read())
        await server.run()
        reading.cancel()

    with suppress(KeyboardInterrupt):
        asyncio.run(serve())
    return 0
