"""Scenarios: the parameters of a lathe at its start, and the changes that an operator makes."""

from __future__ import annotations

from lathe_chatter.scenario.scenario import (
    CLEARED,
    FLAGGED,
    RECOMMENDED,
    Scenario,
    Step,
    find_scenario,
    load_scenario,
    shipped_scenarios,
)

__all__ = [
    'CLEARED',
    'FLAGGED',
    'RECOMMENDED',
    'Scenario',
    'Step',
    'find_scenario',
    'load_scenario',
    'shipped_scenarios',
]
