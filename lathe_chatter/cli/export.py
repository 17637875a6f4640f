"""`lathe-chatter export`: the samples of a run as CSV, Parquet or unrolled MCAP."""

from __future__ import annotations

import json
import math
from argparse import ArgumentParser, Namespace
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from lathe_chatter.errors import LatheChatterError, reason_of
from lathe_chatter.recording import read_run
from lathe_chatter.recording.export import Selection, seam_sentences, to_csv, to_parquet, unroll

NAME = 'export'
HELP = 'write the samples of a recorded run as CSV, Parquet, or one message per sample'
EXAMPLE = 'lathe-chatter export runs/20260401-120000 --columns tool_displacement --start 3'

_FORMATS = {'csv': to_csv, 'parquet': to_parquet, 'unrolled': unroll}


class ExportFailedError(LatheChatterError):
    """The file cannot be written; the text says why."""


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument('run_path', type=Path, metavar='RUN', help='folder or file of a run')
    form = parser.add_mutually_exclusive_group()
    form.add_argument(
        '--format', choices=('csv', 'parquet'), default='csv', help='default: %(default)s'
    )
    form.add_argument(
        '--unrolled',
        action='store_true',
        help='an MCAP run with one std_msgs/Float64 for each sample of each signal, dated by '
        'simulated time: for viewers that do not unroll blocks of samples',
    )
    parser.add_argument(
        '--output', type=Path, metavar='PATH', help='file, or folder of an unrolled run, to make'
    )
    parser.add_argument('--topic', help='of the samples, where the run has several lathes')
    parser.add_argument(
        '--columns', metavar='NAMES', help='signals, with commas between them (default: all)'
    )
    parser.add_argument('--start', type=float, default=-math.inf, help='simulated time, s')
    parser.add_argument('--end', type=float, default=math.inf, help='simulated time, s')
    parser.add_argument('--json', action='store_true', help='print the figures as JSON')


def run(options: Namespace) -> int:
    """Export."""
    form = 'unrolled' if options.unrolled else options.format
    source: Path = options.run_path
    suffix = '-unrolled' if options.unrolled else f'.{form}'
    path = options.output or source.with_name(f'{source.stem}{suffix}')
    columns = None
    if options.columns is not None:
        columns = tuple(name.strip() for name in options.columns.split(','))
    chosen = Selection(options.topic, columns, options.start, options.end)
    recorded = read_run(source)
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    with Progress(console=console, transient=True) as progress:
        bar = progress.add_task('samples', total=recorded.count_of_samples(options.topic))
        try:
            done = _FORMATS[form](
                recorded, path, chosen, lambda count: progress.advance(bar, count)
            )
        except OSError as error:
            raise ExportFailedError(f'{path} cannot be written: {reason_of(error)}.') from None
    for sentence in seam_sentences(done):
        console.print(f'note   {sentence}', markup=False)
    out = Console(highlight=False, soft_wrap=True)
    if options.json:
        figures = {
            'path': str(path),
            'samples': done.samples,
            'gaps': done.seams.gaps,
            'restarts': done.seams.restarts,
        }
        out.print(json.dumps(figures), markup=False)
    else:
        out.print(f'{done.samples} samples in {path}', markup=False)
    return 0
