"""The modes that a frequency response shows, each figure with its standard error.

At the point where the tool cuts, a body of n modes has the receptance

    H(omega) = sum_k 1 / (k_k - m_k omega^2 + i c_k omega) + a + b/omega^2

with a for the modes above the band and b for those below (Ewins, Modal Testing, 2.4). Poles from
the least-squares complex frequency method (sdypy-EMA) are candidates; modes are taken from them
one at a time, the one that explains most first, while the Bayesian information criterion falls by
10; SciPy's least squares refines all figures together. The noise of each frequency is what the
coherence says, scaled by the residual, or a floor and a share of the response, both found from
the residual.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls

from lathe_chatter.array_types import Array
from lathe_chatter.errors import ModalFitError
from lathe_chatter.tap_test.candidate_poles import candidate_poles
from lathe_chatter.tap_test.measured_response import Complex, FrequencyResponse

MOST_MODES = 8
_EXPLAINED = 0.05
"""Of what the modes leave, the part that no pole of mere noise explains."""
_MOST_CALLS = 200
_FAR = 40.0
"""The logarithm of what no mode has: a search that gets there has lost its way."""
_ROUNDS = 3
"""Of fitting and weighing in turn; the weights settle in two or three."""


@dataclass(frozen=True)
class FittedMode:
    """A mode with its standard errors.

    Attributes:
        frequency: Undamped natural frequency, Hz.
        damping_ratio: zeta.
        stiffness: Modal stiffness at the measured point, N/m.
        errors: Standard errors of these three, in their units.
    """

    frequency: float
    damping_ratio: float
    stiffness: float
    errors: tuple[float, float, float]

    @property
    def mass(self) -> float:
        """Modal mass k/omega^2, kg."""
        return self.stiffness / (2.0 * math.pi * self.frequency) ** 2


@dataclass(frozen=True)
class ModalFit:
    """What was found.

    Attributes:
        modes: In ascending frequency.
        covariance: Of (ln frequency, ln damping ratio, ln stiffness) of each mode in turn
            (3n, 3n).
        responses: What was fitted.
        fitted: The model in the form of each of them.
        deviations: Standard deviation of the noise of each value of each of them.
        warnings: What is to be known before the machine is believed, in sentences.
    """

    modes: tuple[FittedMode, ...]
    covariance: Array = field(repr=False)
    responses: tuple[FrequencyResponse, ...] = field(repr=False)
    fitted: tuple[Complex, ...] = field(repr=False)
    deviations: tuple[Array, ...] = field(repr=False)
    warnings: tuple[str, ...] = ()


def fit_modes(
    responses: Sequence[FrequencyResponse],
    *,
    modes: int | None = None,
    lowest_frequency: float = 0.0,
    highest_frequency: float = math.inf,
) -> ModalFit:
    """Fit modes to the frequency responses of one body, measured at one point.

    Args:
        responses: One or more measurements of the same point.
        modes: How many; None finds their number.
        lowest_frequency: Of what is fitted, Hz.
        highest_frequency: Of what is fitted, Hz.

    Raises:
        ModalFitError: If there is too little to fit, or nothing that vibrates.
    """
    if modes is not None and not 1 <= modes <= MOST_MODES:
        raise ModalFitError(f'modes is {modes}: it must be from 1 to {MOST_MODES}.')
    band = tuple(r.within(lowest_frequency, highest_frequency) for r in responses)
    fit = _Fit(band)
    candidates = candidate_poles(band)
    poles: list[tuple[float, float]] = []
    best: tuple[float, Array] | None = None
    while len(poles) < (modes or MOST_MODES):
        found = _next_pole(fit, poles, candidates)
        if found is None:
            break
        parameters = fit.refine([*poles, found])
        if np.abs(parameters[:-2]).max() > _FAR:
            break
        poles = fit.poles_of(parameters)
        score = fit.information(parameters)
        if modes is None and best is not None and score > best[0] - 10.0:
            break
        best = (score, parameters)
    if best is None or (modes is not None and len(poles) < modes):
        said = f'{len(poles)} of {modes} modes were' if modes else 'no mode was'
        turned = best is None and _next_pole(fit, [], candidates, sign=-1.0)
        hint = ' Its sign is reversed, as that of an accelerometer the other way round.'
        raise ModalFitError(
            f'{band[0].source}: {said} found between {band[0].frequency[0]:g} and '
            f'{band[0].frequency[-1]:g} Hz.{hint if turned else ""}'
        )
    return fit.result(best[1], candidates)


class _Fit:
    """The least-squares problem of some responses, one after the other, with common modes."""

    def __init__(self, responses: tuple[FrequencyResponse, ...]) -> None:
        self.responses = responses
        self.ends = np.cumsum([r.frequency.size for r in responses])[:-1]
        self.omega = 2.0 * np.pi * np.concatenate([r.frequency for r in responses])
        self.factor = np.concatenate([r.of_receptance for r in responses])
        self.measured = np.concatenate([r.response for r in responses])
        self.deviation = np.repeat(
            [_roughness(r) for r in responses], [r.frequency.size for r in responses]
        )

    def columns(self, poles: Sequence[tuple[float, float]]) -> Complex:
        """The response of each pole with unit 1/m, and of what lies outside the band (n, m + 2).

        The two residuals are of order one at the ends of the band.
        """
        w = self.omega
        shapes = [self.factor / (p**2 - w**2 + 2j * z * p * w) for p, z in poles]
        return np.column_stack([*shapes, self.factor / w.max() ** 2, -self.factor / w**2])

    def weighed(self, values: Complex) -> Array:
        """Values (n, ...) in standard deviations of the noise, real parts before imaginary."""
        scaled = (values.T / self.deviation).T
        return np.concatenate([scaled.real, scaled.imag])

    def amplitudes(self, poles: Sequence[tuple[float, float]]) -> tuple[Array, float]:
        """1/m of each pole and the residuals by linear least squares, and the cost left."""
        matrix, target = self.weighed(self.columns(poles)), self.weighed(self.measured)
        scale = np.linalg.norm(matrix, axis=0)
        found, *_ = np.linalg.lstsq(matrix / scale, target, rcond=1e-12)
        left = target - matrix / scale @ found
        return found / scale, float(left @ left)

    def model(self, parameters: Array) -> Complex:
        """The responses that parameters give (n,)."""
        return self.columns(self.poles_of(parameters)) @ self._amplitudes_of(parameters)

    @staticmethod
    def poles_of(parameters: Array) -> list[tuple[float, float]]:
        """omega and zeta of each mode."""
        inside = np.clip(parameters, -_FAR, _FAR)  # a search that has lost its way stays finite
        return [(math.exp(p), math.exp(z)) for p, z, _ in inside[:-2].reshape(-1, 3)]

    @staticmethod
    def _amplitudes_of(parameters: Array) -> Array:
        """1/m of each mode from its ln k, and the two residuals."""
        modes = parameters[:-2].reshape(-1, 3)
        exponents = np.clip(2.0 * modes[:, 0] - modes[:, 2], -80.0, 80.0)
        return np.concatenate([np.exp(exponents), parameters[-2:]])

    def _residual(self, parameters: Array) -> Array:
        return self.weighed(self.model(parameters) - self.measured)

    def _jacobian(self, parameters: Array) -> Array:
        """Of `_residual`, in closed form (2n, parameters)."""
        poles, w = self.poles_of(parameters), self.omega
        shapes, columns = self.columns(poles), list[Complex]()
        for (p, z), a, shape in zip(
            poles, self._amplitudes_of(parameters), shapes.T, strict=False
        ):
            response = a * shape
            per_damping = -response * shape / self.factor * 2j * z * p * w
            per_size = 2.0 * response * (1.0 - shape / self.factor * p**2) + per_damping
            columns += [per_size, per_damping, -response]
        return self.weighed(np.column_stack([*columns, shapes[:, -2:]]))

    def refine(self, poles: Sequence[tuple[float, float]]) -> Array:
        """All parameters together, with weights that are found from what is left."""
        amplitudes, _ = self.amplitudes(poles)
        p, z = np.transpose(poles)
        largest = float(np.abs(amplitudes[:-2]).max())
        stiffness = p**2 / np.maximum(amplitudes[:-2], 1e-3 * largest)
        modes = np.log([p, z, stiffness]).T
        parameters: Array = np.concatenate([modes.ravel(), amplitudes[-2:]])
        for _ in range(_ROUNDS):
            scale = np.ones(parameters.size)
            scale[-2:] = np.maximum(np.abs(parameters[-2:]), largest)
            solved = least_squares(  # type: ignore[operator]  # the stubs take a module of that name for it
                self._residual, parameters, self._jacobian,
                x_scale=scale, method='lm', max_nfev=_MOST_CALLS,
            )  # fmt: skip
            parameters = np.asarray(solved.x, float)
            self._weigh(self.model(parameters))
        return parameters

    def parts(self, values: NDArray[Any]) -> list[NDArray[Any]]:
        """Values of each response."""
        return np.split(values, self.ends)

    def _weigh(self, model: Complex) -> None:
        """Find the noise of each value from what the model leaves.

        The variance of each is sought as floor^2 + share^2 |H|^2, or with the coherence g as
        floor^2 + share^2 |H|^2 (1 - g)/g; both are sums of squares, fitted by the mean of
        |left|^2 with its own scatter as weight.
        """
        deviations = []
        for response, part, old in zip(
            self.responses, self.parts(model), self.parts(self.deviation), strict=True
        ):
            left, shape = np.abs(part - response.response) ** 2 / 2.0, np.abs(part) ** 2
            least = 1e-12 * float(shape.max())
            if response.coherence is not None:
                g = np.clip(_smooth(response.coherence), 1e-3, 1.0 - 1e-9)
                shape = shape * (1.0 - g) / g
            variance, terms = (
                np.maximum(old**2, 1e-30),
                np.column_stack([np.ones(left.size), shape]),
            )
            for _ in range(6):
                matrix = terms / variance[:, None]
                scale = np.linalg.norm(matrix, axis=0) + 1e-300
                found, _ = nnls(matrix / scale, left / variance)
                variance = np.maximum(terms @ (found / scale), least)
            deviations.append(np.sqrt(variance))
        self.deviation = np.concatenate(deviations)

    def information(self, parameters: Array) -> float:
        """The Bayesian information criterion: less is better."""
        left = self._residual(parameters)
        likelihood = float(left @ left) + 4.0 * float(np.log(self.deviation).sum())
        return likelihood + parameters.size * math.log(left.size)

    def result(self, parameters: Array, candidates: list[tuple[float, float]]) -> ModalFit:
        """The modes in ascending order, with their covariance and what is to be warned of."""
        parameters = self.refine(self.poles_of(parameters))
        jacobian = self._jacobian(parameters)
        scale = np.linalg.norm(jacobian, axis=0)
        inverse = np.linalg.pinv(jacobian / scale)
        whole = (inverse @ inverse.T) / np.outer(scale, scale)
        order = np.argsort(parameters[:-2:3])
        index = (3 * order[:, None] + np.arange(3)).ravel()
        covariance = whole[np.ix_(index, index)]
        values = np.exp(parameters[index].reshape(-1, 3)) / (2.0 * math.pi, 1.0, 1.0)
        errors = values * np.sqrt(np.diag(covariance)).reshape(-1, 3)
        modes = tuple(
            FittedMode(f, z, k, (df, dz, dk))
            for (f, z, k), (df, dz, dk) in zip(values.tolist(), errors.tolist(), strict=True)
        )
        model = self.model(parameters)
        said = _warnings(modes, self.responses) + _unexplained(self, model)
        said += _against(self, self.poles_of(parameters), candidates)
        fitted, deviations = tuple(self.parts(model)), tuple(self.parts(self.deviation))
        return ModalFit(modes, covariance, self.responses, fitted, deviations, tuple(said))


def _roughness(response: FrequencyResponse) -> float:
    """Noise by the roughness of the curve: its second differences, smoothed nowhere."""
    rough = np.abs(np.diff(response.response, 2)) / math.sqrt(6.0)
    floor = float(np.median(rough)) / math.sqrt(2.0 * math.log(2.0))
    return max(floor, 1e-9 * float(np.abs(response.response).max()))


def _smooth(values: Array, width: int = 5) -> Array:
    """A running mean: single values of a coherence scatter."""
    padded = np.pad(values, width // 2, mode='edge')
    return np.convolve(padded, np.full(width, 1.0 / width), 'valid')


def _next_pole(
    fit: _Fit,
    poles: list[tuple[float, float]],
    candidates: list[tuple[float, float]],
    sign: float = 1.0,
) -> tuple[float, float] | None:
    """The candidate that explains most of what the poles so far leave, with a mass of a sign."""
    best, least = None, math.inf
    for candidate in candidates:
        amplitudes, left = fit.amplitudes([*poles, candidate])
        if sign * amplitudes[len(poles)] > 0.0 and left < least:
            best, least = candidate, left
    return best


def _against(
    fit: _Fit, poles: list[tuple[float, float]], candidates: list[tuple[float, float]]
) -> list[str]:
    """Whether something moves against the force, as nothing does at the point where it acts."""
    found = _next_pole(fit, poles, candidates, sign=-1.0)
    if found is None:
        return []
    none, without, with_it = (fit.amplitudes(p)[1] for p in ([], poles, [*poles, found]))
    if without - with_it < max(_EXPLAINED * without, 1e-6 * none):
        return []
    where = f'What vibrates at {found[0] / 2.0 / math.pi:.1f} Hz moves against the force'
    return [f'{where}: it was not measured where that acts, or has its sign reversed.']


def _unexplained(fit: _Fit, model: Complex) -> list[str]:
    """Which responses the modes do not explain, beyond their roughness."""
    said = []
    for response, part in zip(fit.responses, fit.parts(model), strict=True):
        noise = 2.0 * response.frequency.size * _roughness(response) ** 2
        left = float(np.sum(np.abs(part - response.response) ** 2)) - noise
        share = left / float(np.sum(np.abs(response.response) ** 2))
        if share > _EXPLAINED:
            left_out = (
                f'{response.source}: the modes leave {min(share, 1.0):.0%} of it unexplained.'
            )
            hint = ' It may be of another point than the others.'
            said.append(left_out + hint if len(fit.responses) > 1 else left_out)
    return said


def _warnings(modes: Sequence[FittedMode], responses: Sequence[FrequencyResponse]) -> list[str]:
    """What is to be known before the modes are believed."""
    said = []
    for mode in modes:
        width = mode.damping_ratio * mode.frequency
        for r in responses:
            near = np.abs(r.frequency - mode.frequency) < max(width, np.diff(r.frequency).max())
            if r.coherence is not None and near.any() and np.median(r.coherence[near]) < 0.8:
                said.append(
                    f'At {mode.frequency:.1f} Hz the coherence is '
                    f'{np.median(r.coherence[near]):.2f}: that mode is not to be relied upon.'
                )
            low, high = r.frequency[0] + 2.0 * width, r.frequency[-1] - 2.0 * width
            if not low < mode.frequency < high:
                said.append(
                    f'The mode at {mode.frequency:.1f} Hz lies at the edge of what was measured.'
                )
        if mode.errors[2] > 0.2 * mode.stiffness:
            said.append(
                f'The stiffness of the mode at {mode.frequency:.1f} Hz is known to '
                f'{mode.errors[2] / mode.stiffness:.0%} only.'
            )
    for first, second in pairwise(modes):
        apart = second.frequency - first.frequency
        if apart < first.damping_ratio * first.frequency + second.damping_ratio * second.frequency:
            said.append(
                f'The modes at {first.frequency:.1f} and {second.frequency:.1f} Hz lie closer '
                'than they are wide: they may not be told apart.'
            )
    return said
