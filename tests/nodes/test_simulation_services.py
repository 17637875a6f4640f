"""The standard simulation services, asked as any tool for simulators would, where they are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from std_msgs.msg import Float64MultiArray
from support.node_bench import Bench, samples_of

from lathe_chatter.nodes.lathe_node import LatheNode

pytest.importorskip(
    'simulation_interfaces',
    reason='simulation_interfaces is a package of ROS 2 that the package index has no wheel of',
)

from simulation_interfaces.msg import Result, SimulationState, SimulatorFeatures
from simulation_interfaces.srv import (
    GetSimulationState,
    GetSimulatorFeatures,
    ResetSimulation,
    SetSimulationState,
    StepSimulation,
)

STOPPED, PLAYING, PAUSED = (
    SimulationState.STATE_STOPPED,
    SimulationState.STATE_PLAYING,
    SimulationState.STATE_PAUSED,
)


@pytest.fixture
def lathe(start: Callable[..., Any], bench: Bench) -> Bench:
    start(LatheNode)
    return bench


def set_state(bench: Bench, state: int) -> int:
    request = SetSimulationState.Request(state=SimulationState(state=state))
    return int(
        bench.call(SetSimulationState, '/lathe/set_simulation_state', request).result.result
    )


def state_of(bench: Bench) -> int:
    request = GetSimulationState.Request()
    return int(bench.call(GetSimulationState, '/lathe/get_simulation_state', request).state.state)


def step(bench: Bench, steps: int) -> Any:
    request = StepSimulation.Request(steps=steps)
    return bench.call(StepSimulation, '/lathe/step_simulation', request).result


def reset(bench: Bench, scope: int) -> int:
    request = ResetSimulation.Request(scope=scope)
    return int(bench.call(ResetSimulation, '/lathe/reset_simulation', request).result.result)


def test_what_it_says_that_it_can(lathe: Bench) -> None:
    request = GetSimulatorFeatures.Request()
    answer = lathe.call(GetSimulatorFeatures, '/lathe/get_simulator_features', request)
    known = set(answer.features.features)
    assert SimulatorFeatures.SIMULATION_STATE_PAUSE in known
    assert SimulatorFeatures.STEP_SIMULATION_MULTIPLE in known
    assert SimulatorFeatures.SPAWNING not in known


def test_states(lathe: Bench) -> None:
    assert state_of(lathe) == PLAYING
    assert set_state(lathe, PLAYING) == SetSimulationState.Response.ALREADY_IN_TARGET_STATE
    assert set_state(lathe, PAUSED) == Result.RESULT_OK
    assert state_of(lathe) == PAUSED
    assert set_state(lathe, STOPPED) == Result.RESULT_OK
    assert state_of(lathe) == STOPPED
    assert set_state(lathe, PAUSED) == SetSimulationState.Response.INCORRECT_TRANSITION
    assert set_state(lathe, SimulationState.STATE_QUITTING) == Result.RESULT_FEATURE_UNSUPPORTED
    assert state_of(lathe) == STOPPED
    assert set_state(lathe, PLAYING) == Result.RESULT_OK


def test_steps_only_while_paused_and_the_same_run_after_a_reset(lathe: Bench) -> None:
    refused = step(lathe, 1)
    assert refused.result == Result.RESULT_OPERATION_FAILED
    assert refused.error_message == 'A step is possible only while paused.'
    assert set_state(lathe, STOPPED) == Result.RESULT_OK
    blocks = lathe.listen(Float64MultiArray, '/lathe/samples')
    runs = []
    for scope in (ResetSimulation.Request.SCOPE_ALL, ResetSimulation.Request.SCOPE_DEFAULT):
        assert reset(lathe, scope) == Result.RESULT_OK
        assert state_of(lathe) == STOPPED
        heard = len(blocks)
        assert step(lathe, 5).result == Result.RESULT_OK
        lathe.spin_until(lambda: len(blocks) == heard + 5, '5 ticks')  # noqa: B023 -- called here
        assert state_of(lathe) == PAUSED
        runs.append(np.vstack([samples_of(block) for block in blocks[heard:]]))
    assert runs[0][0, 0] == 1e-4
    assert np.array_equal(runs[0], runs[1])
    assert step(lathe, 10**9).result == Result.RESULT_OPERATION_FAILED


def test_time_and_state_are_reset_together(lathe: Bench) -> None:
    assert reset(lathe, ResetSimulation.Request.SCOPE_TIME) == Result.RESULT_FEATURE_UNSUPPORTED
    both = ResetSimulation.Request.SCOPE_TIME | ResetSimulation.Request.SCOPE_STATE
    assert reset(lathe, both) == Result.RESULT_OK
