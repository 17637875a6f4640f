"""A scenario: the parameters of a lathe at its start and the changes that an operator makes.

A scenario is a YAML file; config/scenarios/ holds two with every key explained.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from lathe_chatter.errors import (
    MachineFileError,
    ParameterError,
    ScenarioError,
    nearest_name,
    reason_of,
)
from lathe_chatter.model.lathe_parameter_table import LATHE, MACHINE_FILE, cut_from, feed_refusal
from lathe_chatter.model.machine_file import load_machine, shipped_machines
from lathe_chatter.model.quantity_fields import Quantity
from lathe_chatter.shipped_files import shipped_files

RECOMMENDED = 'recommended'
"""Stands for the speed that the monitor recommends."""
FLAGGED, CLEARED, ASKED = 'flagged', 'cleared', 'asked'
"""What a step may wait for: the monitor's flag, or a supervisor that asks."""
_TIME = Quantity('a time', 's', high=86400.0)


@dataclass(frozen=True)
class Step:
    """One change of parameters, or the answer to a supervisor that asks.

    Attributes:
        changes: Parameter names of the node `lathe` with their new values, or `RECOMMENDED`.
        at: Simulated time of the change, s; None where it waits for the monitor.
        when: `FLAGGED`, `CLEARED` or `ASKED`: what must have been said since the step before.
        accept: Whether the supervisor's offer is accepted, in place of a change.
        after: s of simulated time to let pass after that.
        because: Why, for the reader of the run.
    """

    changes: Mapping[str, Any]
    at: float | None = None
    when: str | None = None
    after: float = 0.0
    because: str = ''
    accept: bool = False

    def __str__(self) -> str:
        """What changes and why, in a line."""
        shown = ', '.join(f'{name} = {value}' for name, value in self.changes.items())
        shown = 'the offer of the supervisor is accepted' if self.accept else shown
        return f'{shown}{self.because and f"  ({self.because})"}'


@dataclass(frozen=True)
class Scenario:
    """What a run does.

    Attributes:
        name: Short, for file names.
        title: One line for people.
        duration: Simulated time after which the run ends, s.
        parameters: Of the node `lathe` at its start.
        steps: The changes, in order.
        supervisor: Parameters of a node `chatter_supervisor` that plays too; None without one.
        expect: What the monitor should have said at the end: `FLAGGED` and `CLEARED` to a truth.

    Raises:
        ScenarioError: If a step changes a feed speed that does not rule then.
    """

    name: str
    title: str
    duration: float
    parameters: Mapping[str, Any] = field(default_factory=dict)
    steps: tuple[Step, ...] = ()
    supervisor: Mapping[str, Any] | None = None
    expect: Mapping[str, bool] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """See that every change of the feed has an effect."""
        with suppress(ParameterError, MachineFileError):  # which the lathe tells
            present = vars(cut_from(self.parameters))
            for number, step in enumerate(self.steps, 1):
                if refusal := feed_refusal(step.changes, present):
                    where = f'The scenario {self.name}: step {number}'
                    raise ScenarioError(f'{where}: {refusal}')
                present = {**present, **step.changes}


def shipped_scenarios() -> dict[str, Path]:
    """The scenario files of the package by name."""
    return shipped_files('scenarios')


def find_scenario(name_or_path: str) -> Path:
    """The file of a scenario named as it is shipped or by its path.

    Raises:
        ScenarioError: If there is none.
    """
    shipped = shipped_scenarios()
    if name_or_path in shipped:
        return shipped[name_or_path]
    path = Path(name_or_path)
    if not path.is_file():
        raise ScenarioError(
            f'There is no scenario {name_or_path!r}: give the path of a YAML file or one of '
            f'{", ".join(shipped) or "none that is installed"}.'
        )
    return path


def load_scenario(path: Path | str) -> Scenario:
    """Read and check a scenario file.

    Changes are checked here, parameters of the start by the lathe that gets them.

    Args:
        path: Of the file; as a text also the name of one that is shipped.

    Raises:
        ScenarioError: If there is no such file, or it is no scenario.
    """
    path = find_scenario(path) if isinstance(path, str) else path
    try:
        raw = yaml.safe_load(path.read_text(encoding='utf-8'))
    except OSError as error:
        raise ScenarioError(f'The scenario {path} cannot be read: {reason_of(error)}.') from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f'line {mark.line + 1}, column {mark.column + 1}' if mark else 'its YAML'
        raise ScenarioError(
            f'The scenario {path} cannot be read: at {where}, {error.problem}.'
        ) from None
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        reason = ' '.join(str(error).split())
        raise ScenarioError(f'The scenario {path} cannot be read: {reason}.') from None
    if not isinstance(raw, dict):
        raise ScenarioError(f'The scenario {path} is empty or no mapping of keys to values.')
    where = f'The scenario {path}'
    _only(raw, {'name', 'title', 'duration', 'parameters', 'steps', 'supervisor', 'expect'}, where)
    steps = raw.get('steps') or []
    if not isinstance(steps, list):
        raise ScenarioError(f'{where}: steps must be a list.')
    expect = _mapping(raw, 'expect', where)
    _only(expect, {FLAGGED, CLEARED}, f'{where}: expect')
    wrong = next((key for key, value in expect.items() if not isinstance(value, bool)), None)
    if wrong is not None:
        raise ScenarioError(f'{where}: expect.{wrong} must be true or false.')
    name = str(raw.get('name', path.stem))
    duration = _time(raw, 'duration', where, required=True)
    if not duration:
        raise ScenarioError(f'{where}: duration is 0 s: it must be more.')
    scenario = Scenario(
        name=name,
        title=str(raw.get('title', name)),
        duration=duration,
        parameters=_parameters(raw, path, where),
        steps=tuple(_step(entry, f'{where}: step {k + 1}') for k, entry in enumerate(steps)),
        supervisor=_mapping(raw, 'supervisor', where) if 'supervisor' in raw else None,
        expect=expect,
    )
    if scenario.supervisor is None and any(s.accept or s.when == ASKED for s in scenario.steps):
        raise ScenarioError(f'{where}: a step accepts what no supervisor asks: give supervisor.')
    _check_times(scenario, where)
    return scenario


def _parameters(raw: Mapping[str, Any], path: Path, where: str) -> dict[str, Any]:
    """Those of the start; a machine file is looked for beside the scenario first."""
    given = _mapping(raw, 'parameters', where)
    found = {n: LATHE[n].parsed(v) if n in LATHE else v for n, v in given.items()}
    machine = found.get(MACHINE_FILE.name)
    if isinstance(machine, str) and machine:
        beside = path.parent / machine
        if machine not in shipped_machines() and '\n' not in machine and beside.is_file():
            found[MACHINE_FILE.name] = machine = str(beside.resolve())
        try:
            load_machine(machine)
        except MachineFileError as error:
            raise ScenarioError(f'{where}: {error}') from None
    return found


def _check_times(scenario: Scenario, where: str) -> None:
    """Refuse a step whose time comes before that of the one before it, or never."""
    before = 0.0
    for number, step in enumerate(scenario.steps, 1):
        if step.at is None:
            continue
        if step.at < before:
            raise ScenarioError(
                f'{where}: step {number} is at {step.at:g} s, and one before it at {before:g} s: '
                'steps must be in order of time.'
            )
        if step.at > scenario.duration:
            raise ScenarioError(
                f'{where}: step {number} is at {step.at:g} s, and the run ends at '
                f'{scenario.duration:g} s.'
            )
        before = step.at


def _step(entry: Any, where: str) -> Step:
    """One entry of the list of steps."""
    if not isinstance(entry, dict):
        raise ScenarioError(f'{where} must be a mapping with at or when, and set.')
    _only(entry, {'at', 'when', 'after', 'set', 'accept', 'because'}, where)
    if ('at' in entry) == ('when' in entry):
        raise ScenarioError(f'{where} must have either at (a time in s) or when.')
    when = entry.get('when')
    if 'when' in entry and when not in {FLAGGED, CLEARED, ASKED}:
        allowed = f'{FLAGGED}, {CLEARED} or {ASKED}'
        raise ScenarioError(f'{where}: when is {when!r}: it must be {allowed}.')
    changes, accept = _mapping(entry, 'set', where), entry.get('accept', False)
    if not isinstance(accept, bool) or accept == bool(changes):
        raise ScenarioError(f'{where}: it must set at least one parameter, or accept: true.')
    return Step(
        changes={name: _change(name, value, where) for name, value in changes.items()},
        at=_time(entry, 'at', where),
        when=when,
        after=_time(entry, 'after', where) or 0.0,
        because=str(entry.get('because', '')),
        accept=accept,
    )


def _change(name: str, value: Any, where: str) -> Any:
    """The value that a parameter changes to; refused is what the lathe would refuse then."""
    if (name, value) == ('spindle_speed_rpm', RECOMMENDED):
        return value
    changing = [row.name for row in LATHE if row.run_time]
    if name not in changing:
        near = nearest_name(name, changing)
        hint = f'did you mean {near}?' if near else f'what can change is {", ".join(changing)}.'
        raise ScenarioError(f'{where}: {name!r} cannot change while the lathe cuts: {hint}')
    try:
        return LATHE[name].check(LATHE[name].parsed(value))
    except ParameterError as error:
        raise ScenarioError(f'{where}: {error}') from None


def _only(raw: Mapping[str, Any], known: set[str], where: str) -> None:
    """Refuse a key that would otherwise be ignored in silence."""
    unknown = next((key for key in raw if key not in known), None)
    if unknown is not None:
        raise ScenarioError(
            f'{where} has no key {unknown!r}: known are {", ".join(sorted(known))}.'
        )


def _mapping(raw: Mapping[str, Any], key: str, where: str) -> dict[str, Any]:
    """The mapping under `key`, empty where it is missing."""
    value = raw.get(key) or {}
    if not isinstance(value, dict) or not all(isinstance(name, str) for name in value):
        raise ScenarioError(f'{where}: {key} must be a mapping of names to values.')
    return value


def _time(raw: Mapping[str, Any], key: str, where: str, *, required: bool = False) -> float | None:
    """The time under `key` in s."""
    if key not in raw:
        if required:
            raise ScenarioError(f'{where} needs {key}, in s of simulated time.')
        return None
    try:
        return _TIME.check(key, raw[key])
    except ValueError as error:
        raise ScenarioError(f'{where}: {error}') from None
