"""A cell in one process: lathe, monitor and recorder, for machines with few cores.

The nodes are the same ones, with the same names; parameters are given with the name of the node,
as in `-p lathe:depth_of_cut:=0.001`, or in a file. Between nodes of one process samples are
handed over by the thread that publishes them, and one loop wakes all three.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from itertools import chain
from typing import Any

from rclpy.context import Context
from rclpy.executors import Executor

from lathe_chatter.errors import RecordingFailedError
from lathe_chatter.nodes.command_line_parameters import Own
from lathe_chatter.nodes.lathe_node import LatheNode
from lathe_chatter.nodes.monitor_node import MonitorNode
from lathe_chatter.nodes.node_main import make_executor, run_node
from lathe_chatter.nodes.parameter_node import ParameterNode
from lathe_chatter.nodes.parameter_tables import LATHE, MONITOR, RECORDER
from lathe_chatter.nodes.real_time_loop import Served, ask_for_short_slices, spin_together
from lathe_chatter.nodes.recorder_node import RecorderNode

USAGE = """usage: cell [--ros-args -p NODE:PARAMETER:=VALUE ...]

The nodes lathe, chatter_monitor and run_recorder in one process, for instance
  cell --ros-args -p lathe:depth_of_cut:=0.001 -p run_recorder:output:=runs/today
NODE is the same in a namespace (-r __ns:=/cell1), or what the node is remapped to. A parameter
without NODE goes to each node that has it; one that reaches nobody keeps the cell from starting.
`lathe --help`, `chatter_monitor --help` and `run_recorder --help` list their parameters."""

MEMBERS = {'lathe': LATHE, 'chatter_monitor': MONITOR, 'run_recorder': RECORDER}
_SERVE_PERIOD = 50_000_000
"""ns from one look for requests to monitor and recorder to the next."""


class _CellRecorder(RecorderNode):
    """A recorder whose failure ends the recording, not the cell."""

    failed = False

    def wake(self) -> None:
        """Do what is due; once the disk takes no more, nothing is."""
        try:
            super().wake()
        except RecordingFailedError:
            self.failed = True  # it has said so


class Cell:
    """Three nodes that begin, finish and go together, as `run_node` wants it of one.

    Args:
        own: The `cli_args` of each by its name, see `deal_parameters`.
        options: As for `rclpy.node.Node`, for each of them.
    """

    def __init__(self, own: Own, **options: Any) -> None:
        """Make them, those first that listen."""
        self._nodes: list[ParameterNode] = []
        try:
            self.recorder = self._add(_CellRecorder, own['run_recorder'], options)
            self.monitor = self._add(MonitorNode, own['chatter_monitor'], options)
            self.lathe = self._add(LatheNode, own['lathe'], options)
        except BaseException:
            self.destroy_node()
            raise

    def _add(self, kind: Callable[..., Any], own: list[str], options: dict[str, Any]) -> Any:
        node = kind(by_timer=False, cli_args=own, **options)
        self._nodes.append(node)
        return node

    @property
    def context(self) -> Context:
        """That of all three."""
        return self.lathe.context

    @property
    def publishers(self) -> Iterator[Any]:
        """All that they publish with."""
        return chain.from_iterable(node.publishers for node in self._nodes)

    def begin(self) -> None:
        """Begin to record, first of all with what parameters the lathe was started."""
        self.recorder.begin()
        self.lathe.announce()

    def finish(self) -> None:
        """Finish what they do, the recorder last: it has what the others said."""
        with ExitStack() as stack:
            for node in self._nodes:  # called in the opposite order
                stack.callback(node.finish)

    def destroy_node(self) -> None:
        """Let all three go."""
        with ExitStack() as stack:
            for node in self._nodes:
                stack.callback(node.destroy_node)


def _spin(executor: Executor, cell: Cell, ended: Callable[[], bool]) -> None:
    """Serve all three until `ended` says so."""
    polled = [
        Served(make_executor(node), node, _SERVE_PERIOD) for node in (cell.monitor, cell.recorder)
    ]
    spin_together([Served(executor, cell.lathe), *polled], ended)


def main() -> None:
    """Run the cell until it is told to end.

    Raises:
        SystemExit: With 1 if the disk took no more.
    """
    ask_for_short_slices()
    cells: list[Cell] = []

    def make(own: Own) -> Cell:
        cells.append(Cell(own))
        return cells[0]

    run_node(make, MEMBERS, spin=_spin, usage=USAGE)
    if cells and cells[0].recorder.failed:
        raise SystemExit(1)
