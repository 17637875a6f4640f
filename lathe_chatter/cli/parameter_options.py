"""Options for the parameters of a lathe: `--depth-of-cut 0.001`, `--tool.mass 0.06`, ..."""

from __future__ import annotations

from argparse import ArgumentParser, BooleanOptionalAction, Namespace
from collections.abc import Mapping
from typing import Any

from lathe_chatter.cli.console import Screen
from lathe_chatter.lathe.config import LatheConfig, config_from
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.lathe_parameter_table import LATHE
from lathe_chatter.model.machine_file import MachineDescription


def only_of_samples(why: str) -> dict[str, str]:
    """The parameters that change samples and no limit of a cut, each with why a verb has not."""
    return {row.name: why for row in LATHE if row.only_samples}


def add_parameter_options(
    parser: ArgumentParser, *, without: Mapping[str, str] | None = None
) -> None:
    """Declare an option for every parameter of a lathe, but for some.

    Args:
        parser: Of a verb.
        without: Those that it has not, and why: a sentence about one that is given says it.
    """
    group = parser.add_argument_group(
        'the lathe', 'in SI units (speeds in rev/min), or with a unit: "0.5 mm"'
    )
    of_node = {row.name: 'the node lathe alone has it' for row in LATHE if row.node_only}
    left_out = {**of_node, **(without or {})}
    parser.set_defaults(left_out={_flag(name): why for name, why in left_out.items()})
    for row in LATHE:
        if row.name in left_out:
            continue
        flag = _flag(row.name)
        text = row.meaning.replace('%', '%%')
        if isinstance(row.default, bool):
            usual = 'yes' if row.default else 'no'
            group.add_argument(
                flag, dest=row.name, action=BooleanOptionalAction, default=None,
                help=f'{text} (default: {usual})',
            )  # fmt: skip
        elif row.choices is not None:
            choices = [choice.value for choice in row.choices]
            group.add_argument(
                flag, dest=row.name, choices=choices, help=f'(default: {row.default})'
            )
        elif isinstance(row.default, str):
            group.add_argument(flag, dest=row.name, metavar='FILE', help=text)
        else:
            unit = f', {row.unit}' if row.unit else ''
            # A text that is no number stays one: the parameter then says what it must be.
            group.add_argument(
                flag, dest=row.name, type=row.parsed, metavar='X',
                help=f'{text}{unit} (default: {row.default:g})',
            )  # fmt: skip


def _flag(name: str) -> str:
    return '--' + name.replace('_', '-')


def given_parameters(options: Namespace) -> dict[str, Any]:
    """The parameters that were given, by name.

    Raises:
        ParameterError: If a value is not allowed.
    """
    values = {row: getattr(options, row.name, None) for row in LATHE}
    return {row.name: row.check(value) for row, value in values.items() if value is not None}


def say_what_is_assumed(
    described: MachineDescription | None,
    screen: Screen,
    machine: Machine | None = None,
    cut: Cut | None = None,
) -> None:
    """Warn of a machine file that lacks what the paper's machine stands in for.

    Args:
        described: The file, if there is one.
        screen: Where it is said.
        machine: That is taken, see `MachineDescription.assumption`.
        cut: Likewise.
    """
    if described and (said := described.assumption(machine, cut)):
        screen.say(f'WARNING  {said}')


def config_of(options: Namespace) -> LatheConfig:
    """The lathe that the options describe.

    Raises:
        ParameterError: If a value is not allowed.
    """
    return config_from(given_parameters(options))
