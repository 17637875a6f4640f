"""Every sentence that the monitor logs, and when each is true; and the cut for the diagnostics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from lathe_chatter.detection import Estimate
from lathe_chatter.detection.channel_watch import CAUSES
from lathe_chatter.nodes.polled_subscription import several_publish


class Sentence(NamedTuple):
    """A kind of sentence.

    Attributes:
        severity: `info`, `warning` or `error`.
        pattern: A regular expression that all of this kind match; a count may follow
            (log_rate_limit.py).
        true_when: What must be so when it is said; `tests/nodes` brings each about.
    """

    severity: str
    pattern: str
    true_when: str


TOOL_FREQUENCY = 'natural frequency of the tool as heard, Hz'
"""In the diagnostics, where it has taken the place of the told one."""
_AT = r'At \d+\.\d{6} s: '
SILENCES = {
    'silence': 'no samples come',
    'standstill': 'this node stood still, and does not hear the samples yet',
}
"""What the diagnostics say where no sample came for a second."""
SENTENCES = {
    'listening': Sentence(
        'info',
        r'Listening from [\d.]+ s on\.',
        'these are the first samples, or the first after there were two publishers',
    ),
    'restart': Sentence(
        'info',
        _AT + r'the lathe started again, and I with it from [\d.]+ s on\.',
        'times went back, or samples are missing and a publisher is new',
    ),
    'jump': Sentence(
        'warning',
        _AT + r'the times of the samples jump to [\d.]+ s, .*: I begin anew there\.',
        'no lathe could have cut for so long since the last block, so nothing counts as lost',
    ),
    'lost': Sentence(
        'warning',
        _AT + r'the samples up to [\d.]+ s did not come\.',
        'times leave samples out that one and the same publisher could have sent',
    ),
    'silence': Sentence(
        'warning',
        _AT + r'no samples come any more\.',
        'no sample came for a second, some had before, and this node did not stand still of late',
    ),
    'standstill': Sentence(
        'warning',
        _AT + rf'{SILENCES["standstill"]}\.',
        'no sample came for a second, some had before, and they may wait since a standstill',
    ),
    'samples again': Sentence(
        'info',
        _AT + r'samples come again\.',
        'it was said that none come, and the next of the same run have come',
    ),
    'two publishers': Sentence(
        'error',
        r'[^ ]+ and [^ ]+.* publish .*, not one lathe: nothing is judged until one is left\.',
        'several publish and the times of what comes leap to and fro',
    ),
    'best effort': Sentence(
        'info',
        r'A publisher of .* offers best effort only, .*\.',
        'a publisher offers no more, and the subscription asks for no more from now on',
    ),
    'machine': Sentence(
        'info',
        r'The lathe has told what machine it is(, with speeds from .+ rev/min)?\.',
        'the parameters of the lathe came, and are another machine than before',
    ),
    'sensors': Sentence(
        'warning',
        _AT + rf'.+ ({"|".join(CAUSES.values())}); works with: .+\.',
        'a channel that the labels name has been so within the last second',
    ),
    'sensors well': Sentence(
        'info',
        _AT + r'all sensors are well again; works with: .+\.',
        'no channel has been at fault for a while, and one was before',
    ),
    'machine fit': Sentence(
        'warning',
        _AT + r'the tool, told at .+ is (heard at .+ without a machine|taken at .+ heard)\.',
        "the tool's own equation, fitted over seconds of cutting, is not that of the told one",
    ),
    'machine fits': Sentence(
        'info',
        _AT + r'the machine fits what is heard, and is believed again\.',
        'it did not before, and now the fit says so',
    ),
    'onset': Sentence('warning', _AT + r'chatter .+\.', 'the flag has just been raised'),
    'advice': Sentence(
        'info',
        _AT + r'(the advice stands: )?(try|no stable speed).+\.',
        'chatter is flagged, and the advice is new, or the same but found at another speed',
    ),
    'clearance': Sentence(
        'info',
        _AT + r'the chatter has died out(; [a-z ]+)?\.',
        'the vibration of this same run died down, or the spindle stands, or nothing is cut',
    ),
    'withdrawn': Sentence(
        'info',
        _AT + r'the flag is taken back, for this is another run; .+\.',
        'the flag was up when another run began',
    ),
}


def details(estimate: Estimate) -> dict[str, object]:
    """What explains the figures, for the diagnostics."""
    numbers = {
        'standard error of the growth rate, 1/s': estimate.growth_rate_error,
        'standard error of the margin': estimate.margin_error,
        'doubling time, s': estimate.doubling_time,
        'waves per revolution': estimate.waves_per_revolution,
        'C w, N/m': estimate.cutting_stiffness,
        'stiffness under the workpiece, N/m': estimate.workpiece_stiffness,
        TOOL_FREQUENCY: estimate.tool_frequency,
        'once-per-turn variance over all': estimate.once_per_turn,
    }
    details: dict[str, object] = {k: v for k, v in numbers.items() if math.isfinite(v)}
    if estimate.bearing_engaged is not None:
        details['bearing engaged'] = estimate.bearing_engaged
    if advice := estimate.advice.in_words():
        details['advice'] = advice
    details['works with'] = estimate.mode.value
    if estimate.machine_fit:
        details['machine'] = estimate.machine_fit
    return details


def onset(estimate: Estimate) -> str:
    """What a machinist has to know, as far as it is known."""
    growth, error = estimate.growth_rate, estimate.growth_rate_error
    grows = (
        f'growing at {growth:.1f}'
        if growth > error
        else f'growth rate {growth:.1f} +- {error:.1f}'
    )
    known = [
        (estimate.frequency, f'at {estimate.frequency:.1f} Hz'),
        (growth, f'{grows} 1/s'),
        (estimate.amplitude, f'amplitude {estimate.amplitude * 1e6:.3g} um'),
    ]
    words = [text for value, text in known if math.isfinite(value)]
    words += [advice] if (advice := estimate.advice.in_words()) else []
    return f'At {estimate.time:.6f} s: chatter {", ".join(words) or "flagged"}.'


_AFTER_CHATTER = {
    'stable': '; the cut is stable',
    'watch': '; what is left is still watched',
    'forced': '; what is left is the vibration of the spindle itself',
    'idle': '; nothing is cut',
}
"""How a state goes on in the sentence that chatter is over; of others there is nothing to say."""


def clearance(estimate: Estimate) -> str:
    """That it is over."""
    rest = _AFTER_CHATTER.get(estimate.state, '')
    return f'At {estimate.time:.6f} s: the chatter has died out{rest}.'


def withdrawn(at: float) -> str:
    """That the flag is down though nobody knows that the chatter has ended."""
    return (
        f'At {at:.6f} s: the flag is taken back, for this is another run; whether the chatter '
        'of the one before had ended is not known.'
    )


def sensors(estimate: Estimate) -> str:
    """Which sensors cannot be believed, and what is done without them."""
    works = f'works with: {estimate.mode.value}'
    if not estimate.faults:
        return f'At {estimate.time:.6f} s: all sensors are well again; {works}.'
    return f'At {estimate.time:.6f} s: {", ".join(estimate.faults)}; {works}.'


def two_publishers(names: Sequence[str], topic: str) -> str:
    """Who publishes what only one may."""
    return f'{several_publish(names, topic)}: nothing is judged until one is left.'


def best_effort(topic: str) -> str:
    """That not every publisher of a topic sees to it that what it sends comes."""
    lost = 'so what gets lost is not sent again'
    return f'A publisher of {topic} offers best effort only, {lost}.'
