"""The verbs of the command line, one module each.

A verb has NAME, HELP, EXAMPLE, configure(parser) and run(options) -> exit code.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import Protocol

from lathe_chatter.cli import (
    bench,
    export,
    identify,
    knock_map,
    lobes,
    recover,
    report,
    reproduce,
    run,
    simulate,
    verify,
)


class Verb(Protocol):
    """What a module of this package offers."""

    NAME: str
    HELP: str
    EXAMPLE: str

    def configure(self, parser: ArgumentParser) -> None:
        """Declare arguments and options."""

    def run(self, options: Namespace) -> int:
        """Do it and return the exit code."""


VERBS: tuple[Verb, ...] = (
    run,
    simulate,
    report,
    reproduce,
    lobes,
    knock_map,
    identify,
    verify,
    recover,
    export,
    bench,
)
