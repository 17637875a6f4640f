"""The executables of the nodes, which hear a signal from their first moment on.

    python -m lathe_chatter.nodes.entry_points NODE

Where there is no ROS 2, they say so in a sentence.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

from lathe_chatter.nodes.end_signals import exit_on_end_signals
from lathe_chatter.standard_streams import hold_standard_streams


def lathe() -> None:
    """Run the node `lathe`."""
    _run('lathe_node')


def chatter_monitor() -> None:
    """Run the node `chatter_monitor`."""
    _run('monitor_node')


def run_recorder() -> None:
    """Run the node `run_recorder`."""
    _run('recorder_node')


def chatter_supervisor() -> None:
    """Run the node `chatter_supervisor`."""
    _run('supervisor_node')


def cell() -> None:
    """Run lathe, monitor and recorder in one process."""
    _run('composition')


def operator_page() -> None:
    """Run the node `operator_page`."""
    _run('operator_page_node')


def no_ros(error: ImportError) -> str:
    """What to say where a package of ROS 2 cannot be imported."""
    checkout = (Path(__file__).parents[2] / 'Makefile').is_file()
    make = ', or use `make run`, which installs what it needs' if checkout else ''
    return f'ROS 2 is not there ({error}): source an installation{make}.'


def _run(module: str) -> None:
    hold_standard_streams()
    exit_on_end_signals()  # until the node, whose imports take a second, hears them itself
    try:
        node = import_module(f'lathe_chatter.nodes.{module}')
    except ImportError as error:
        sys.stderr.write(f'{no_ros(error)}\n')
        raise SystemExit(2) from None
    node.main()


if __name__ == '__main__':
    nodes = (lathe, chatter_monitor, run_recorder, chatter_supervisor, operator_page, cell)
    {each.__name__: each for each in nodes}[sys.argv.pop(1)]()
