from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.tap_tests import tap_test

from lathe_chatter.cli import main as cli
from lathe_chatter.model.cut import BearingContact
from lathe_chatter.model.machine_file import load_machine

pytest.importorskip('sdypy.EMA', reason='the extra `identify` is not installed')

TOOL, SHAFT = ((300.0, 0.03, 7.1e6),), ((120.0, 0.03, 1.1e7), (480.0, 0.02, 9e7))


@pytest.fixture
def tap_tests(tmp_path: Path) -> dict[str, Path]:
    files = {}
    for body, modes in (('tool', TOOL), ('workpiece', SHAFT)):
        truth = tap_test(modes, floor=0.005, frequency=0.5 * np.arange(1, 1601))
        rows = (
            f'{f:.17g},{h.real:.17g},{h.imag:.17g}'
            for f, h in zip(truth.frequency, truth.response, strict=True)
        )
        head = 'frequency (Hz),real (m/N),imaginary (m/N)'
        files[body] = tmp_path / f'{body}.csv'
        files[body].write_text('\n'.join((head, *rows)))
    return files


def test_a_tap_test_becomes_a_machine_file_and_a_picture(
    tap_tests: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / 'machine.yaml'
    given = [str(tap_tests['tool']), f'workpiece={tap_tests["workpiece"]}']  # bare: the tool's
    assert cli.main(['identify', *given, '--output', str(output), '--json']) == 0
    told = json.loads(capsys.readouterr().out)
    assert len(told['modes']['workpiece']) == 2
    found = load_machine(output)
    assert found.machine.tool.stiffness == pytest.approx(7.1e6, rel=0.01)
    assert found.uncertainty is not None
    share = found.uncertainty.error_of('workpiece.modes[1].damping_ratio')
    assert share == pytest.approx(
        told['modes']['workpiece'][1]['errors']['damping_ratio']
        / told['modes']['workpiece'][1]['damping_ratio']
    )
    assert output.with_suffix('.png').stat().st_size > 10_000
    assert cli.main(['identify', *given, '--output', str(output)]) == 2
    assert '--force' in capsys.readouterr().err


def test_what_was_not_measured_is_said_and_left_out(
    tap_tests: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / 'machine.yaml'
    call = ['identify', f'tool={tap_tests["tool"]}', '--output', str(output)]
    assert cli.main(call) == 0
    said = capsys.readouterr().out
    for name in (
        'the workpiece (if it is rigid, add the line `workpiece: rigid`',
        'cutting coefficient',
        'speeds',
        'clearance',
    ):
        assert name in said.partition('WARNING  Not measured')[2]
        assert name in output.read_text().splitlines()[0]
    assert said.splitlines()[-3].endswith(
        "Until they are added, the values of the paper's machine stand in for them, except that "
        'the spindle may turn at any speed.'
    )
    assert set(yaml.safe_load(output.read_text())) == {'tool'}
    assert load_machine(output).assumed == ('workpiece', 'cutting_coefficient')
    assert cli.main([*call, '--machine', 'chucked_shaft', '--force']) == 0
    assert 'Not measured' not in capsys.readouterr().out
    assert load_machine(output).machine.cutting_coefficient > 1e8
    both = ['identify', *(f'{body}={file}' for body, file in tap_tests.items())]
    assert cli.main([*both, '--output', str(output), '--force']) == 0
    said = capsys.readouterr().out
    assert 'except that there is no bearing and the spindle may turn at any' in said
    assert load_machine(output).cut.bearing_contact is BearingContact.NONE


def test_a_machine_file_is_not_overwritten_with_its_picture(
    tap_tests: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call = ['identify', f'tool={tap_tests["tool"]}', '--output', str(tmp_path / 'x.png')]
    assert cli.main(call) == 2
    assert 'no name of a picture' in capsys.readouterr().err
    assert not (tmp_path / 'x.png').exists()


@pytest.mark.parametrize('wrong', ['spindle=a.csv', '', 'tool='])
def test_a_file_is_of_a_body(
    wrong: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(['identify', wrong, '--output', str(tmp_path / 'machine.yaml')])
    assert ended.value.code == 2
    assert 'tool=FILE' in capsys.readouterr().err
