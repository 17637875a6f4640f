"""A cell of real nodes plays a scenario and is recorded: what `lathe-chatter run` starts."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from itertools import count
from pathlib import Path
from typing import Any, Protocol

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from lathe_chatter.errors import NodeFailedError, RunFailedError
from lathe_chatter.model.lathe_parameter_table import LATHE
from lathe_chatter.nodes.end_signals import DeferredSignals
from lathe_chatter.nodes.listening_clock import DISCOVERY
from lathe_chatter.nodes.log_folder import ensure_log_folder
from lathe_chatter.nodes.node_processes import ProcessGroup
from lathe_chatter.nodes.operator_node import Operator, parameter_arguments
from lathe_chatter.nodes.parameter_tables import MONITOR, SUPERVISOR, ModelSource
from lathe_chatter.nodes.shared_memory import free_ports
from lathe_chatter.page.server import answers, free_port, open_in_browser
from lathe_chatter.scenario import Scenario

try:
    from domain_coordinator import domain_id
except ImportError:  # not every installation of ROS 2 has it
    domain_id = None

_START_PATIENCE = 60.0
"""s for the nodes to find each other: 20 where others keep the machine busy."""
_BUSY = 2.0
"""Times the usual time, at most, until others are known on a busy machine."""
_SETTLING = 0.3
"""s in which the graph has heard that nodes have ended."""
_OURS = dict.fromkeys(
    ('lathe', 'chatter_monitor', 'run_recorder', 'chatter_supervisor', 'lathe_operator'), 1
)
"""How many nodes of each name a run has."""
_READERS = 3
"""Recorder, monitor and operator: the lathe cuts nothing before it has met them all."""
_GRACE = 10.0
"""s of simulated time beyond a scenario's end for what the monitor is expected to say."""


class Screen(Protocol):
    """Where it is told what happens; `lathe_chatter.cli.console` has one."""

    def say(self, text: str) -> None:
        """Print a sentence."""

    def working(self, text: str) -> AbstractContextManager[None]:
        """Show that something is going on."""

    def progress(self, what: str, total: float, unit: str) -> AbstractContextManager[Any]:
        """Show a bar of progress, which has `show(done, what=...)`."""


def play(
    scenario: Scenario, file: Path, output: Path, screen: Screen, *, page: bool = False
) -> bool:
    """Start the cell, play, and end the cell.

    Args:
        scenario: What to play.
        file: Of the scenario, to be kept in the run.
        output: Folder of the run, to make.
        screen: Where to tell what happens.
        page: Whether nothing is played, and whoever has the operator's page open operates,
            until it is interrupted.

    Returns:
        Whether it was interrupted.

    Raises:
        RunFailedError: If the domain has such nodes already, or one of ours fails.
        ParameterError: If a parameter of the start is not allowed.
    """
    for name, value in scenario.parameters.items():
        if name not in LATHE:
            raise RunFailedError(f'The scenario {scenario.name}: {LATHE.unknown(name)}')
        LATHE[name].check(value)
    for name in scenario.supervisor or {}:
        if name not in SUPERVISOR:
            raise RunFailedError(f'The scenario {scenario.name}: {SUPERVISOR.unknown(name)}')
    SUPERVISOR.complete(_supervisor_of(scenario))
    if logs := ensure_log_folder():
        screen.say(logs)
    for sentence in free_ports():
        screen.say(sentence)
    try:
        with _free_domain(screen), DeferredSignals() as held:
            rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
            operator = Operator(scenario, tell=screen.say)
            executor = SingleThreadedExecutor()
            executor.add_node(operator)

            def spin() -> None:
                executor.spin_once(timeout_sec=0.1)
                held.deliver()

            try:
                follow = _serve_page if page else _follow
                return _play(operator, spin, file, output, screen, follow)
            finally:
                _let_graph_settle(executor)
                executor.shutdown()
                operator.destroy_node()
                rclpy.try_shutdown()
    except KeyboardInterrupt:  # while the nodes were ending: they have ended in order
        return True


def _supervisor_of(scenario: Scenario) -> dict[str, Any]:
    """The parameters of the supervisor of a scenario as its table takes them."""
    given = scenario.supervisor or {}
    return {name: SUPERVISOR[name].parsed(value) for name, value in given.items()}


@contextmanager
def _free_domain(screen: Screen) -> Iterator[None]:
    """Take a ROS domain that no other run on this machine has, unless the user has chosen one."""
    if os.environ.get('ROS_DOMAIN_ID') or domain_id is None:
        yield
        return
    with domain_id(count().__next__) as number:
        os.environ['ROS_DOMAIN_ID'] = str(number)
        if number:
            screen.say(f'Another program may have the ROS domain 0: this one takes {number}.')
        try:
            yield
        finally:
            del os.environ['ROS_DOMAIN_ID']


def _play(  # noqa: PLR0913, PLR0917 -- what is played, where to, and how
    operator: Operator,
    spin_once: Callable[[], None],
    file: Path,
    output: Path,
    screen: Screen,
    follow: Callable[[Operator, Callable[[], None], Screen], None],
) -> bool:
    """Play with an operator who is there; whether it was interrupted."""
    interrupted = False
    with ProcessGroup() as cell:

        def spin() -> None:
            spin_once()
            cell.check()

        try:
            with screen.working('Starting the monitor and the recorder ...'):
                _look_around(operator, spin)
                cell.start(
                    'run_recorder',
                    parameter_arguments(
                        {'output': str(output), 'attachments': [str(file.resolve())]}
                    ),
                )
                given = operator.scenario.parameters
                cell.start(
                    'chatter_monitor',
                    # The machine alone: of the cut it knows what the samples tell. It need not ask
                    # the lathe, whose answer may come after the first chatter on a busy machine.
                    parameter_arguments(
                        {
                            'model': ModelSource.PARAMETERS.value,
                            **{name: given[name] for name in given if name in MONITOR},
                        }
                    ),
                )
                if operator.scenario.supervisor is not None:
                    supervisor = _supervisor_of(operator.scenario)
                    cell.start('chatter_supervisor', parameter_arguments(supervisor))
                _await_nodes(operator, spin)
            cell.start(
                'lathe',
                parameter_arguments({'await_readers': _READERS, **operator.scenario.parameters}),
            )
            follow(operator, spin, screen)
        except KeyboardInterrupt:
            interrupted = True
        complaints = cell.end()
    if complaints:
        raise RunFailedError(' '.join(complaints))
    return interrupted


def _let_graph_settle(executor: SingleThreadedExecutor) -> None:
    """Wait until nobody is told any more that the nodes of the cell are gone.

    Fast DDS may wait for itself for ever where a participant goes meanwhile (`exit_within`).
    """
    until = time.monotonic() + _SETTLING
    while (left := until - time.monotonic()) > 0.0:
        executor.spin_once(timeout_sec=left)


def _look_around(operator: Operator, spin: Callable[[], None]) -> None:
    """See for a while whether the domain is free, before anything is started in it."""
    load = os.getloadavg()[0] / (os.cpu_count() or 1)
    until = time.monotonic() + DISCOVERY * min(max(1.0, load), _BUSY)
    while time.monotonic() < until:
        spin()
        _refuse_company(operator, {'lathe_operator': 1})


def _refuse_company(operator: Operator, ours: Mapping[str, int] = _OURS) -> None:
    """See that the domain has no nodes of our names but ours.

    Raises:
        RunFailedError: If it has: they would be taken for each other.
    """
    places = operator.get_node_names_and_namespaces()
    names = [name for name, namespace in places if namespace == operator.get_namespace()]
    other = next((name for name in _OURS if names.count(name) > ours.get(name, 0)), None)
    if other is not None:
        raise RunFailedError(
            f'Another {other} is in this ROS domain: end it, or set ROS_DOMAIN_ID to another '
            'number.'
        )


def _await_nodes(operator: Operator, spin: Callable[[], None]) -> None:
    """Wait until the recorder and the monitor are there, so that nothing of the lathe is lost."""
    until = time.monotonic() + _START_PATIENCE
    wanted = {'run_recorder', 'chatter_monitor'}
    if operator.scenario.supervisor is not None:
        wanted.add('chatter_supervisor')
    while missing := wanted - set(operator.get_node_names()):
        spin()
        _refuse_company(operator)
        if time.monotonic() > until:
            names = ' and '.join(sorted(missing))
            raise RunFailedError(f'{names} did not appear within {_START_PATIENCE:g} s.')
    _refuse_company(operator, {**_OURS, 'lathe': 0})


def _follow(operator: Operator, spin: Callable[[], None], screen: Screen) -> None:
    """Spin until the scenario is played, with a bar of simulated time."""
    scenario = operator.scenario
    operator.playing = True
    until = time.monotonic() + _START_PATIENCE
    with screen.progress('waiting for the lathe', scenario.duration, 's') as bar:
        while not _finished(operator, scenario):
            spin()
            _refuse_company(operator)
            if operator.failure is not None:
                raise operator.failure
            if operator.time == 0.0 and time.monotonic() > until:
                raise RunFailedError(f'No sample of the lathe came within {_START_PATIENCE:g} s.')
            bar.show(
                min(operator.time, scenario.duration),
                what=operator.state if operator.time else 'waiting for the lathe',
            )


def _serve_page(operator: Operator, spin: Callable[[], None], screen: Screen) -> None:
    """Serve the operator's page until Ctrl-C; one that was killed is started again."""
    port = free_port()
    url = f'http://127.0.0.1:{port}/'
    opened = False
    with ProcessGroup() as pages:

        def follow() -> None:
            spin()
            _refuse_company(operator)
            pages.check()

        while True:
            pages.start('operator_page', parameter_arguments({'port': port}))
            with screen.working('Starting the page ...'):
                while not answers(port):
                    follow()  # one that cannot start now could not the next time
            screen.say(f'The page is at {url} until Ctrl-C.')
            if not opened:
                opened = True
                open_in_browser(url)
            try:
                with screen.working(f'The page is at {url} until Ctrl-C ...'):
                    while True:
                        follow()
            except NodeFailedError as error:
                screen.say(f'{error} It is started again.')
                pages.end()


def _finished(operator: Operator, scenario: Scenario) -> bool:
    """Whether the time is over, and the monitor has said what is expected or will not."""
    if operator.time < scenario.duration:
        return False
    pending = not operator.idle or any(
        expected and word not in operator.player.said for word, expected in scenario.expect.items()
    )
    return not pending or operator.time >= scenario.duration + _GRACE
