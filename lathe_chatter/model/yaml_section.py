"""A mapping of a YAML file whose entries know their lines: a mistake is named with its line."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import yaml

from lathe_chatter.errors import MachineFileError, ParameterError, nearest_name
from lathe_chatter.model.quantity_fields import Quantity
from lathe_chatter.model.values_with_units import number_in, units_of

_START = yaml.Mark('', 0, 0, 0, None, None)
_MOST = 10.0
"""Relative standard error that is allowed."""


def text_of(node: yaml.Node) -> str:
    """What stands in the file."""
    return str(node.value if isinstance(node, yaml.ScalarNode) else yaml.serialize(node)).strip()


def section_of(text: str, file: str) -> Section:
    """The mapping that a YAML file is.

    Args:
        text: Of the file.
        file: What it is called where something is wrong with it.

    Raises:
        MachineFileError: If it is none.
    """
    try:
        return Section(yaml.compose(text, Loader=yaml.SafeLoader), file, '')
    except yaml.YAMLError as error:
        mark, problem = (getattr(error, name, None) for name in ('problem_mark', 'problem'))
        line = f', line {mark.line + 1}' if mark else ''
        said = f'{file}{line}: {problem or " ".join(str(error).split())}.'
    except RecursionError:
        said = f'{file}: it is nested too deeply.'
    raise MachineFileError(said)


class Section:
    """A mapping of a YAML file whose entries know their lines."""

    def __init__(self, node: yaml.Node | None, file: str, path: str) -> None:
        """Take the mapping at a path (`tool.modes[0]`) of a file, or refuse what is none."""
        self.file, self.path = file, path
        self.line = node.start_mark.line + 1 if node is not None else 1
        if not isinstance(node, yaml.MappingNode):
            raise self.refused('it must be a mapping of names to values')
        self.nodes: dict[str, yaml.Node] = {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise self.refused('a name must be a text', key)
            if key.value in self.nodes:
                raise self.refused(f'{key.value!r} stands there twice', key)
            self.nodes[key.value] = value

    def refused(self, text: str, node: yaml.Node | None = None) -> MachineFileError:
        """The error that says what is wrong, at a node or at the whole section."""
        line = node.start_mark.line + 1 if node is not None else self.line
        where = f'{self.path}: ' if self.path else ''
        return MachineFileError(f'{self.file}, line {line}: {where}{text}.')

    def only(self, *known: str) -> None:
        """Refuse a name that would otherwise be ignored in silence."""
        for key, node in self.nodes.items():
            if key not in known:
                near = nearest_name(key, known)
                hint = f'did you mean {near}?' if near else f'known are {", ".join(known)}'
                raise self.refused(f'there is no {key!r}: {hint}'.removesuffix('?'), node)

    def section(self, name: str) -> Section | None:
        """The mapping under a name, None where there is none."""
        node = self.nodes.get(name)
        path = f'{self.path}.{name}' if self.path else name
        return None if node is None else Section(node, self.file, path)

    def inner(self, name: str) -> Section:
        """The mapping under a name, an empty one where there is none."""
        return self.section(name) or Section(
            yaml.MappingNode('', [], _START, _START), self.file, name
        )

    def number(self, name: str, limits: Quantity) -> float | None:
        """The value under a name, in the unit of its limits."""
        node = self.nodes.get(name)
        if node is None:
            return None
        full, text = f'{self.path}.{name}', text_of(node)
        value = number_in(text, limits.unit) if isinstance(node, yaml.ScalarNode) else None
        units = units_of(limits.unit)
        allowed = limits.allowed + (f', in {units}' if units else '')
        said = str(ParameterError(full, text, '', allowed))
        if value is not None:
            try:
                return limits.check(full, value)
            except ParameterError as error:
                said = str(error)
        raise MachineFileError(f'{self.file}, line {node.start_mark.line + 1}: {said}')

    def numbers(self, table: Mapping[str, Quantity]) -> dict[str, float]:
        """Those values of a table that are there."""
        found = {name: self.number(name, limits) for name, limits in table.items()}
        return {name: value for name, value in found.items() if value is not None}

    def errors(
        self, values: Mapping[str, float], table: Mapping[str, Quantity]
    ) -> dict[str, float]:
        """Relative standard errors, given relative (`2 %`) or in the unit of the value."""
        section = self.section('errors')
        if section is None:
            return {}
        section.only(*table)
        found = {}
        for name, node in section.nodes.items():
            if name not in values:
                raise section.refused(f'{name} has an error here and no value beside it', node)
            if isinstance(node, yaml.ScalarNode) and node.value.rstrip().endswith('%'):
                relative = section.number(name, Quantity('standard error', high=_MOST))
            else:
                size = abs(values[name]) or 1.0
                limits = replace(table[name], low=0.0, high=_MOST * size, exclusive=False)
                relative = (section.number(name, limits) or 0.0) / size
            found[name] = relative or 0.0
        return found

    def items(self, name: str) -> Iterator[Section]:
        """The mappings of the list under a name, which must not be empty."""
        node = self.nodes.get(name)
        if not isinstance(node, yaml.SequenceNode) or not node.value:
            raise self.refused(f'{name} must be a list with an entry for each', node)
        for k, entry in enumerate(node.value):
            yield Section(entry, self.file, f'{self.path}.{name}[{k}]')
