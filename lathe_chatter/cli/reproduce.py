"""`lathe-chatter reproduce`: the paper's 14 runs, judged and drawn."""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future, as_completed
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from lathe_chatter.cli.common_options import add_force, add_json, path_of
from lathe_chatter.cli.console import INTERRUPTED, Screen, keep_existing, plain, writing
from lathe_chatter.errors import OutputError
from lathe_chatter.executors import Processes
from lathe_chatter.paper import PAPER_RUNS, Findings, Reproduced, find, reproduce_run
from lathe_chatter.paper.figures import Picture, draw_paper_picture, paper_pictures
from lathe_chatter.paper.page import OVERVIEWS, PAGE, write_page
from lathe_chatter.paper.summary_pictures import draw_conditions, draw_findings, draw_growth
from lathe_chatter.plot_style import files_of_picture

EXAMPLE = 'lathe-chatter reproduce --output reproduction'

FIGURES = 'reproduction.json'
_FINDING_STEPS = 3


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        '--output', type=path_of, default=Path('reproduction'), metavar='DIR',
        help='folder for the page and its pictures (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--no-pictures',
        action='store_true',
        help='leave out the pictures: tables and figures only',
    )
    add_force(parser)
    add_json(parser)


def run(options: Namespace) -> int:
    """Reproduce; 0 if every verdict of the paper agrees, else 1."""
    folder: Path = options.output
    pictures = [] if options.no_pictures else [*OVERVIEWS, *paper_pictures()]
    drawn = [file for picture in pictures for file in files_of_picture(folder / picture.name)]
    keep_existing(folder / PAGE, folder / FIGURES, *drawn, force=options.force)
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    screen = Screen(json=options.json)
    screen.compile()
    try:
        with writing(folder):
            results, findings = _work(folder, pictures, screen)
    except KeyboardInterrupt:
        for file in drawn:
            file.unlink(missing_ok=True)
        screen.say('Interrupted: what was drawn is removed again.')
        return INTERRUPTED
    with writing(folder):
        page = write_page(folder, results, findings, pictures)
        figures = figures_of(results, findings)
        text = json.dumps(plain(figures), indent=2, allow_nan=False)
        (folder / FIGURES).write_text(text + '\n', encoding='utf-8')
    _show(results, findings, screen)
    screen.name_file('page', page)
    screen.name_file('figures', folder / FIGURES)
    screen.json(figures)
    return 0 if all(result.agrees for result in results) else 1


def _work(
    folder: Path, pictures: Sequence[Picture], screen: Screen
) -> tuple[list[Reproduced], Findings]:
    """Compute here while other processes draw."""
    total = len(PAPER_RUNS) + _FINDING_STEPS + len(pictures)
    with _workers() as pool, screen.progress('runs and pictures', total) as bar:
        drawn: list[Future[None]] = []

        def step(_: Any = None) -> None:
            bar.advance()

        def draw(work: Callable[..., None], *arguments: Any) -> None:
            future = pool.submit(work, *arguments)
            future.add_done_callback(step)
            drawn.append(future)

        for picture in pictures:
            if picture not in OVERVIEWS:
                draw(draw_paper_picture, picture.name, folder)
        results = []
        for paper_run in PAPER_RUNS:
            results.append(reproduce_run(paper_run))
            step()
        findings = find(progress=step)
        if pictures:
            draw(draw_growth, results, folder / 'growth')
            draw(draw_conditions, results, folder / 'conditions')
            draw(draw_findings, findings, folder / 'findings')
        for future in as_completed(drawn):
            future.result()
    return results, findings


@contextmanager
def _workers() -> Iterator[Processes]:
    """Processes that draw; when something goes wrong here they begin nothing more.

    Raises:
        OutputError: If they are killed again and again.
    """
    try:
        with Processes() as pool:
            yield pool
    except BrokenExecutor:
        raise OutputError(
            'Processes that draw were killed, perhaps for want of memory: --no-pictures does '
            'without.'
        ) from None


def figures_of(results: list[Reproduced], findings: Findings) -> dict[str, Any]:
    """Everything that was found, as JSON holds it; SI units, growth rates in 1/s."""
    runs = []
    for result in results:
        literal = result.literal
        runs.append(
            {
                'name': result.run.name,
                'spindle_speed_rpm': result.run.spindle_speed_rpm,
                'depth_of_cut': result.run.depth_of_cut,
                'bearing_clearance': result.run.bearing_clearance,
                'places': result.run.places,
                'words': result.run.words,
                'paper_unstable': result.run.unstable,
                'unstable': result.unstable,
                'root': {'growth_rate': result.root.real, 'angular_frequency': result.root.imag},
                'measured': {
                    'growth_rate': result.measured.real,
                    'angular_frequency': result.measured.imag,
                },
                'agrees': result.agrees,
                'equation_9': literal
                and {**asdict(literal), 'unstable': literal.unstable}
                | {'agrees': result.literal_agrees},
            }
        )
    stiffness = findings.stiffness
    return {
        'runs': runs,
        'agreeing': sum(result.agrees for result in results),
        'cutting_coefficient': asdict(findings.coefficient)
        | {'readings': [asdict(reading) for reading in findings.readings]},
        'screening_function': findings.screening,
        'axes_without_bearing': findings.axes_without_bearing,
        'clearance': asdict(findings.clearance),
        'bearing_stiffness': {
            'share_of_workpiece': stiffness.shares,
            'critical_depth': stiffness.limits,
            'worst_share': stiffness.worst,
        },
        'figure_windows': [asdict(window) for window in findings.windows],
    }


def _show(results: list[Reproduced], findings: Findings, screen: Screen) -> None:
    """Print what was found."""
    titles = {'run': 'left', 'the paper': 'left'}
    titles |= dict.fromkeys(('root', 'measured', 'agrees', 'eq. (9)'), 'right')
    rows = [
        (
            result.run.title,
            result.run.pace.value,
            f'{result.root.real:+.4f}',
            f'{result.measured.real:+.4f}',
            'yes' if result.agrees else 'no',
            _literal_word(result),
        )
        for result in results
    ]
    screen.table(titles, rows)
    found = findings.coefficient
    verdicts = {reading.reading.value: reading.verdicts for reading in findings.screening}
    count = len(results)
    agreeing = sum(result.agrees for result in results)
    screen.say(
        f'{agreeing} of {count} verdicts agree. Growth rates in 1/s: of the rightmost root, and\n'
        'measured from the time simulation; eq. (9): the same with the screening function as '
        'printed.\n'
        f'All verdicts hold together for {found.low:.5g} < C < {found.high:.5g} N/m2.\n'
        f'Screening function never 1: {verdicts["none"]} of {count} verdicts hold; as printed: '
        f'{verdicts["gap"]}; always 1: {verdicts["seated"]}; as printed, but its sign turned '
        f'round: {verdicts["reversed"]}.'
    )


def _literal_word(result: Reproduced) -> str:
    """What equation (9) as printed comes to, empty for a run without clearance."""
    if result.literal is None:
        return ''
    return 'agrees' if result.literal_agrees else 'stable'
