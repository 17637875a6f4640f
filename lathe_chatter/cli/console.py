"""What the verbs print for machines."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from typing import Any

from rich.console import Console

from lathe_chatter.scenario import CLEARED, FLAGGED, Scenario


def print_json(figures: Any) -> None:
    """Print figures as one line of JSON.

    Not by way of rich, which would take `[null]` for a tag and swallow it.

    Raises:
        ValueError: If a number is not finite: JSON has no such thing.
    """
    sys.stdout.write(json.dumps(figures, allow_nan=False) + '\n')


def tell_verdict(scenario: Scenario, said: Mapping[str, bool | None], console: Console) -> int:
    """Say whether the monitor said what a scenario expects.

    Args:
        scenario: What was played.
        said: Whether chatter was FLAGGED, and CLEARED at the end; None where nobody listened.
        console: Where to.

    Returns:
        The exit code: 0 if it did, else 1.
    """
    wrong = [word for word, expected in scenario.expect.items() if said[word] != expected]
    for word in wrong:
        expected = 'was' if scenario.expect[word] else 'was not'
        console.print(f'[bold red]Chatter {expected} to be {word}, and it is otherwise.[/]')
    if scenario.expect and not wrong:
        happened = ' and '.join(word for word in (FLAGGED, CLEARED) if scenario.expect.get(word))
        story = f'chatter was {happened}' if happened else 'nothing was flagged'
        console.print(f'As the scenario expects, {story}.')
    return 1 if wrong else 0
