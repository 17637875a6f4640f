"""The services `~/start`, `~/stop` and `~/split` of the recorder."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

from std_srvs.srv import Trigger

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.nodes.control import Answer


class Recorder(Protocol):
    """What the services drive: these requests, on a node of rclpy."""

    def start(self) -> Path:
        """Begin a run; LatheChatterError where that cannot be."""

    def stop(self) -> Answer:
        """Finish the run."""

    def split(self) -> Answer:
        """Go on in a new file."""

    def create_service(self, srv_type: Any, srv_name: str, callback: Any) -> Any:
        """Create a service."""


def create_services(recorder: Recorder) -> None:
    """Create the services on a node."""

    def start(_request: Any, response: Any) -> Any:
        try:
            response.success, response.message = True, f'Recording into {recorder.start()}.'
        except LatheChatterError as error:
            response.success, response.message = False, str(error)
        return response

    def stop(_request: Any, response: Any) -> Any:
        response.success, response.message = recorder.stop()
        return response

    def split(_request: Any, response: Any) -> Any:
        response.success, response.message = recorder.split()
        return response

    recorder.create_service(Trigger, '~/start', start)
    recorder.create_service(Trigger, '~/stop', stop)
    recorder.create_service(Trigger, '~/split', split)
