"""`lathe-chatter export`: the samples of a run as CSV, Parquet, MAT, HDF5 or unrolled MCAP."""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from pathlib import Path

from lathe_chatter.cli.common_options import (
    PICTURES,
    add_json,
    add_run,
    add_topic,
    names_in,
    path_of,
    utf8,
)
from lathe_chatter.cli.console import Screen, writing
from lathe_chatter.errors import ParameterError
from lathe_chatter.recording import read_run
from lathe_chatter.recording.export import (
    discontinuity_sentences,
    to_csv,
    to_hdf5,
    to_mat,
    to_parquet,
)
from lathe_chatter.recording.one_message_per_sample import unroll
from lathe_chatter.recording.sample_series import Selection

EXAMPLE = 'lathe-chatter export runs/20260401-120000 --columns tool_displacement --start 3'

_FILES = {'csv': to_csv, 'parquet': to_parquet, 'mat': to_mat, 'hdf5': to_hdf5}
_OF_FORMAT = {
    'csv': ('.csv',),
    'parquet': ('.parquet',),
    'mat': ('.mat',),
    'hdf5': ('.h5', '.hdf5'),
}
"""Endings of the files of each format, the usual one first."""
_ENDINGS = {each for endings in _OF_FORMAT.values() for each in endings} | set(PICTURES)
"""Endings that say what a file is."""


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_run(parser)
    form = parser.add_mutually_exclusive_group()
    form.add_argument(
        '--format', choices=tuple(_FILES), default='csv', help='default: %(default)s'
    )
    form.add_argument(
        '--unrolled',
        action='store_true',
        help='an MCAP run with one std_msgs/Float64 for each sample of each signal, dated by '
        'simulated time: for viewers that do not unroll blocks of samples',
    )
    parser.add_argument(
        '--output',
        type=path_of,
        metavar='PATH',
        help='file, or folder of an unrolled run, to make',
    )
    add_topic(parser)
    parser.add_argument(
        '--columns', metavar='NAMES', help='signals, with commas between them (default: all)'
    )
    parser.add_argument('--start', type=float, default=-math.inf, help='simulated time, s')
    parser.add_argument('--end', type=float, default=math.inf, help='simulated time, s')
    add_json(parser)


def run(options: Namespace) -> int:
    """Export."""
    form = 'unrolled' if options.unrolled else options.format
    source: Path = options.run_path
    suffix = '-unrolled' if options.unrolled else _OF_FORMAT[form][0]
    path = options.output or source.with_name(f'{source.stem}{suffix}')
    columns = None if options.columns is None else names_in('--columns', options.columns)
    chosen = Selection(options.topic, columns, options.start, options.end)
    if options.unrolled and path.suffix in _ENDINGS:
        raise ParameterError('--output', str(path), '', 'the name of a folder')
    if not options.unrolled and path.suffix not in _OF_FORMAT[form]:
        allowed = f'a name that ends in {suffix}, as --format {form} is written'
        raise ParameterError('--output', str(path), '', allowed)
    if form != 'csv':
        utf8('--output', path)
    recorded = read_run(source)
    screen = Screen(json=options.json)
    total = recorded.count_of_samples(options.topic)
    with screen.progress('samples', total) as bar, writing(path):
        write = _FILES.get(form, unroll)
        done = write(recorded, path, chosen, bar.advance)
    for sentence in discontinuity_sentences(done):
        screen.say(f'note   {sentence}')
    screen.say(f'{done.samples} samples in {path}')
    screen.json(
        {
            'path': path,
            'samples': done.samples,
            'gaps': done.continuity.gap_places,
            'restarts': done.continuity.restart_places,
        }
    )
    return 0
