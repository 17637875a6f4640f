"""The parts of the reference that are made from the code: verbs, and names of Python."""

from __future__ import annotations

import os
from pathlib import Path

import lathe_chatter
from lathe_chatter.cli.verbs import VERBS, parser

GROUPS = {
    'Cutting': (
        'VirtualLathe',
        'Cut',
        'Machine',
        'Mode',
        'BearingContact',
        'LatheConfig',
        'LatheState',
        'LatheSweep',
        'Event',
        'EventKind',
        'load_machine',
        'MachineDescription',
    ),
    'Stability': (
        'rightmost_root',
        'rightmost_roots',
        'critical_depth',
        'critical_depths',
        'lobe_boundary',
        'safe_limit',
        'growth_map',
        'floquet',
        'recommend_speeds',
        'stability_probability',
        'smallest_lasting_knock',
        'plot_lobes',
        'show_figure',
        'SpeedLaw',
        'ProcessDamping',
    ),
    'Judging': ('ChatterDetector', 'Estimate'),
    'Recording': (
        'read_run',
        'Run',
        'Samples',
        'RunWriter',
        'verify',
        'resimulate',
        'recover',
        'simulate',
        'Scenario',
        'load_scenario',
    ),
    'Tap tests': ('read_frequency_responses', 'fit_modes'),
    'Errors': ('LatheChatterError', 'ParameterError'),
}


def write_reference(folder: Path) -> None:
    """Write every part that is made, anew."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / 'commands.md').write_text(_commands(), encoding='utf-8')
    (folder / 'python.md').write_text(_python(), encoding='utf-8')


def _commands() -> str:
    os.environ['COLUMNS'] = '90'
    lines = []
    verbs = next(action for action in parser()._actions if action.dest == 'verb')  # noqa: SLF001
    for verb in VERBS:
        text = verbs.choices[verb].format_help()  # type: ignore[index,call-overload]
        lines += [f'## {verb}', '', '```text', text.strip(), '```', '']
    return '\n'.join(lines)


def _python() -> str:
    grouped = {name for names in GROUPS.values() for name in names}
    rest = sorted(set(lathe_chatter.__all__) - grouped - {'__version__'})
    groups = {**GROUPS, 'More': tuple(rest)} if rest else GROUPS
    lines = []
    for title, names in groups.items():
        lines += [f'## {title}', '', '```{eval-rst}', '.. currentmodule:: lathe_chatter', '']
        for name in names:
            value = getattr(lathe_chatter, name)
            if not (value.__doc__ or '').strip():
                raise SystemExit(f'lathe_chatter.{name} has no docstring.')
            kind = 'autoclass' if isinstance(value, type) else 'autofunction'
            lines += [f'.. {kind}:: {name}', '   :members:' if kind == 'autoclass' else '', '']
        lines += ['```', '']
    return '\n'.join(lines)
