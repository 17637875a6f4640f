"""A small table for notebooks: what a value shows of itself there."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape


def html_table(title: str, rows: Iterable[tuple[str, object, str]]) -> str:
    """A table of names, values and units; every text is escaped."""
    lines = ''.join(
        f'<tr><td style="text-align:left">{escape(name)}</td>'
        f'<td style="text-align:right">{escape(_shown(value))}</td>'
        f'<td style="text-align:left">{escape(unit)}</td></tr>'
        for name, value, unit in rows
    )
    return f'<table><caption>{escape(title)}</caption>{lines}</table>'


def _shown(value: object) -> str:
    """A number as short as six digits have it."""
    return f'{value:.6g}' if isinstance(value, float) else str(value)
