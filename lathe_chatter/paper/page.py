"""One HTML page with the whole reproduction: it needs no other file and no network."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from lathe_chatter.model import BearingContact
from lathe_chatter.paper.figures import Picture, paper_pictures
from lathe_chatter.paper.findings import Findings
from lathe_chatter.paper.reproduction import AGREEMENT, Reproduced
from lathe_chatter.paper.runs import PAPER_RUNS, run_named

OVERVIEWS = (
    Picture('growth', 'Growth in time', 'Each run against the slope that its root gives it.'),
    Picture('conditions', 'Conditions', 'Without BC the open limit holds, with BC the other.'),
    Picture('findings', 'Findings', 'Left: C. Right: the stiffness of the bearing.'),
)
PAGE = 'index.html'
_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 2rem auto; padding: 0 1rem;
  color: #1a1a1a; background: #fff }
table { border-collapse: collapse; margin: 1rem 0; font-size: 0.9rem }
th, td { padding: 0.25rem 0.6rem; border-bottom: 1px solid #ccc; text-align: left;
  vertical-align: top }
td.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap }
figure { margin: 2rem 0 } figure img { width: 100%; height: auto }
.no { color: #a02050; font-weight: 600 } .scroll { overflow-x: auto }
nav a { margin-right: 0.8rem; white-space: nowrap }
"""

_OUT_OF_REACH = """
C = 3.5e-9 N/m as printed: nothing regenerates with it, and its unit does not multiply a width
and a thickness to a force. Reproduced with 3.5e6 N/m².

The runs "with BC" at 0.5 mm with equation (9) as printed: see the screening function.

The history y(t ≤ 0): a position f/1000 that stays while the velocity is v contradicts itself.
Nothing hangs on it, since the force sees only the difference of tool and workpiece, which is 0
until t = 0 either way.

"More clearance means more flexibility thus more instability": the equations have no such effect
on the growth rate, see above.

The curves point by point: only the scan exists, without its pictures. What it keeps of the
numbers at the axes agrees.

The titles of Tables 2 and 3 are lost; the text calls for displacement and velocity histories,
which stand under these names here.

Table 4 is headed "BC of 6e-6 m" where the text has 60e-6 m, and the conclusion has 5e-5 m where
the figures have 5e-6 m: the text and the figures are followed.

The comparison with Peng et al.: a milling process, whose parameters are not given.
""".strip().split('\n\n')


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
    agreeing = sum(result.agrees for result in results)
    introduction = (
        '<h1>Bearing clearance and chatter: the paper reproduced</h1>'
        '<p>Every simulation of <cite>Modelling and Simulation of Bearing Clearance Effects on '
        'the Chatter Stability of Turning Process</cite>, European Journal of Advances in '
        'Engineering and Technology 9(5), 2022, with its verdict, the exact characteristic root, '
        'and the growth rate measured from the time simulation. '
        f'<strong>{agreeing} of {len(results)} verdicts agree</strong>, each measured rate within '
        f'{AGREEMENT:g} 1/s of its root.</p>'
    )
    body = [
        introduction,
        _contents(pictures),
        _runs(results),
        *(_figure(folder, picture) for picture in OVERVIEWS[:2] if picture in pictures),
        _coefficient(findings),
        _screening(results, findings),
        *(_figure(folder, picture) for picture in OVERVIEWS[2:] if picture in pictures),
        _clearance(findings),
        _stiffness(findings),
        _duration(findings),
        _out_of_reach(),
        '<h2>The tables and figures of the paper</h2>',
        *(_figure(folder, picture) for picture in paper_pictures() if picture in pictures),
    ]
    page = folder / PAGE
    page.write_text(
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>The paper reproduced</title><style>{_STYLE}</style></head><body>\n'
        + '\n'.join(body)
        + '\n</body></html>\n',
        encoding='utf-8',
    )
    return page


def _contents(pictures: Sequence[Picture]) -> str:
    links = (f'<a href="#{p.name}">{escape(p.place)}</a>' for p in pictures)
    return f'<nav>{"".join(links)}</nav>'


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]], numbers: set[int]) -> str:
    """A table; the columns in `numbers` are set to the right."""
    head = ''.join(f'<th>{escape(text)}</th>' for text in heads)

    def cell(column: int, text: str) -> str:
        kind = ' class="n"' if column in numbers else ''
        mark = f'<span class="no">{text}</span>' if text == 'no' else escape(text)
        return f'<td{kind}>{mark}</td>'

    lines = (
        '<tr>' + ''.join(cell(column, text) for column, text in enumerate(row)) + '</tr>'
        for row in rows
    )
    return (
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{"".join(lines)}'
        '</tbody></table></div>'
    )


def _runs(results: Sequence[Reproduced]) -> str:
    rows = [
        (
            result.run.title,
            ', '.join(result.run.places),
            result.run.words,
            'unstable' if result.unstable else 'stable',
            f'{result.root.real:+.6f} ± {result.root.imag:.6f}i',
            f'{result.measured.real:+.6f}',
            f'{abs(result.measured.real - result.root.real):.1e}',
            'yes' if result.agrees else 'no',
        )
        for result in results
    ]
    heads = (
        'run', 'where', 'in the words of the paper', 'here', 'rightmost root, 1/s and rad/s',
        'measured, 1/s', 'difference', 'agrees',
    )  # fmt: skip
    return '<h2>The 14 runs</h2>' + _table(heads, rows, {4, 5, 6})


def _coefficient(findings: Findings) -> str:
    found = findings.coefficient
    rows = [
        (f'{reading.coefficient:.1e}', f'{reading.verdicts} of {len(PAPER_RUNS)}')
        for reading in findings.readings
    ]
    return (
        '<h2>The cutting force coefficient</h2>'
        '<p>The paper prints C = 3.5e-9 N/m. With Table 1 and the two depths, all of its '
        f'verdicts hold together only for {found.low:.6g} &lt; C &lt; {found.high:.6g} N/m² '
        '(scanned over twenty decades, both ends bisected). Below, the first to fail is '
        f'{escape(found.too_low_for)}; above, {escape(found.too_high_for)}. '
        'Of the powers of ten that the mantissa 3.5 could have, one lies inside.</p>'
        + _table(('C, N/m²', 'verdicts that hold'), rows, {0})
    )


def _screening(results: Sequence[Reproduced], findings: Findings) -> str:
    meanings = {
        BearingContact.NONE: 'never 1: the bearing is never touched',
        BearingContact.GAP: 'equation (9) as printed: 1 while x_wp ≥ clearance',
        BearingContact.SEATED: 'always 1: the workpiece rests on its bearing',
    }
    readings = [
        (
            meanings[reading.contact],
            f'{reading.verdicts} of {len(PAPER_RUNS)}',
            '; '.join(run_named(name).title for name in reading.against) or '-',
        )
        for reading in findings.screening
    ]
    rows = []
    for result in results:
        literal = result.literal
        if literal is None:
            continue
        touched = literal.touched_at
        rows.append(
            (
                result.run.title,
                f'{literal.reach * 1e6:.2f}',
                f'{(result.run.bearing_clearance or 0.0) * 1e6:g}',
                'never' if touched is None else f'{touched:.3f}',
                f'{literal.growth_rate:+.2f}',
                'unstable' if literal.unstable else 'stable',
                'yes' if result.literal_agrees else 'no',
            )
        )
    heads = (
        'run', 'workpiece reaches, µm', 'clearance, µm', 'touches at, s', 'growth at the end, 1/s',
        'verdict', 'agrees',
    )  # fmt: skip
    return (
        '<h2>The screening function</h2>'
        '<p>Three readings of δ, each held against all verdicts:</p>'
        + _table(('δ', 'verdicts that hold', 'wrong for'), readings, set())
        + '<p>Equation (9) as printed, simulated from the history of the paper at each of its '
        'conditions with a clearance. At 0.5 mm the workpiece never crosses the gap, so that the '
        'cut stays as stable as without a bearing. Only with the screening function held at 1 '
        'do the figures come out.</p>' + _table(heads, rows, {1, 2, 3, 4})
    )


def _clearance(findings: Findings) -> str:
    effect = findings.clearance
    rows = [
        (f'{gap * 1e6:g}', f'{rate:+.6f}', f'{size * 1e6:.3f}', f'{size / gap:.4f}')
        for gap, rate, size in zip(
            effect.clearances, effect.growth_rates, effect.amplitudes, strict=True
        )
    ]
    return (
        '<h2>"More clearance, more instability"</h2>'
        '<p>With the bearing engaged throughout the machine is linear and the clearance only '
        'shifts where it rests, to k_bc/(k_wp + k_bc) = 1/3 of it. The growth rate does not '
        'depend on it; the vibration starts larger, in proportion to the step that the workpiece '
        'takes.</p>'
        + _table(
            ('clearance, µm', 'growth rate, 1/s', 'tool at 0.5 s, µm', 'tool/clearance'),
            rows,
            {0, 1, 2, 3},
        )
    )


def _stiffness(findings: Findings) -> str:
    effect = findings.stiffness
    half = float(effect.limits[effect.shares.searchsorted(0.5)])
    twice = float(effect.limits[effect.shares.searchsorted(1.0)])
    return (
        '<h2>Why contact destabilises</h2>'
        '<p>The paper explains the instability by a loss of stiffness. In its own equation (10) '
        'the bearing adds stiffness: the frequency of the workpiece rises from '
        f'{effect.workpiece_frequencies[0]:.0f} to '
        f'{effect.workpiece_frequencies[effect.shares.searchsorted(0.5)]:.0f} rad/s, next to the '
        f'{effect.tool_frequency:.0f} rad/s of the tool, and two modes that answer together '
        f'regenerate more. At 3000 rpm the limit falls from {effect.limits[0] * 1e3:.4f} to '
        f'{half * 1e3:.4f} mm with the k_bc = 0.5 k_wp of the paper, close to the worst there is '
        f'({effect.worst:g} k_wp); with k_bc = k_wp it is {twice * 1e3:.4f} mm, above that of '
        'the open machine.</p>'
    )


def _duration(findings: Findings) -> str:
    rows = [
        (
            f'{window.spindle_speed_rpm:g}',
            f'{window.shortest * 1e3:.1f} to {window.longest * 1e3:.1f}',
            ' to '.join(
                f'{time * window.spindle_speed_rpm / 60.0:.2f}'
                for time in (window.shortest, window.longest)
            ),
        )
        for window in findings.windows
    ]
    return (
        '<h2>How long the paper simulated</h2>'
        '<p>It does not say. In the scan of its Table 4 some numbers of the axes survive; these '
        'are the durations with which the simulated velocity of the tool ends between the last '
        'two ticks of all of them. The pictures below span 5 turns and 20 turns.</p>'
        + _table(('speed, rpm', 'duration, ms', 'in turns'), rows, {0, 1, 2})
    )


def _out_of_reach() -> str:
    return (
        '<h2>What cannot be reproduced, and why</h2><ul>'
        + ''.join(f'<li>{escape(point)}</li>' for point in _OUT_OF_REACH)
        + '</ul>'
    )


def _figure(folder: Path, picture: Picture) -> str:
    """A picture, within the page."""
    data = base64.b64encode((folder / f'{picture.name}.svg').read_bytes()).decode('ascii')
    text = escape(f'{picture.place}. {picture.caption}')
    return (
        f'<figure id="{picture.name}"><img alt="{text}" '
        f'src="data:image/svg+xml;base64,{data}"><figcaption>{text}</figcaption></figure>'
    )
