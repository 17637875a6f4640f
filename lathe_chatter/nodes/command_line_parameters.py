"""The parameters of a command line, dealt to the nodes of a process: none is lost in silence.

rcl compares NODE of `-p NODE:PARAMETER:=VALUE` with the full name of a node, takes no namespace
there, and passes over what names nobody: a lathe in a namespace would cut with its defaults.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from lathe_chatter.errors import StartError
from lathe_chatter.model.parameter_table import ParameterTable

OF_RCLPY = ('use_sim_time', 'start_type_description_service')
OF_QOS = 'qos_overrides.'
_RENAMES = re.compile(r'(?:([^:]+):)?__(node|name|ns):=(.+)')
_SECTION = 'ros__parameters'

Members = Mapping[str, ParameterTable]
"""The nodes of a process by the names that they have before any is remapped."""
Own = Mapping[str, list[str]]
"""For each of them, its own `cli_args` as `rclpy.node.Node` takes them."""


def deal_parameters(args: Sequence[str], members: Members) -> tuple[list[str], Own, list[str]]:
    """Deal the parameters of a command line.

    NODE may be the name of a node, that which it is remapped to, or its full one. A parameter
    without NODE goes to each node that has it.

    Args:
        args: As of the process.
        members: Its nodes.

    Returns:
        The arguments without those parameters; these for each node; and a sentence for each file
        of parameters that has none for any of them.

    Raises:
        StartError: If NODE is none of them.
    """
    rest: list[str] = []
    given: dict[str, list[str]] = {'-p': [], '-r': [], '--params-file': []}
    short = {'--param': '-p', '--remap': '-r'}
    words, ros = iter(args), False
    for word in words:
        ros = word == '--ros-args' or (ros and word != '--')
        key = short.get(word, word)
        value = next(words, None) if ros and key in given else None
        if value is not None:
            given[key].append(value)
        if value is None or key != '-p' or ':=' not in value:  # which rcl complains of
            rest += [word] if value is None else [word, value]
    names = {member: _full_name(member, given['-r']) for member in members}
    bare: dict[str, list[str]] = {member: [] for member in members}
    named: dict[str, list[str]] = {member: [] for member in members}
    for rule in given['-p']:
        whose, _, parameter = rule.partition(':=')[0].rpartition(':')
        reached = _having(parameter, members)
        if whose:
            reached = [m for m, n in names.items() if whose in {m, n, n.rpartition('/')[2]}]
        if not reached:
            raise StartError(f'-p {rule} reaches nobody: {_who(names)} here.')
        for member in reached:
            if ':=' in rule:
                (named if whose else bare)[member] += ['-p', rule.removeprefix(f'{whose}:')]
    dealt = {m: ['--ros-args', *bare[m], *named[m]] for m in members if bare[m] or named[m]}
    missed = [
        f'The file {file} has parameters for {", ".join(found)} and for nobody here: '
        f'{_who(names)}.'
        for file in given['--params-file']
        if (found := _sections(file)) and not _reach(found, names.values())
    ]
    return rest, {member: dealt.get(member, []) for member in members}, missed


def _full_name(member: str, remaps: Sequence[str]) -> str:
    """The name that a node will have; of several rules the first that matches counts."""
    kept = {'ns': '/', 'node': member}
    for rule in reversed(remaps):
        match = _RENAMES.fullmatch(rule)
        if match is not None and match[1] in {None, member}:
            kept['ns' if match[2] == 'ns' else 'node'] = match[3]
    return f'/{kept["ns"].strip("/")}/{kept["node"]}'.replace('//', '/')


def _having(parameter: str, members: Members) -> list[str]:
    """The nodes that have a parameter; else the one that has most to say of it."""
    if parameter in OF_RCLPY or parameter.startswith(OF_QOS):
        return list(members)
    have = [member for member, table in members.items() if parameter in table]
    near = [member for member, table in members.items() if table.nearest(parameter)]
    return have or (near or list(members))[:1]


def _who(names: Mapping[str, str]) -> str:
    *others, last = names.values()
    return f'{", ".join(others)} and {last} are' if others else f'{last} is'


def _sections(file: str) -> list[str]:
    """The full names, perhaps with wildcards, of the nodes that a file has parameters for."""

    def found(part: Any, name: str) -> Iterator[str]:
        for key, value in part.items() if isinstance(part, dict) else ():
            if key == _SECTION:
                yield name
            else:
                yield from found(value, f'{name}/{str(key).strip("/")}')

    try:
        return list(found(yaml.safe_load(Path(file).read_text(encoding='utf-8')), ''))
    except (OSError, ValueError, yaml.YAMLError):
        return []  # rcl says what is wrong


def _reach(sections: Sequence[str], names: Collection[str]) -> bool:
    """Whether one of some names is that of a section."""
    wild = {'/**': r'(/\w+)*', '/*': r'/\w+'}
    patterns = [re.sub(r'/\*\*?', lambda star: wild[star[0]], section) for section in sections]
    return any(re.fullmatch(pattern, name) for pattern in patterns for name in names)
