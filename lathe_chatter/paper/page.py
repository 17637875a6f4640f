"""One HTML page with the whole reproduction: it needs no other file and no network."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lathe_chatter.paper.figures import Picture, paper_pictures
from lathe_chatter.paper.open_questions import Findings, StiffnessEffect, Window
from lathe_chatter.paper.published_runs import PAPER_RUNS, run_named
from lathe_chatter.paper.reproduced_run import AGREEMENT, Reproduced
from lathe_chatter.paper.screening_function_variants import Reading
from lathe_chatter.shipped_files import rendered

OVERVIEWS = (
    Picture('growth', 'Growth in time', 'Each run against the slope that its root gives it.'),
    Picture('conditions', 'Conditions', 'Without BC the open limit holds, with BC the other.'),
    Picture('findings', 'Findings', 'Left: C. Right: the stiffness of the bearing.'),
)
PAGE = 'index.html'
_FAST = 10000.0
"""rev/min of the run whose axes tell two readings apart."""
_TEMPLATE = 'paper/page.html.j2'
_MEANINGS = {
    Reading.NONE: 'never 1: the bearing is never touched',
    Reading.GAP: 'equation (9) as printed: 1 while x_wp ≥ clearance',
    Reading.SEATED: 'always 1: the workpiece rests on its bearing',
    Reading.REVERSED: 'reversed: 1 while x_wp < clearance',
}


def write_page(
    folder: Path,
    results: Sequence[Reproduced],
    findings: Findings,
    pictures: Sequence[Picture] = (*OVERVIEWS, *paper_pictures()),
) -> Path:
    """Write the page.

    Args:
        folder: Where the pictures are, and the page goes.
        results: Of every run.
        findings: Of everything else.
        pictures: Those to show.

    Returns:
        The path of the page.
    """

    def shown(wanted: Sequence[Picture]) -> list[dict[str, str]]:
        return [
            {**picture._asdict(), 'data': _data(folder, picture)}
            for picture in wanted
            if picture in pictures
        ]

    with_bearing = sum(run.has_bearing for run in PAPER_RUNS)
    whole = [r for r in findings.screening if r.verdicts == len(PAPER_RUNS)]
    text = rendered(
        _TEMPLATE,
        results=results,
        agreement=AGREEMENT,
        findings=findings,
        runs=[_run_row(result) for result in results],
        coefficients=[
            (f'{reading.coefficient:.1e}', f'{reading.verdicts} of {len(PAPER_RUNS)}')
            for reading in findings.readings
        ],
        readings=[
            (
                _MEANINGS[reading.reading],
                f'{reading.verdicts} of {len(PAPER_RUNS)}',
                '; '.join(run_named(name).title for name in reading.against) or '-',
                _range(reading.coefficient, 1e-6, 4),
                _range(reading.axes_met, 1e3, 1),
                f'{reading.same_as_seated} of {with_bearing}',
            )
            for reading in findings.screening
        ],
        whole_readings=[_MEANINGS[reading.reading] for reading in whole],
        **_axes(findings),
        literal=[row for result in results for row in _literal_rows(result)],
        clearances=[
            (f'{gap * 1e6:g}', f'{rate:+.6f}', f'{size * 1e6:.3f}', f'{size / gap:.4f}')
            for gap, rate, size in zip(
                findings.clearance.clearances,
                findings.clearance.growth_rates,
                findings.clearance.amplitudes,
                strict=True,
            )
        ],
        stiffness=_stiffness(findings.stiffness),
        windows=[
            (f'{window.spindle_speed_rpm:g}', *_durations(window)) for window in findings.windows
        ],
        overviews=shown(OVERVIEWS[:2]),
        of_findings=shown(OVERVIEWS[2:]),
        of_paper=shown(paper_pictures()),
    )
    page = folder / PAGE
    page.write_text(text + '\n', encoding='utf-8')
    return page


def _range(ends: tuple[float, float] | None, factor: float, digits: int) -> str:
    """From and to, or that there is none."""
    if ends is None:
        return 'none'
    return ' to '.join(f'{end * factor:.{digits}f}' for end in ends)


def _axes(findings: Findings) -> dict[str, Any]:
    """When the readings meet the axes of the run that tells them apart, and in how many turns."""
    met = {reading.reading.value: reading.axes_met for reading in findings.screening}
    without = findings.axes_without_bearing or (math.inf, -math.inf)
    apart = [met[name] or (math.inf, -math.inf) for name in ('seated', 'reversed')]
    return {
        'axes': {name: _range(ends, 1e3, 1) for name, ends in met.items()},
        'turns': {name: _range(ends, _FAST / 60.0, 2) for name, ends in met.items()},
        'whole_turns': {
            name: ' and '.join(map(str, range(*_whole_turns(ends)))) if ends else 'none'
            for name, ends in met.items()
        },
        'axes_without': _range(findings.axes_without_bearing, 1e3, 1),
        'neither_excluded': all(low <= without[1] and without[0] <= high for low, high in apart),
        'same': next(
            f'{reading.same_as_seated} of {sum(run.has_bearing for run in PAPER_RUNS)}'
            for reading in findings.screening
            if reading.reading is Reading.REVERSED
        ),
    }


def _whole_turns(ends: tuple[float, float]) -> tuple[int, int]:
    """The first whole number of turns in a time, s, and the first beyond it."""
    return math.ceil(ends[0] * _FAST / 60.0), math.floor(ends[1] * _FAST / 60.0) + 1


def _run_row(result: Reproduced) -> tuple[str, ...]:
    """A run in the table of all."""
    return (
        result.run.title,
        ', '.join(result.run.places),
        result.run.words,
        'unstable' if result.unstable else 'stable',
        f'{result.root.real:+.6f} ± {result.root.imag:.6f}i',
        f'{result.measured.real:+.6f}',
        f'{abs(result.measured.real - result.root.real):.1e}',
        'yes' if result.agrees else 'no',
    )


def _literal_rows(result: Reproduced) -> list[tuple[str, ...]]:
    """A run with equation (9) as printed; none for a run without clearance."""
    literal = result.literal
    if literal is None:
        return []
    return [
        (
            result.run.title,
            f'{literal.reach * 1e6:.2f}',
            f'{(result.run.bearing_clearance or 0.0) * 1e6:g}',
            'never' if literal.touched_at is None else f'{literal.touched_at:.3f}',
            f'{literal.growth_rate:+.2f}',
            'unstable' if literal.unstable else 'stable',
            'yes' if result.literal_agrees else 'no',
        )
    ]


def _stiffness(effect: StiffnessEffect) -> dict[str, Any]:
    """What the bearing's stiffness does, at none, half and all of that of the workpiece."""
    half, equal = effect.shares.searchsorted((0.5, 1.0))
    return {
        'open': effect.workpiece_frequencies[0],
        'seated': effect.workpiece_frequencies[half],
        'tool': effect.tool_frequency,
        'limit_open': effect.limits[0],
        'limit_half': effect.limits[half],
        'limit_equal': effect.limits[equal],
        'worst': effect.worst,
    }


def _durations(window: Window) -> tuple[str, str]:
    """From and to, in ms and in turns."""
    ends = (window.shortest, window.longest)
    turns = (time * window.spindle_speed_rpm / 60.0 for time in ends)
    return (
        ' to '.join(f'{time * 1e3:.1f}' for time in ends),
        ' to '.join(f'{turn:.2f}' for turn in turns),
    )


def _data(folder: Path, picture: Picture) -> str:
    """A picture as it stands within the page."""
    return base64.b64encode((folder / f'{picture.name}.svg').read_bytes()).decode('ascii')
