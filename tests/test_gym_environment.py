"""The lathe to be learnt keeps to Gymnasium's rules, and the monitor's advice pays."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

gymnasium = pytest.importorskip('gymnasium')

from gymnasium.utils.env_checker import check_env  # noqa: E402

from lathe_chatter.errors import ParameterError  # noqa: E402
from lathe_chatter.gym_environment import LatheEnv, MonitorPolicy  # noqa: E402


def played(env: LatheEnv, policy: Any, seed: int) -> float:
    _, info = env.reset(seed=seed)
    total, over = 0.0, False
    while not over:
        _, reward, ended, cut_off, info = env.step(policy(info))
        total, over = total + reward, ended or cut_off
    return total


@pytest.mark.parametrize('rate', [1.0, 50.0])
def test_gymnasium_finds_no_fault(rate: float) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        warnings.filterwarnings('ignore', message='.*Box observation space (min|max)imum value')
        warnings.filterwarnings('ignore', message='.*not within the observation space.*inf')
        check_env(LatheEnv(rate=rate, steps=5), skip_render_check=True)


def test_an_observation_is_what_the_sensors_gave() -> None:
    env = LatheEnv(steps=3)
    seen, info = env.reset(seed=4)
    assert seen[:200] == pytest.approx(1e5 * info['samples'][:, 2], rel=1e-5)
    assert seen[200:400] == pytest.approx(1e5 * info['samples'][:, 4], rel=1e-5)
    seen, _, _, _, _ = env.step(np.array([1.0, 0.0, -1.0]))
    assert env.lathe.cut.spindle_speed_rpm == 6000.0
    assert env.lathe.cut.depth_of_cut == pytest.approx(0.8e-3)
    assert env.lathe.cut.feed == pytest.approx(2e-5)
    assert seen[-3:].tolist() == [1.0, 0.0, -1.0]


def test_another_seed_is_another_machine_and_the_same_the_same() -> None:
    env = LatheEnv()
    first = env.reset(seed=1)[0]
    machine = env.lathe.machine
    assert env.reset(seed=2)[0].tobytes() != first.tobytes()
    assert env.lathe.machine != machine
    assert env.reset(seed=1)[0].tobytes() == first.tobytes()
    assert env.lathe.machine == machine


def test_the_monitors_advice_beats_a_setting_chosen_blindly() -> None:
    """Over the same machines; the best setting in hindsight it need not beat, and does not."""
    env, seeds = LatheEnv(steps=300), range(100, 106)
    held = [np.array([speed, depth, 1.0]) for speed in (-0.5, 0.0, 0.5) for depth in (-0.6, 0.0)]
    blindly = np.mean(
        [
            played(env, lambda _info, action=action: action, seed)
            for action in held
            for seed in seeds
        ]
    )
    advised = np.mean([played(env, MonitorPolicy(), seed) for seed in seeds])
    assert advised > blindly


def test_a_rate_that_no_spindle_follows_is_refused() -> None:
    with pytest.raises(ParameterError, match='rate is 200'):
        LatheEnv(rate=200.0)


def test_no_steps_are_refused() -> None:
    with pytest.raises(ParameterError, match='steps is 0: it must be a whole number of 1 or more'):
        LatheEnv(steps=0)


@pytest.mark.parametrize(
    'action',
    [[0.0, 0.0], [0.0, 1.5, 0.0], [0.0, np.nan, 0.0], [[0.0, 0.0, 0.0]], 0.5, ['a', 'b', 'c']],
)
def test_an_action_that_is_none_is_one_sentence(action: Any) -> None:
    env = LatheEnv(steps=2)
    env.reset(seed=3)
    before = env.lathe.time
    with pytest.raises(ParameterError, match=r'^action is .*three numbers from -1 to 1'):
        env.step(action)
    assert env.lathe.time == before
