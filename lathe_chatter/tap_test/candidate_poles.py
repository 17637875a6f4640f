"""Poles that a frequency response may have, by sdypy-EMA; not all of them are modes."""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Sequence

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.errors import optional
from lathe_chatter.tap_test.measured_response import FrequencyResponse

_POLE_ORDER = 40
_AGREEING = 5
"""Orders that must agree on a pole before it is a candidate."""


def candidate_poles(responses: Sequence[FrequencyResponse]) -> list[tuple[float, float]]:
    """Poles (omega, zeta) of the first response by the complex frequency method, every order."""
    with warnings.catch_warnings(), contextlib.redirect_stderr(io.StringIO()):
        warnings.simplefilter('ignore')
        model_of = optional('sdypy.EMA', 'a tap test').Model
        response, frequency = responses[0], responses[0].frequency
        receptance = response.response / response.of_receptance
        order = min(_POLE_ORDER, frequency.size // 8)
        model = model_of(
            receptance[None, :], frequency, frf_form='receptance', pol_order_high=order,
            lower=float(frequency[0]), upper=float(frequency[-1]),
        )  # fmt: skip
        model.get_poles(method='lscf', show_progress=False)
    poles = np.concatenate([np.atleast_1d(np.asarray(p, complex)) for p in model.all_poles])
    size = np.abs(poles)
    damping = -poles.real / np.maximum(size, 1e-300)
    inside = (poles.imag > 0.0) & (damping > 1e-5) & (damping < 0.5)
    inside &= (size > 2.0 * np.pi * frequency[0]) & (size < 2.0 * np.pi * frequency[-1])
    return _clusters(size[inside], damping[inside])


def _clusters(size: Array, damping: Array) -> list[tuple[float, float]]:
    """The poles that several orders agree on: a mode stays where it is, noise moves."""
    by_size = np.argsort(size)
    size, damping = size[by_size], damping[by_size]
    edges = np.flatnonzero(np.diff(size) > 0.003 * size[1:]) + 1
    return [
        (float(np.median(p)), float(np.median(z)))
        for p, z in zip(np.split(size, edges), np.split(damping, edges), strict=True)
        if p.size >= _AGREEING
    ]
