"""How well a machine is known: standard errors of its figures, and machines drawn from them.

What is uncertain is the logarithm of each figure, so that a drawn frequency, damping ratio,
stiffness or cutting coefficient is never negative and a relative error means the same everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.model.machine import Body, Machine, Structure

MODAL = ('frequency', 'damping_ratio', 'stiffness')
"""The figures of a mode, in the order of a covariance."""
MOST_VARIANCE = 100.0
"""Of a logarithm."""


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Variances and covariances of the logarithms of a machine's figures.

    Attributes:
        names: As `tool.modes[0].frequency`, `cutting_coefficient`.
        covariance: Of their logarithms (n, n).
    """

    names: tuple[str, ...] = ()
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Uncertainty) or self.names != other.names:
            return False
        return np.array_equal(self.covariance, other.covariance)

    def __hash__(self) -> int:
        return hash(self.names)

    def __bool__(self) -> bool:
        return bool(self.names)

    def with_error(self, name: str, error: float) -> Uncertainty:
        """With one more figure, uncertain by itself, by a relative standard error."""
        return self._with((name,), np.array([[error**2]]))

    def with_mode(self, part: str, k: int, errors: Mapping[str, float]) -> Uncertainty:
        """With a mode's relative standard errors, of its mass or of its stiffness."""
        if not errors:
            return self
        f, z = errors.get('frequency', 0.0), errors.get('damping_ratio', 0.0)
        covariance = np.diag([f**2, z**2, errors.get('stiffness', 0.0) ** 2])
        if 'mass' in errors:  # k = m omega^2
            covariance[2, 2] = errors['mass'] ** 2 + 4.0 * f**2
            covariance[0, 2] = covariance[2, 0] = 2.0 * f**2
        return self._with(_modal_names(part, k), covariance)

    def with_covariance(self, part: str, modes: int, covariance: Array) -> Uncertainty:
        """With the covariance of all figures of a body, in place of single errors.

        Raises:
            ValueError: If it is no covariance of that size.
        """
        size = len(MODAL) * modes
        if covariance.shape != (size, size) or not np.allclose(covariance, covariance.T):
            raise ValueError
        if not np.diag(covariance).max() <= MOST_VARIANCE:
            raise ValueError
        if np.linalg.eigvalsh(covariance).min() < -1e-9 * max(np.trace(covariance), 1e-300):
            raise ValueError
        return self._with(
            tuple(n for k in range(modes) for n in _modal_names(part, k)), covariance
        )

    def _with(self, names: tuple[str, ...], block: Array) -> Uncertainty:
        unsure = np.diag(block) > 0.0  # what has no error is no part of it
        stay = [k for k, name in enumerate(self.names) if name not in names]
        names = tuple(name for name, kept in zip(names, unsure, strict=True) if kept)
        block = block[np.ix_(unsure, unsure)]
        size = len(stay) + len(names)
        whole = np.zeros((size, size))
        whole[: len(stay), : len(stay)] = self.covariance[np.ix_(stay, stay)]
        whole[len(stay) :, len(stay) :] = block
        return Uncertainty((*(self.names[k] for k in stay), *names), whole)

    def error_of(self, name: str) -> float | None:
        """The relative standard error of a figure, None where nothing is said of it."""
        if name not in self.names:
            return None
        k = self.names.index(name)
        return math.sqrt(self.covariance[k, k])

    def covariance_of(self, part: str, modes: int) -> Array | None:
        """Of the figures of a body, None where nothing is said of any."""
        names = [n for k in range(modes) for n in _modal_names(part, k)]
        if not set(names) & set(self.names):
            return None
        found = np.zeros((len(names), len(names)))
        places = [(i, self.names.index(n)) for i, n in enumerate(names) if n in self.names]
        for i, a in places:
            for j, b in places:
                found[i, j] = self.covariance[a, b]
        return found

    def draw(self, machine: Machine, count: int, seed: int = 0) -> tuple[list[Machine], Array]:
        """Machines as the truth may be, each figure spread evenly over its probabilities.

        A Latin hypercube: of 1000 machines the mean of a quantile over a chart scatters half as
        much as with independent ones.

        Args:
            machine: As it is told.
            count: How many.
            seed: Of the random numbers.

        Returns:
            The machines, and the deviations of the logarithms that made them (count, n).
        """
        rng = np.random.default_rng(seed)
        from scipy.special import ndtri  # a quarter of a second to load, and only wanted here

        values, vectors = np.linalg.eigh(self.covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        ranks = rng.permuted(np.tile(np.arange(count), (len(self.names), 1)), axis=1).T
        normal = ndtri((ranks + rng.random(ranks.shape)) / count)
        deviations = normal @ root.T
        return [self._moved(machine, row) for row in deviations], deviations

    def _moved(self, machine: Machine, deviations: Array) -> Machine:
        factor = dict(zip(self.names, np.exp(deviations).tolist(), strict=True))

        def moved(part: str, body: Body) -> Body:
            made = []
            for k, mode in enumerate(body.modes):
                f, z, stiffness = (factor.get(n, 1.0) for n in _modal_names(part, k))
                made.append(
                    replace(
                        mode,
                        natural_frequency=mode.natural_frequency * f,
                        damping_ratio=min(mode.damping_ratio * z, 1.0),
                        mass=mode.mass * stiffness / f**2,
                    )
                )
            return made[0] if len(made) == 1 else Structure(tuple(made))

        return replace(
            machine,
            tool=moved('tool', machine.tool),
            workpiece=moved('workpiece', machine.workpiece),
            cutting_coefficient=machine.cutting_coefficient
            * factor.get('cutting_coefficient', 1.0),
        )


_QUANTITIES = {
    'frequency': 0,
    'damping': 1,
    'damping_ratio': 1,
    'stiffness': 2,
    'C': None,
    'cutting_coefficient': None,
}
"""The names that errors are given by: places in `MODAL`; None is C."""


def uncertainty_from(
    text: str, machine: Machine, known: Uncertainty | None = None, *, given_as: str = 'errors'
) -> Uncertainty:
    """Relative standard errors as `frequency=2%,damping=20%,stiffness=5%,C=15%`, for all modes.

    Args:
        text: As above.
        machine: Whose modes they are.
        known: What else is uncertain; what the text names is as it says.
        given_as: What the user calls the text.

    Raises:
        ParameterError: If a name is unknown, or an error no share from 0 to 10.
    """
    known = known or Uncertainty()
    for entry in filter(None, (part.strip() for part in text.split(','))):
        name, _, value = (part.strip() for part in entry.partition('='))
        if name not in _QUANTITIES:
            raise ParameterError(given_as, name, '', 'of frequency, damping, stiffness and C')
        try:
            error = float(value.removesuffix('%')) * (0.01 if value.endswith('%') else 1.0)
        except ValueError:
            error = -1.0
        if not 0.0 <= error <= 10.0:
            raise ParameterError(f'{given_as} {name}', value, '', 'a share such as 2% or 0.02')
        known = _with_error_everywhere(known, machine, _QUANTITIES[name], error)
    return known


def equally_uncertain(machine: Machine, error: float) -> Uncertainty:
    """The same relative standard error of C and of every figure of every mode."""
    known = Uncertainty()
    for quantity in dict.fromkeys(_QUANTITIES.values()):
        known = _with_error_everywhere(known, machine, quantity, error)
    return known


def _with_error_everywhere(
    known: Uncertainty, machine: Machine, quantity: int | None, error: float
) -> Uncertainty:
    """With an error of a figure, by its place in `MODAL`, of every mode; None is C."""
    if quantity is None:
        return known.with_error('cutting_coefficient', error)
    for part in ('tool', 'workpiece'):
        for k in range(len(getattr(machine, part).modes)):
            known = known.with_error(_modal_names(part, k)[quantity], error)
    return known


def _modal_names(part: str, k: int) -> tuple[str, str, str]:
    first, second, third = (f'{part}.modes[{k}].{name}' for name in MODAL)
    return first, second, third
