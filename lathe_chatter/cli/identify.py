"""`lathe-chatter identify`: a tap test to a machine file, with standard errors and a picture."""

from __future__ import annotations

import argparse
import math
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from lathe_chatter.cli.common_options import PICTURES, add_force, add_json, in_unit, path_of
from lathe_chatter.cli.console import Screen, keep_existing, writing
from lathe_chatter.errors import ParameterError
from lathe_chatter.model import Machine, Mode
from lathe_chatter.model.cut import BearingContact
from lathe_chatter.model.machine import Structure
from lathe_chatter.model.machine_file import MachineDescription, load_machine
from lathe_chatter.model.quantity_fields import Quantity
from lathe_chatter.model.uncertainty import Uncertainty
from lathe_chatter.plot_style import files_of_picture
from lathe_chatter.tap_test import ModalFit, fit_modes, read_frequency_responses

EXAMPLE = 'lathe-chatter identify tool=tool.uff workpiece=shaft.csv --output machine.yaml'

_BODIES = ('tool', 'workpiece')
_HIGHEST = Quantity('end of a band', 'Hz', high=1e6)


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        'files', nargs='+', metavar='[BODY=]FILE', type=_body_and_file,
        help='frequency responses of tool or workpiece where it cuts, of the tool where no body '
        'is named: universal files (dataset 58) or CSV; one body may have several, of the same '
        'point',
    )  # fmt: skip
    parser.add_argument(
        '--output', type=path_of, required=True, metavar='FILE',
        help='machine file to write; the picture of the fit is written beside it',
    )  # fmt: skip
    parser.add_argument(
        '--machine', metavar='FILE',
        help='machine file that gives what is not identified (default: none; what is not '
        'measured is then left out of the file)',
    )  # fmt: skip
    parser.add_argument(
        '--modes', nargs='*', default=[], metavar='BODY=N', type=_body_and_count,
        help='number of modes (default: found)',
    )  # fmt: skip
    parser.add_argument(
        '--from', dest='low', type=in_unit('Hz'), default=0.0, metavar='HZ',
        help='lowest frequency used, Hz',
    )  # fmt: skip
    parser.add_argument(
        '--to', dest='high', type=in_unit('Hz'), default=_HIGHEST.high, metavar='HZ',
        help='highest frequency used, Hz',
    )  # fmt: skip
    add_force(parser)
    add_json(parser)


def _body_and_file(text: str) -> tuple[str, Path]:
    body, equals, file = text.partition('=')
    if not equals and text:
        return 'tool', path_of(text)
    if body not in _BODIES or not file:
        raise argparse.ArgumentTypeError(
            f'{text!r} must be a file of the tool, tool=FILE or workpiece=FILE'
        )
    return body, path_of(file)


def _body_and_count(text: str) -> tuple[str, int]:
    body, _, count = text.partition('=')
    if body not in _BODIES or not count.isdigit():
        raise argparse.ArgumentTypeError(f'{text!r} must be tool=N or workpiece=N')
    return body, int(count)


def run(options: Namespace) -> int:
    """Fit, write and print."""
    screen = Screen(json=options.json)
    output: Path = options.output
    if output.suffix in PICTURES:
        allowed = 'no name of a picture, which is drawn beside it, but one as machine.yaml'
        raise ParameterError('--output', str(output), '', allowed)
    picture = output.with_suffix('.png')
    keep_existing(output, *files_of_picture(picture), force=options.force)
    base = _base(options.machine)
    low, high = _HIGHEST.check('--from', options.low), _HIGHEST.check('--to', options.high)
    fits: dict[str, ModalFit] = {}
    with screen.working('Fitting the modes ...'):
        for body in _BODIES:
            files = [file for name, file in options.files if name == body]
            if files:
                responses = [r for file in files for r in read_frequency_responses(file)]
                fits[body] = fit_modes(
                    responses,
                    modes=dict(options.modes).get(body),
                    lowest_frequency=low,
                    highest_frequency=high,
                )
    described = _described(base, fits)
    unknown = _unknown(fits, base, given=options.machine is not None)
    said = _said_of(unknown) if unknown else ''
    with writing(output):
        described.save(output, lacking=unknown, comment=said)
    from lathe_chatter.report.modal_fit import draw_fits

    with writing(picture):
        draw_fits(fits, picture)
    _show(screen, fits)
    if said:
        screen.say(f'WARNING  {said}')
    screen.name_file('machine', output)
    screen.name_file('picture', picture)
    screen.json({'machine': output, 'picture': picture, 'modes': {
        body: [{**_figures(mode), 'errors': dict(zip(_FIGURES, mode.errors, strict=True))}
               for mode in fit.modes] for body, fit in fits.items()},
        'warnings': [said for fit in fits.values() for said in fit.warnings],
        'not_measured': unknown})  # fmt: skip
    return 0


_UNKNOWN = {
    'tool': 'the tool (if it is rigid, add the line `tool: rigid`)',
    'workpiece': 'the workpiece (if it is rigid, add the line `workpiece: rigid`)',
    'bearing': 'the bearing and its clearance',
    'material': 'the cutting coefficient (steel has about 2000 MPa)',
    'spindle': "the spindle's speeds",
    'cut': 'the cut',
}


def _unknown(fits: dict[str, ModalFit], base: MachineDescription, *, given: bool) -> list[str]:
    """Sections that neither tap tests nor a machine file say anything of."""
    if not given:
        return [name for name in _UNKNOWN if name not in fits]
    lacking = [name for name in base.assumed if name not in fits]
    return ['material' if name == 'cutting_coefficient' else name for name in lacking]


def _said_of(unknown: Sequence[str]) -> str:
    """What the file lacks, and what a machine without that is: see `load_machine`."""
    others = []
    if 'bearing' in unknown and 'workpiece' not in unknown:
        others.append('there is no bearing')
    if 'spindle' in unknown:
        others.append('the spindle may turn at any speed')
    names = ', '.join(_UNKNOWN[name] for name in unknown)
    but = f', except that {" and ".join(others)}' if others else ''
    return (
        f'Not measured, and so not in the file: {names}. Until they are added, the values of the '
        f"paper's machine stand in for them{but}."
    )


_FIGURES = ('frequency', 'damping_ratio', 'stiffness')


def _figures(mode: object) -> dict[str, float]:
    return {name: getattr(mode, name) for name in _FIGURES}


def _base(source: str | None) -> MachineDescription:
    """What is not identified: of a file, or a machine without a bearing."""
    if source is not None:
        return load_machine(source)
    described = MachineDescription()
    cut = described.cut.with_changes(bearing_contact=BearingContact.NONE)
    return replace(described, cut=cut)


def _described(base: MachineDescription, fits: dict[str, ModalFit]) -> MachineDescription:
    """The base with the identified modes and their covariance."""
    known = base.uncertainty or Uncertainty()
    bodies: dict[str, Any] = {}
    for body, fit in fits.items():
        modes = tuple(
            Mode(mode.mass, 2.0 * math.pi * mode.frequency, mode.damping_ratio)
            for mode in fit.modes
        )
        bodies[body] = modes[0] if len(modes) == 1 else Structure(modes)
        known = known.with_covariance(body, len(modes), fit.covariance)
    machine: Machine = replace(base.machine, **bodies)
    return replace(base, machine=machine, uncertainty=known)


def _show(screen: Screen, fits: dict[str, ModalFit]) -> None:
    rows: list[Sequence[str]] = []
    for body, fit in fits.items():
        for number, mode in enumerate(fit.modes, 1):
            f, z, k = mode.errors
            rows.append((
                body,
                str(number),
                f'{mode.frequency:.4f} ± {f:.2g}',
                f'{100.0 * mode.damping_ratio:.4f} ± {100.0 * z:.2g}',
                f'{mode.stiffness * 1e-6:.5g} ± {k * 1e-6:.2g}',
                f'{mode.mass:.4g}',
            ))  # fmt: skip
    titles = ('body', 'mode', 'frequency / Hz', 'damping / %', 'stiffness / (N/µm)', 'mass / kg')
    screen.table(
        {title: 'left' if k == 0 else 'right' for k, title in enumerate(titles)}, rows,
        'Modes, each figure ± its standard error:',
    )  # fmt: skip
    for body, fit in fits.items():
        for said in fit.warnings:
            screen.say(f'WARNING  {body}: {said}')
