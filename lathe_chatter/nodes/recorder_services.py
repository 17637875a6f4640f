"""The services of the recorder: `~/start`, `~/stop`, `~/split`, `~/snapshot` and `~/pause`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from std_srvs.srv import SetBool, Trigger

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.nodes.log_rate_limit import BoundedLog
from lathe_chatter.nodes.simulation_control import Answer


class Recorder(Protocol):
    """What the services drive: these requests, on a node of rclpy."""

    def start(self) -> Path | None:
        """Begin a run; LatheChatterError where that cannot be."""

    def stop(self) -> Answer:
        """Finish the run."""

    def split(self) -> Answer:
        """Go on in a new file."""

    def snapshot(self, reason: str) -> Answer:
        """Write what is in memory."""

    def pause(self, *, pause: bool) -> Answer:
        """Leave out what comes, or no longer."""

    @property
    def bounded_log(self) -> BoundedLog:
        """Where to say what was done."""

    def create_service(self, srv_type: Any, srv_name: str, callback: Any) -> Any:
        """Create a service."""


def create_services(recorder: Recorder) -> None:
    """Create the services on a node."""

    def start() -> Answer:
        try:
            folder = recorder.start()
        except LatheChatterError as error:
            return Answer(done=False, message=str(error))
        said = 'Keeping the last in memory.' if folder is None else f'Recording into {folder}.'
        return Answer(done=True, message=said)

    def answering(act: Callable[[], Answer]) -> Callable[[Any, Any], Any]:
        def answer(_request: Any, response: Any) -> Any:
            response.success, response.message = act()
            if response.success and act is not start:  # which has said so itself
                recorder.bounded_log.info(response.message, 'asked')
            return response

        return answer

    def pause(request: Any, response: Any) -> Any:
        response.success, response.message = recorder.pause(pause=request.data)
        return response

    requests = {
        'start': start,
        'stop': recorder.stop,
        'split': recorder.split,
        'snapshot': lambda: recorder.snapshot('It was asked for.'),
    }
    for name, act in requests.items():
        recorder.create_service(Trigger, f'~/{name}', answering(act))
    recorder.create_service(SetBool, '~/pause', pause)
