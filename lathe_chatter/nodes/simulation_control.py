"""Run, pause, step and reset: a state machine, and the services that drive it.

          pause           step (one tick)
RUNNING ---------> PAUSED ---------------> PAUSED
        <---------
          resume
any of them -- the guard trips --> ENDED -- reset --> as it was before, RUNNING or PAUSED
"""

from __future__ import annotations

from enum import Enum
from typing import Any, NamedTuple, Protocol

from std_srvs.srv import SetBool, Trigger


class RunState(str, Enum):
    """Whether simulated time goes on."""

    RUNNING = 'running'
    PAUSED = 'paused'
    ENDED = 'ended'
    """The guard tripped: there is nothing to go on with until a reset."""


class Answer(NamedTuple):
    """What a request came to: whether it was carried out, and a sentence about it."""

    done: bool
    message: str


class RunControl:
    """The states above.

    Attributes:
        state: Whether simulated time goes on.
        ended_because: The sentence of the guard, empty unless ENDED.
        resets: How many there were.
    """

    def __init__(self) -> None:
        """Begin RUNNING."""
        self.state = self._before_the_end = RunState.RUNNING
        self.ended_because = ''
        self.resets = 0

    def pause(self, *, pause: bool) -> Answer:
        """Pause or resume; asking for what is so already is no error."""
        if self.ended_because:
            return Answer(done=False, message=f'{self.ended_because} Only a reset helps.')
        before, self.state = self.state, RunState.PAUSED if pause else RunState.RUNNING
        word = self.state.value
        known = before is self.state
        return Answer(done=True, message=f'Already {word}.' if known else f'Now {word}.')

    def may_step(self) -> Answer:
        """Whether one tick may be made by hand."""
        if self.ended_because:
            return Answer(done=False, message=f'{self.ended_because} Only a reset helps.')
        if self.state is not RunState.PAUSED:
            return Answer(done=False, message='A step is possible only while paused.')
        return Answer(done=True, message='One tick.')

    def end(self, because: str) -> None:
        """The guard tripped.

        Args:
            because: Its sentence, not empty.
        """
        self.ended_because = because
        self.state, self._before_the_end = RunState.ENDED, self.state

    def reset(self) -> Answer:
        """Start again at time zero, paused where it was paused."""
        if self.ended_because:
            self.ended_because, self.state = '', self._before_the_end
        self.resets += 1
        return Answer(done=True, message=f'At time zero again, {self.state.value}.')


class Simulator(Protocol):
    """What the services of control drive: these requests, on a node of rclpy."""

    @property
    def run_state(self) -> RunState:
        """Whether simulated time goes on."""

    @property
    def samples_taken(self) -> int:
        """0 at time zero."""

    def pause(self, *, pause: bool) -> Answer:
        """Pause or go on."""

    def step(self, ticks: int = 1) -> Answer:
        """Make ticks while paused."""

    def reset(self) -> Answer:
        """Start again at time zero."""

    def create_service(self, srv_type: Any, srv_name: str, callback: Any) -> Any:
        """Create a service."""


def create_services(simulator: Simulator) -> None:
    """Create `~/pause`, `~/step` and `~/reset`, in std_srvs: what every graph has."""

    def pause(request: Any, response: Any) -> Any:
        response.success, response.message = simulator.pause(pause=request.data)
        return response

    def step(_request: Any, response: Any) -> Any:
        response.success, response.message = simulator.step()
        return response

    def reset(_request: Any, response: Any) -> Any:
        response.success, response.message = simulator.reset()
        return response

    simulator.create_service(SetBool, '~/pause', pause)
    simulator.create_service(Trigger, '~/step', step)
    simulator.create_service(Trigger, '~/reset', reset)
