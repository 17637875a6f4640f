"""The standard simulation services, where the package simulation_interfaces is installed.

They are the same requests as `~/pause`, `~/step` and `~/reset` in the words that tools for any
simulator know. STOPPED is paused at time zero; a run that its guard has ended reads as paused.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lathe_chatter.nodes.simulation_control import Answer, RunState

try:
    from simulation_interfaces.msg import Result, SimulationState, SimulatorFeatures
    from simulation_interfaces.srv import (
        GetSimulationState,
        GetSimulatorFeatures,
        ResetSimulation,
        SetSimulationState,
        StepSimulation,
    )
except ImportError:
    AVAILABLE = False
else:
    AVAILABLE = True

if TYPE_CHECKING:
    from lathe_chatter.nodes.lathe_node import LatheNode

MAX_STEPS = 100_000
"""Ticks in one request: more would leave other requests unanswered for too long."""


def create_services(lathe: LatheNode) -> None:
    """Create the services on a node."""
    services = _Services(lathe)
    lathe.create_service(GetSimulatorFeatures, '~/get_simulator_features', services.get_features)
    lathe.create_service(GetSimulationState, '~/get_simulation_state', services.get_state)
    lathe.create_service(SetSimulationState, '~/set_simulation_state', services.set_state)
    lathe.create_service(StepSimulation, '~/step_simulation', services.step)
    lathe.create_service(ResetSimulation, '~/reset_simulation', services.reset)


class _Services:
    """The callbacks."""

    def __init__(self, lathe: LatheNode) -> None:
        self._lathe = lathe

    def get_features(self, _request: Any, response: Any) -> Any:
        """What of the standard is supported."""
        known = SimulatorFeatures
        response.features.features = [
            known.SIMULATION_RESET,
            known.SIMULATION_STATE_GETTING,
            known.SIMULATION_STATE_SETTING,
            known.SIMULATION_STATE_PAUSE,
            known.STEP_SIMULATION_SINGLE,
            known.STEP_SIMULATION_MULTIPLE,
        ]
        return response

    def get_state(self, _request: Any, response: Any) -> Any:
        """PLAYING, PAUSED or STOPPED."""
        response.state.state = self._state()
        response.result.result = Result.RESULT_OK
        return response

    def set_state(self, request: Any, response: Any) -> Any:
        """Play, pause or stop."""
        wanted, result = request.state.state, response.result
        if wanted == self._state():
            result.result = SetSimulationState.Response.ALREADY_IN_TARGET_STATE
            return response
        if (self._state(), wanted) == (
            SimulationState.STATE_STOPPED,
            SimulationState.STATE_PAUSED,
        ):
            result.result = SetSimulationState.Response.INCORRECT_TRANSITION
            result.error_message = 'A lathe that is stopped cannot be paused, only played.'
            return response
        if wanted == SimulationState.STATE_STOPPED:
            self._lathe.reset()
            answer = self._lathe.pause(pause=True)
        elif wanted in {SimulationState.STATE_PLAYING, SimulationState.STATE_PAUSED}:
            answer = self._lathe.pause(pause=wanted == SimulationState.STATE_PAUSED)
        else:
            result.result = Result.RESULT_FEATURE_UNSUPPORTED
            result.error_message = 'A lathe can be playing, paused or stopped.'
            return response
        failed = SetSimulationState.Response.STATE_TRANSITION_ERROR
        _report(result, answer, failed)
        return response

    def step(self, request: Any, response: Any) -> Any:
        """Make ticks while paused."""
        result = response.result
        if request.steps > MAX_STEPS:
            result.result = Result.RESULT_OPERATION_FAILED
            result.error_message = f'At most {MAX_STEPS} ticks in one request.'
            return response
        _report(result, self._lathe.step(request.steps), Result.RESULT_OPERATION_FAILED)
        return response

    def reset(self, request: Any, response: Any) -> Any:
        """Time and state at once, for neither makes sense alone."""
        both = ResetSimulation.Request.SCOPE_TIME | ResetSimulation.Request.SCOPE_STATE
        if request.scope == ResetSimulation.Request.SCOPE_DEFAULT or request.scope & both == both:
            _report(response.result, self._lathe.reset(), Result.RESULT_OPERATION_FAILED)
        else:
            response.result.result = Result.RESULT_FEATURE_UNSUPPORTED
            response.result.error_message = 'Time and state of a lathe are reset together.'
        return response

    def _state(self) -> int:
        if self._lathe.run_state is RunState.RUNNING:
            return int(SimulationState.STATE_PLAYING)
        at_zero = self._lathe.samples_taken == 0
        return int(SimulationState.STATE_STOPPED if at_zero else SimulationState.STATE_PAUSED)


def _report(result: Any, answer: Answer, failed: int) -> None:
    result.result = Result.RESULT_OK if answer.done else failed
    result.error_message = '' if answer.done else answer.message
