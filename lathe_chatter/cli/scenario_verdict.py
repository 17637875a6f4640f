"""What the verbs that play a scenario say alike."""

from __future__ import annotations

from collections.abc import Mapping

from lathe_chatter.cli.console import Screen
from lathe_chatter.scenario import CLEARED, FLAGGED, Scenario, shipped_scenarios


def scenario_help() -> str:
    """What a scenario may be named by."""
    return f'a YAML file, or one of {", ".join(shipped_scenarios())}'


def verdict(scenario: Scenario, said: Mapping[str, bool | None], screen: Screen) -> int:
    """Say whether the monitor said what a scenario expects.

    Args:
        scenario: What was played.
        said: Whether chatter was FLAGGED, and CLEARED at the end; None where nobody listened.
        screen: Where to.

    Returns:
        The exit code: 0 if it did, else 1.
    """
    wrong = [word for word, expected in scenario.expect.items() if said[word] != expected]
    for word in wrong:
        expected = 'was' if scenario.expect[word] else 'was not'
        screen.say(f'Chatter {expected} to be {word}, and it is otherwise.', 'bold red')
    if scenario.expect and not wrong:
        happened = ' and '.join(word for word in (FLAGGED, CLEARED) if scenario.expect.get(word))
        story = f'chatter was {happened}' if happened else 'nothing was flagged'
        screen.say(f'As the scenario expects, {story}.')
    return 1 if wrong else 0
