"""Run, pause, step and reset: a state machine, and the services that drive it.

          pause           step (one tick)
RUNNING ---------> PAUSED ---------------> PAUSED
        <---------
          resume
any of them -- the guard trips --> ENDED -- reset --> as it was before, RUNNING or PAUSED
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple

from std_srvs.srv import SetBool, Trigger

if TYPE_CHECKING:
    from lathe_chatter.nodes.lathe_node import LatheNode


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


def answering(act: Callable[[Any], Answer]) -> Callable[[Any, Any], Any]:
    """The callback of a service of std_srvs that does something, and says what it came to."""

    def answer(request: Any, response: Any) -> Any:
        response.success, response.message = act(request)
        return response

    return answer


def create_services(lathe: LatheNode) -> None:
    """Create `~/pause`, `~/step` and `~/reset`, in std_srvs: what every graph has."""
    for kind, name, act in (
        (SetBool, 'pause', lambda request: lathe.pause(pause=request.data)),
        (Trigger, 'step', lambda _request: lathe.step()),
        (Trigger, 'reset', lambda _request: lathe.reset()),
    ):
        lathe.create_service(kind, f'~/{name}', answering(act))
