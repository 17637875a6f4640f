"""A mapping of a YAML file whose entries know their lines: a mistake is named with its line."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import yaml

from lathe_chatter.errors import MachineFileError, ParameterError, nearest_name
from lathe_chatter.model.parameter_table import Row

_START = yaml.Mark('', 0, 0, 0, None, None)


def text_of(node: yaml.Node) -> str:
    """What stands in the file."""
    return str(node.value if isinstance(node, yaml.ScalarNode) else yaml.serialize(node)).strip()


class Section:
    """A mapping of a YAML file.

    Args:
        node: What should be one, at a path (`tool.modes[0]`) of the file; None is an empty one.
        file: What the file is called where something is wrong with it.
        path: As above.

    Raises:
        MachineFileError: Where something is wrong, with file, line, field and what is allowed;
            all methods raise it.
    """

    def __init__(self, node: yaml.Node | None, file: str, path: str) -> None:
        """See the class."""
        node = node or yaml.MappingNode('', [], _START, _START)
        self.file, self.path, self._node, self.nodes = file, path, node, dict[str, yaml.Node]()
        if not isinstance(node, yaml.MappingNode):
            raise self.refused('it must be a mapping of names to values')
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise self.refused('a name must be a text', key)
            if key.value in self.nodes:
                raise self.refused(f'{key.value!r} stands there twice', key)
            self.nodes[key.value] = value

    def refused(
        self, text: str, node: yaml.Node | None = None, field: str = ''
    ) -> MachineFileError:
        """The error that says what is wrong, at a node, a field or at the whole section."""
        path = '.'.join(filter(None, (self.path, field)))
        where = f'{path}: ' if path else ''
        line = (node or self._node).start_mark.line + 1
        return MachineFileError(f'{self.file}, line {line}: {where}{text}.')

    def only(self, *known: str) -> None:
        """Refuse a name that would otherwise be ignored in silence."""
        for key, node in self.nodes.items():
            if key not in known:
                near = nearest_name(key, known)
                hint = f'did you mean {near}' if near else f'known are {", ".join(known)}'
                raise self.refused(f'there is no {key!r}: {hint}', node)

    def inner(self, name: str) -> Section:
        """The mapping under a name, an empty one where there is none."""
        path = f'{self.path}.{name}' if self.path else name
        return Section(self.nodes.get(name), self.file, path)

    def items(self, name: str) -> Iterator[Section]:
        """The mappings of the list under a name, which must not be empty."""
        node = self.nodes.get(name)
        if not isinstance(node, yaml.SequenceNode) or not node.value:
            raise self.refused(f'{name} must be a list with an entry for each', node)
        for k, entry in enumerate(node.value):
            yield Section(entry, self.file, f'{self.path}.{name}[{k}]'.lstrip('.'))

    def values(self, rows: Mapping[str, Row], *others: str) -> dict[str, Any]:
        """Those values of a table that are there; besides, there may only be some others."""
        self.only(*rows, *others)
        return {n: self.value(n, self.nodes[n], row) for n, row in rows.items() if n in self.nodes}

    def value(self, name: str, node: yaml.Node, row: Row) -> Any:
        """What stands under a name, as a row holds it: a number in its unit, a word, true."""
        full = f'{self.path}.{name}' if self.path else name
        value = row.parsed(text_of(node))
        if isinstance(row.default, bool):
            value = {'true': True, 'false': False}.get(text_of(node), value)
        try:
            if not isinstance(node, yaml.ScalarNode):
                raise ParameterError(full, text_of(node), '', row.allowed)  # noqa: TRY301 -- as all
            return replace(row, name=full).check(value)
        except ParameterError as error:
            line = node.start_mark.line + 1
            raise MachineFileError(f'{self.file}, line {line}: {error}') from None


def section_of(text: str, file: str) -> Section:
    """The mapping that a YAML file is.

    Raises:
        MachineFileError: If it is none.
    """
    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.YAMLError as error:
        mark, problem = (getattr(error, name, None) for name in ('problem_mark', 'problem'))
        line = f', line {mark.line + 1}' if mark else ''
        said = f'{file}{line}: {problem or " ".join(str(error).split())}.'
        raise MachineFileError(said) from None
    except RecursionError:
        raise MachineFileError(f'{file}: it is nested too deeply.') from None
    return Section(node or yaml.ScalarNode('', '', _START), file, '')
