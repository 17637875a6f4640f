"""Options for the parameters of a lathe: `--depth-of-cut 0.001`, `--tool.mass 0.06`, ..."""

from __future__ import annotations

from argparse import ArgumentParser, BooleanOptionalAction, Namespace
from collections.abc import Iterable
from typing import Any

from lathe_chatter.lathe.config import Start, parameter_names, start_from
from lathe_chatter.model import BearingContact


def add_parameter_options(parser: ArgumentParser, *, without: Iterable[str] = ()) -> None:
    """Declare an option for every parameter of a lathe, but for some."""
    usual = Start().parameters()
    group = parser.add_argument_group('the lathe', 'in SI units; speeds in rev/min')
    for name, limits in parameter_names():
        if name in without:
            continue
        flag = '--' + name.replace('_', '-')
        if isinstance(usual[name], bool):
            group.add_argument(
                flag, dest=name, action=BooleanOptionalAction, default=None,
                help='whether the force ends where the chip does (default: yes)',
            )  # fmt: skip
        elif limits is None:
            choices = [contact.value for contact in BearingContact]
            group.add_argument(flag, dest=name, choices=choices, help=f'(default: {usual[name]})')
        else:
            unit = f', {limits.unit}' if limits.unit else ''
            text = f'{limits.meaning}{unit} (default: {usual[name]:g})'
            group.add_argument(
                flag, dest=name, type=_number, metavar='X', help=text.replace('%', '%%')
            )


def given_parameters(options: Namespace) -> dict[str, Any]:
    """The parameters that were given, by name."""
    values = {name: getattr(options, name, None) for name, _ in parameter_names()}
    return {name: value for name, value in values.items() if value is not None}


def start_of(options: Namespace) -> Start:
    """The lathe that the options describe.

    Raises:
        ParameterError: If a value is not allowed.
    """
    return start_from(given_parameters(options))


def _number(text: str) -> Any:
    """A number, or the text itself: the parameter then says what it must be."""
    try:
        return float(text)
    except ValueError:
        return text
