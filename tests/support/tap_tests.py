"""Tap tests of bodies whose modes are known, with the noise that averaging leaves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lathe_chatter.tap_test import FrequencyResponse
from lathe_chatter.tap_test.measured_response import ORDERS

THREE_MODES = ((118.0, 0.03, 2e7), (310.0, 0.02, 4e7), (845.0, 0.015, 9e7))
"""Frequency Hz, damping ratio, stiffness N/m of each."""


def tap_test(
    modes: Sequence[tuple[float, float, float]] = THREE_MODES,
    *,
    floor: float = 0.0,
    seed: int = 0,
    averages: int = 5,
    form: str = 'receptance',
    frequency: np.ndarray | None = None,
    coherence: bool = True,
) -> FrequencyResponse:
    """The mean of some noisy responses.

    Args:
        modes: Of the body.
        floor: Standard deviation of the noise of one response, as a share of the peak.
        seed: Of the noise.
        averages: How many responses are averaged.
        form: What is measured.
        frequency: Where, Hz (n,).
        coherence: Whether it is told.
    """
    rng = np.random.default_rng(seed)
    f = 0.75 * np.arange(1, 2001) if frequency is None else frequency
    w = 2.0 * np.pi * f
    exact = sum(1.0 / (k * (1.0 - (f / f_n) ** 2 + 2j * zeta * f / f_n)) for f_n, zeta, k in modes)
    exact = exact * (1j * w) ** ORDERS[form]
    noise = rng.standard_normal((2, averages, f.size)) * floor * np.abs(exact).max() / np.sqrt(2.0)
    each = exact + noise[0] + 1j * noise[1]
    mean = each.mean(axis=0)
    seen = np.clip(np.abs(mean) ** 2 / (np.abs(each) ** 2).mean(axis=0), 0.0, 1.0)
    return FrequencyResponse(f, mean, form, seen if coherence else None, 'made for a test')
