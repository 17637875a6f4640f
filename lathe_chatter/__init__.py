"""A virtual lathe with bearing clearance that cuts, chatters and is recorded in real time.

    import lathe_chatter as lc

gives the names below; each is loaded when it is first used (PEP 562), so that the import itself
costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lathe_chatter.detection import ChatterDetector, Estimate
    from lathe_chatter.errors import LatheChatterError, ParameterError
    from lathe_chatter.knocks import smallest_lasting_knock
    from lathe_chatter.lathe import Event, EventKind, VirtualLathe
    from lathe_chatter.lathe.config import LatheConfig
    from lathe_chatter.lathe.many_lathes import LatheSweep
    from lathe_chatter.lathe.state import LatheState
    from lathe_chatter.model import BearingContact, Cut, Machine, Mode
    from lathe_chatter.model.machine_file import MachineDescription, load_machine
    from lathe_chatter.plot_style import show_figure
    from lathe_chatter.recording import Run, RunWriter, Samples, read_run
    from lathe_chatter.recording.recover import recover
    from lathe_chatter.recording.resimulate import resimulate
    from lathe_chatter.recording.verify import verify
    from lathe_chatter.report.stability_chart import plot_lobes
    from lathe_chatter.scenario import Scenario, load_scenario
    from lathe_chatter.scenario.simulation import simulate
    from lathe_chatter.stability import (
        ProcessDamping,
        SpeedLaw,
        critical_depth,
        critical_depths,
        floquet,
        growth_map,
        lobe_boundary,
        recommend_speeds,
        rightmost_root,
        rightmost_roots,
        safe_limit,
    )
    from lathe_chatter.stability.probability import stability_probability
    from lathe_chatter.tap_test import fit_modes, read_frequency_responses

__all__ = [
    'BearingContact',
    'ChatterDetector',
    'Cut',
    'Estimate',
    'Event',
    'EventKind',
    'LatheChatterError',
    'LatheConfig',
    'LatheState',
    'LatheSweep',
    'Machine',
    'MachineDescription',
    'Mode',
    'ParameterError',
    'ProcessDamping',
    'Run',
    'RunWriter',
    'Samples',
    'Scenario',
    'SpeedLaw',
    'VirtualLathe',
    '__version__',
    'critical_depth',
    'critical_depths',
    'fit_modes',
    'floquet',
    'growth_map',
    'load_machine',
    'load_scenario',
    'lobe_boundary',
    'plot_lobes',
    'read_frequency_responses',
    'read_run',
    'recommend_speeds',
    'recover',
    'resimulate',
    'rightmost_root',
    'rightmost_roots',
    'safe_limit',
    'show_figure',
    'simulate',
    'smallest_lasting_knock',
    'stability_probability',
    'verify',
]

__version__: str

# fmt: off
_MODULES = {
    'detection': ('ChatterDetector', 'Estimate'),
    'errors': ('LatheChatterError', 'ParameterError'),
    'knocks': ('smallest_lasting_knock',),
    'lathe': ('Event', 'EventKind', 'VirtualLathe'),
    'lathe.config': ('LatheConfig',),
    'lathe.state': ('LatheState',),
    'lathe.many_lathes': ('LatheSweep',),
    'model': ('BearingContact', 'Cut', 'Machine', 'Mode'),
    'model.machine_file': ('MachineDescription', 'load_machine'),
    'plot_style': ('show_figure',),
    'recording': ('Run', 'RunWriter', 'Samples', 'read_run', 'recover', 'resimulate', 'verify'),
    'report.stability_chart': ('plot_lobes',),
    'scenario': ('Scenario', 'load_scenario'),
    'scenario.simulation': ('simulate',),
    'stability.probability': ('stability_probability',),
    'stability': (
        'ProcessDamping', 'SpeedLaw', 'critical_depth', 'critical_depths', 'floquet',
        'growth_map', 'lobe_boundary', 'recommend_speeds', 'rightmost_root', 'rightmost_roots',
        'safe_limit',
    ),
    'tap_test': ('fit_modes', 'read_frequency_responses'),
}
# fmt: on
_HOME = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name == '__version__':  # package.xml has it, and what is installed has it from there
        from importlib.metadata import version

        value = version(__name__)
    elif name in _HOME:
        value = getattr(import_module(f'{__name__}.{_HOME[name]}'), name)
    else:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*(name for name in globals() if name.startswith('__')), *__all__})
