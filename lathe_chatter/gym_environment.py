"""A lathe to be learnt with Gymnasium, and the advice of the monitor, which is to be beaten."""

from __future__ import annotations

from typing import Any

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.detection import ChatterDetector
from lathe_chatter.errors import ParameterError, optional
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.model.quantity_fields import Quantity, count_of
from lathe_chatter.model.uncertainty import uncertainty_from
from lathe_chatter.samples import SAMPLE_COLUMNS

gymnasium = optional('gymnasium', 'A lathe to be learnt')
_CUT = Cut(bearing_contact=BearingContact.NONE, force_noise=1e-3, sensor_noise=1e-7)
_LOW, _HIGH = np.array([2000.0, 1e-4, 2e-5]), np.array([6000.0, 1.5e-3, 1e-4])
_NAMES = ('spindle_speed_rpm', 'depth_of_cut', 'feed_per_revolution')
_RATE = Quantity('', 'Hz', low=1.0, high=50.0)
_LEVELS = 200.0  # settings that differ by less than a level of their range are the same


class LatheEnv(gymnasium.Env):  # type: ignore[misc, name-defined]  # of no types here
    """Remove as much as can be removed without chatter, on a machine that is another each time.

    An action is speed (2000 to 6000 rev/min), depth (0.1 to 1.5 mm) and feed (20 to 100 um), each
    from -1 to 1, held for 1/`rate` s, 1 to 50 Hz. An observation is what sensors gave meanwhile,
    tool and workpiece displacement in 10 um (n,), and the settings. The reward is what was removed
    as a share of the most, less `damage` times the scatter of the chip's thickness over the feed.
    `errors` says how widely machines are drawn about the paper's, as `--uncertain` takes them.

    Raises:
        ParameterError: If rate or steps are not allowed, or an action is not in its box.
    """

    def __init__(
        self,
        rate: float = 50.0,
        steps: int = 500,
        damage: float = 2.0,
        errors: str = 'frequency=10%,damping=20%,stiffness=10%,C=20%',
        cut: Cut = _CUT,
    ) -> None:
        """See the class."""
        self._samples = round(1e4 / _RATE.check('rate', rate))
        self._known, self._cut = uncertainty_from(errors, Machine()), cut
        self._steps, self._damage = count_of('steps', steps, least=1), damage
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)
        seen = (2 * self._samples + 3,)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, seen, np.float32)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Array, Any]:
        """Another machine, cutting gently."""
        super().reset(seed=seed, options=options)
        drawn, noise = (int(self.np_random.integers(2**31)) for _ in range(2))
        ((machine,), _) = self._known.draw(Machine(), 1, drawn)
        self.lathe, self._left = VirtualLathe(machine, seed=noise), self._steps + 1
        self._set: Array = np.full(3, np.nan)
        observation, *_, info = self.step(np.full(3, -1.0))
        return observation, info

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Set speed, depth and feed, and cut on for a period."""
        wanted = np.asarray(action)
        numbers = wanted.dtype.kind in 'iuf' and wanted.shape == (3,)
        if not numbers or not (np.abs(wanted) <= 1.0).all():  # nan is none either
            allowed = 'three numbers from -1 to 1: spindle speed, depth of cut, feed'
            raise ParameterError('action', wanted.tolist(), '', allowed)
        levels = np.rint(_LEVELS * (0.5 + 0.5 * wanted)) / _LEVELS
        if (levels != self._set).any():
            values = (_LOW + levels * (_HIGH - _LOW)).tolist()
            self.lathe.retune(self._cut.with_changes(**dict(zip(_NAMES, values, strict=True))))
            self._set = levels
        samples, cut = self.lathe.advance(self._samples), self.lathe.cut
        seen = np.zeros(self.observation_space.shape, np.float32)
        seen[:-3].reshape(2, -1)[:, : len(samples)] = 1e5 * samples[:, (2, 4)].T
        seen[-3:] = 2.0 * levels - 1.0
        removed = cut.spindle_speed_rpm * cut.depth_of_cut * cut.feed / _HIGH.prod()
        scatter = min(samples[:, 6].std() / cut.feed, 1.0) if len(samples) else 1.0
        reward, self._left = float(removed - self._damage * scatter), self._left - 1
        return seen, reward, bool(self.lathe.guard), self._left <= 0, {'samples': samples}


class MonitorPolicy:
    """Deeper while the monitor is content; the speed or depth that it advises when it is not."""

    def __init__(self) -> None:
        """Know nothing of the machine."""
        self._detector = ChatterDetector(None, speed_range=(_LOW[0], _HIGH[0]))
        self._wanted, self._wait = np.array([4000.0, 3e-4, 1e-4]), 25

    def __call__(self, info: dict[str, Any]) -> Array:
        """The next action, after what the sensors gave; once for each step."""
        found, self._wait = self._detector.update(info['samples'], SAMPLE_COLUMNS), self._wait - 1
        if self._wait < 0 and found.chatter:
            another = found.advice.speeds and self._wanted[0] != found.recommended_speed_rpm
            depth = self._wanted[1] * (1.0 if another else 0.85)
            speed = found.recommended_speed_rpm if another else self._wanted[0]
            self._wanted[:2], self._wait = (speed, depth), 25
        elif self._wait < 0 and found.state == 'stable':
            self._wanted[1], self._wait = 1.05 * self._wanted[1], 5
        return np.asarray(np.clip(2.0 * (self._wanted - _LOW) / (_HIGH - _LOW) - 1.0, -1.0, 1.0))
