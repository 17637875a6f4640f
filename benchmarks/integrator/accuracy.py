"""How right the lathe is: against 36 digits, and against itself at a tenth of the step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from cases import CHATTER, DURATION, LINEAR, PAPER, RATE, Case, error, exact, located, run
from figures import Figure, Line, tracked
from support.reference.solution import event_error, relative_error

from lathe_chatter.array_types import Array
from lathe_chatter.lathe import Event

_RAMP = 3e4  # rev/min per s
_RAMP_ENDS = 4213.0  # rev/min
_RAMP_BEGINS = 0.07  # s


def accuracy() -> list[Line]:
    """Both."""
    return [*against_thirty_digits(), *against_a_tenth_of_the_step()]


def against_thirty_digits() -> list[Line]:
    """Errors and events of the paper's cut with both forces."""
    lines: list[Line] = []
    errors, miscounted, late = [], 0, []
    for case in tracked(PAPER, 'against the Taylor reference'):
        found, expected = run(case), exact(case)
        errors.append(error(found, expected))
        late.append(event_error(found.events, expected.events))
        miscounted += abs(len(found.events) - len(expected.events))
        note = f'{len(found.events)} events of {len(expected.events)}, within {late[-1]:.1e} s'
        lines.append(Figure(f'error: {case.name}', errors[-1], goal=1e-9, note=note))
    return [
        *lines,
        Figure(
            'largest error / local amplitude', max(errors), goal=1e-9, note='100 us, 1 s, 1 mm'
        ),
        Figure('events too many or too few', miscounted, goal=0.0),
        Figure('largest difference of an event in time', max(late), 's', goal=1e-9),
    ]


def against_a_tenth_of_the_step() -> list[Line]:
    """The same where no short reference exists: a speed that is not constant, or not round."""
    lines: list[Line] = []
    uneven = {'spindle_speed_rpm': 3001.7}
    varied = {'speed_variation_amplitude': 0.2, 'speed_variation_frequency': 7.0}
    variants = [
        (what, changed)
        for case in (LINEAR, CHATTER)
        for what, changed in (
            ('3001.7 rev/min', case.with_changes(**uneven)),
            ('ramp', replace(case.with_changes(**uneven), spindle_acceleration=_RAMP)),
            ('variation of speed', case.with_changes(**uneven, **varied)),
        )
    ]
    for what, case in tracked(variants, 'against a tenth of the step'):
        (coarse, found), (fine, expected) = refined(case, 1), refined(case, 10)
        size = relative_error(coarse, fine, RATE)
        late = event_error(located(found), located(expected))
        force = 'total force, gap 5 um' if case.total_force else 'linear force, none'
        note = f'{len(found)} events of {len(expected)}, within {late:.1e} s'
        lines.append(Figure(f'a tenth of the step: {what}, {force}', size, goal=1e-8, note=note))
    return lines


def refined(case: Case, refinement: int) -> tuple[Array, list[Event]]:
    """States at every 100 us and the events, taken in steps that many times shorter."""
    lathe = case.lathe(RATE * refinement)
    before = round(_RAMP_BEGINS * RATE)
    blocks, events = [lathe.advance(before * refinement)], list(lathe.events)
    if case.spindle_acceleration:
        lathe.retune(lathe.cut.with_changes(spindle_speed_rpm=_RAMP_ENDS))
    blocks.append(lathe.advance((round(DURATION * RATE) - before) * refinement))
    samples = np.concatenate(blocks)[refinement - 1 :: refinement]
    return samples[:, 2:6], events + list(lathe.events)
