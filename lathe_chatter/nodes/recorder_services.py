"""The services of the recorder: `~/start`, `~/stop`, `~/split`, `~/snapshot` and `~/pause`."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from std_srvs.srv import SetBool, Trigger

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.nodes.simulation_control import Answer, answering

if TYPE_CHECKING:
    from lathe_chatter.nodes.recorder_node import RecorderNode


def create_services(recorder: RecorderNode) -> None:
    """Create the services on a node."""

    def start(_request: Any) -> Answer:
        try:
            folder = recorder.start()
        except LatheChatterError as error:
            return Answer(done=False, message=str(error))
        said = 'Keeping the last in memory.' if folder is None else f'Recording into {folder}.'
        return Answer(done=True, message=said)

    def logged(act: Callable[[], Answer]) -> Callable[[Any], Answer]:
        def act_and_log(_request: Any) -> Answer:
            answer = act()
            if answer.done:
                recorder.bounded_log.info(answer.message, 'asked')
            return answer

        return act_and_log

    for kind, name, act in (
        (Trigger, 'start', start),  # which says so itself
        (Trigger, 'stop', logged(recorder.stop)),
        (Trigger, 'split', logged(recorder.split)),
        (Trigger, 'snapshot', logged(lambda: recorder.snapshot('It was asked for.'))),
        (SetBool, 'pause', lambda request: recorder.pause(pause=request.data)),
    ):
        recorder.create_service(kind, f'~/{name}', answering(act))
