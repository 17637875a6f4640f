"""What the monitor says of the cut, in words and for the diagnostics."""

from __future__ import annotations

import math

from lathe_chatter.detection import Estimate


def details(estimate: Estimate) -> dict[str, object]:
    """What explains the figures, for the diagnostics."""
    numbers = {
        'standard error of the growth rate, 1/s': estimate.growth_rate_error,
        'doubling time, s': estimate.doubling_time,
        'waves per revolution': estimate.waves_per_revolution,
        'C w, N/m': estimate.cutting_stiffness,
        'stiffness under the workpiece, N/m': estimate.workpiece_stiffness,
        'once-per-turn variance over all': estimate.once_per_turn,
    }
    details: dict[str, object] = {k: v for k, v in numbers.items() if math.isfinite(v)}
    if estimate.bearing_engaged is not None:
        details['bearing engaged'] = estimate.bearing_engaged
    if advice := estimate.advice.in_words():
        details['advice'] = advice
    details['works with'] = estimate.mode.value
    return details


def onset(estimate: Estimate) -> str:
    """What a machinist has to know, as far as it is known."""
    known = [
        (estimate.frequency, f'at {estimate.frequency:.1f} Hz'),
        (estimate.growth_rate, f'growing at {estimate.growth_rate:.1f} 1/s'),
        (estimate.amplitude, f'amplitude {estimate.amplitude * 1e6:.3g} um'),
    ]
    words = [text for value, text in known if math.isfinite(value)]
    words += [advice] if (advice := estimate.advice.in_words()) else []
    return f'At {estimate.time:.6f} s: chatter {", ".join(words)}.'


def clearance(estimate: Estimate) -> str:
    """That it is over."""
    return f'At {estimate.time:.6f} s: the chatter has died out; the cut is {estimate.state}.'
