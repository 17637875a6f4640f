"""The services `~/pause`, `~/step` and `~/reset`, in std_srvs: what every graph has."""

from __future__ import annotations

from typing import Any

from std_srvs.srv import SetBool, Trigger

from lathe_chatter.nodes.control import Simulator


def offer(simulator: Simulator) -> None:
    """Create the services on a node."""

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
