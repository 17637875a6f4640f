"""The life of a node's process: start errors as one sentence, and an orderly end on a signal."""

from __future__ import annotations

import ctypes
import sys
import time
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

import rclpy
from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import (
    Executor,
    ExternalShutdownException,
    SingleThreadedExecutor,
)
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.qos_overriding_options import InvalidQosOverridesError
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from lathe_chatter.errors import LatheChatterError, StartError
from lathe_chatter.nodes.command_line_parameters import Members, Own, deal_parameters
from lathe_chatter.nodes.end_signals import (
    DeferredSignals,
    ignore_end_signals,
    raise_on_end_signals,
)
from lathe_chatter.nodes.log_folder import ensure_log_folder
from lathe_chatter.nodes.real_time_loop import LOOK_UP
from lathe_chatter.nodes.shared_memory import free_ports

try:
    from rclpy.experimental.events_executor import EventsExecutor
except ImportError:  # an rclpy older than the executor
    EventsExecutor = None


class Runnable(Protocol):
    """A node, or several as one, that `run_node` makes, serves and lets go."""

    @property
    def context(self) -> Any:
        """Of rclpy."""

    @property
    def publishers(self) -> Any:
        """Everything that it publishes with."""

    def begin(self) -> None:
        """Begin what has to be finished."""

    def finish(self) -> None:
        """Put on disk what must be kept."""

    def destroy_node(self) -> None:
        """Go."""


_Node = TypeVar('_Node', bound=Runnable)
Spin = Callable[[Executor, _Node, Callable[[], bool]], None]
"""Serves a node with an executor until a function says that it is told to end."""

_DELIVERY_TIMEOUT = 2.0
"""s that the readers of a node have, at its end, to take what was published last."""

_DISCOVERY_SETTLE = 0.2
"""s in which a finished node hears of others that ended just before it: Fast DDS may crash where a
participant goes meanwhile."""
_SHUTDOWN_TIMEOUT = 5.0
"""s that the middleware has to let go of a node that has finished."""

_BY_THREAD = 2  # SIGEV_THREAD of sigevent(3type): the timer calls a function
_CLOCK_MONOTONIC = 1
_TIMER_FUNCTIONS = ('timer_create', 'timer_settime', '_exit')
_START_ERRORS = (
    LatheChatterError,
    InvalidQosOverridesError,
    NameValidationException,
    ParameterException,
    RuntimeError,  # rcl's: arguments that are no ROS arguments
    OSError,
)


def run_node(
    make: Callable[[Own], _Node],
    members: Members,
    *,
    spin: Spin[_Node] | None = None,
    usage: str = '',
) -> None:
    """Make a node and spin it until SIGINT, SIGTERM or a shutdown of its context.

    The node is finished and destroyed in every case. Should the middleware not let go of it the
    process ends all the same, for this is the last that it does.

    Args:
        make: Makes the node once rclpy is initialised, with what is given to each member alone.
        members: The nodes by name, each with the table of its parameters.
        spin: How the node is served until it is told to end; by default as `serve` does.
        usage: What `--help` prints; by default the table of the one node.

    Raises:
        SystemExit: With 0 after `--help`; with 2 and a sentence on stderr if the node cannot
            start as it was asked to.
    """
    came: list[int] = []
    node: _Node | None = None
    begun = False
    try:
        came = raise_on_end_signals()
        args, own, missed = deal_parameters(sys.argv, members)
        _refuse_words(args, usage or _usage(members))
        if logs := ensure_log_folder():
            sys.stderr.write(f'{logs}\n')
        missed += free_ports()
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        for sentence in missed:
            get_logger(next(iter(members))).warning(sentence)
        node = make(own)
        # rclpy's own handlers would shut the context down under a callback that is publishing,
        # and the node could say nothing more at its end.
        with DeferredSignals() as signals:
            node.begin()
            begun = True
            (spin or serve)(make_executor(node), node, signals.came)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except _START_ERRORS as error:
        if begun:
            raise
        if came:  # the interrupt, raised amid a call into C++, came out as another error
            return
        sys.stderr.write(f'{error}\n')
        raise SystemExit(2) from None
    finally:
        ignore_end_signals()
        _finish(node)


def _usage(members: Members) -> str:
    ((name, table),) = members.items()
    return table.usage(name)


def _refuse_words(args: list[str], usage: str) -> None:
    """Answer `--help`, and refuse any other word: what is ignored would be taken for heard.

    Raises:
        SystemExit: After `--help`.
        StartError: On a word that is no ROS argument.
    """
    words = remove_ros_args(args)[1:]
    if '--help' in words or '-h' in words:
        sys.stdout.write(f'{usage}\n')
        raise SystemExit(0)
    if words:
        raise StartError(
            f'There is no argument {words[0]!r}: a parameter is given as in '
            '`--ros-args -p name:=value`, and --help lists them.'
        )


def _finish(node: Runnable | None) -> None:
    """End a node, whatever fails on the way, and then rclpy."""
    try:
        if node is not None:
            try:
                _deliver(node)
            finally:
                node.finish()
    finally:
        exit_within(_SHUTDOWN_TIMEOUT, _exit_code())
        try:
            if node is not None:
                time.sleep(_DISCOVERY_SETTLE)
                node.destroy_node()
        finally:
            rclpy.try_shutdown()


def _exit_code() -> int:
    """What the process ends with as things are: an error is on its way, or none is."""
    error = sys.exc_info()[1]
    if error is None:
        return 0
    return int(error.code or 0) if isinstance(error, SystemExit) else 1


def _deliver(node: Runnable) -> None:
    """Wait until readers have what was published: with its publishers a node's history goes."""
    until = time.monotonic() + _DELIVERY_TIMEOUT
    for publisher in node.publishers:
        left = max(until - time.monotonic(), 0.0)
        publisher.wait_for_all_acked(Duration(seconds=left))


def serve(executor: Executor, node: Node, ended: Callable[[], bool]) -> None:
    """Serve a node until `ended` says so or its context is shut down.

    Args:
        executor: Calls the callbacks.
        node: Whose.
        ended: Looked at after each callback, and ten times a second while there is none.
    """
    executor.add_node(node)
    try:
        while node.context.ok() and not ended():
            executor.spin_once(timeout_sec=LOOK_UP)
    finally:
        executor.remove_node(node)
        executor.shutdown()


def make_executor(node: Any, *, by_events: bool = True) -> Executor:
    """The executor of a node's process.

    The one driven by events costs a third of the default one at 500 ticks a second. Its `spin`
    fires no timer in the wheels of Jazzy, but `spin_once` is sound. It fails on subscriptions
    whose callback takes the message info too: a node that has one needs the default.
    """
    kind = EventsExecutor if by_events and EventsExecutor is not None else SingleThreadedExecutor
    return kind(context=node.context)


class _TimerEvent(ctypes.Structure):
    """`struct sigevent` of Linux: 64 bytes."""

    _fields_ = (
        ('value', ctypes.c_long),
        ('signal', ctypes.c_int),
        ('notify', ctypes.c_int),
        ('function', ctypes.c_void_p),
        ('attributes', ctypes.c_void_p),
        ('rest', ctypes.c_char * 32),
    )


class _TimerPeriod(ctypes.Structure):
    """`struct itimerspec`: first the period, 0 for none, then the time until it is due."""

    _fields_ = tuple(
        (name, ctypes.c_long) for name in ('period_s', 'period_ns', 'seconds', 'nanoseconds')
    )


def exit_within(seconds: float, code: int) -> None:
    """End this process with an exit code if it has not ended by itself.

    Fast DDS 2.14, that of Jazzy, can wait for itself for ever where a participant is destroyed
    while another one is being discovered: `set_listener` waits, with a lock held, for a callback
    to return that waits for the lock. rclpy holds the GIL meanwhile, so neither a thread of
    Python nor a handler of signals can end the process; a timer of the C library can.

    Everything that has to be kept must be on disk. Where the C library has no such timer nothing
    is done.

    Args:
        seconds: That it has, more than 0.
        code: Its exit code.
    """
    if sys.platform != 'linux':
        return
    library = ctypes.CDLL(None)
    try:
        make, start, leave = (library[name] for name in _TIMER_FUNCTIONS)
    except AttributeError:  # glibc before 2.34 has them in another library
        return
    event = _TimerEvent(
        value=code, notify=_BY_THREAD, function=ctypes.cast(leave, ctypes.c_void_p).value
    )
    timer = ctypes.c_void_p()
    if make(_CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) == 0:
        whole, rest = divmod(seconds, 1.0)
        times = _TimerPeriod(seconds=int(whole), nanoseconds=int(1e9 * rest))
        start(timer, 0, ctypes.byref(times), None)
