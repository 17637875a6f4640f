"""The data card: what a data set is, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from jinja2 import StrictUndefined, Template

from lathe_chatter.dataset.plan import Plan
from lathe_chatter.dataset.windows import PLACE, TRUTH
from lathe_chatter.model.parameters import LATHE
from lathe_chatter.samples.columns import UNITS


def data_card(plan: Plan, code: str, entries: Sequence[Mapping[str, Any]]) -> str:
    """The card of a data set that is complete, from the entries of its manifest."""
    splits = []
    for name, machines in plan.machines_of().items():
        own = [entry for entry in entries if entry['part'].startswith(f'{name}/')]
        windows, stable = (sum(entry[key] for entry in own) for key in ('windows', 'stable'))
        splits.append((name, len(machines), windows, stable))
    signals = {name: (UNITS[name], 'signal, as 32-bit numbers') for name in plan.columns}
    drawn = {name: (LATHE[name].unit, LATHE[name].meaning) for name in plan.drawn}
    text = files(__package__).joinpath('card.md.j2').read_text(encoding='utf-8')
    card: str = Template(text, undefined=StrictUndefined).render(
        plan=plan,
        code=code,
        windows=sum(entry['windows'] for entry in entries),
        early=sum(entry['ended_early'] for entry in entries),
        processors=sorted({entry['processor'] for entry in entries}),
        splits=splits,
        columns={**PLACE, **signals, **TRUTH, **drawn},
    )
    return card
