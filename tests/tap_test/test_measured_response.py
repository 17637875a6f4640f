from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.tap_tests import tap_test

from lathe_chatter.errors import FrequencyResponseError
from lathe_chatter.tap_test import FrequencyResponse, read_frequency_responses

HEAD = 'frequency (Hz),real (m/N),imaginary (m/N)\n'


def write_csv(path: Path, head: str, *columns: np.ndarray, separator: str = ',') -> Path:
    rows = (separator.join(f'{value:.17g}' for value in row) for row in zip(*columns, strict=True))
    path.write_text('\n'.join((head, *rows)) + '\n', encoding='utf-8')
    return path


@pytest.mark.parametrize(
    ('unit', 'form', 'scale'),
    [
        ('m/N', 'receptance', 1.0),
        ('um/N', 'receptance', 1e6),
        ('µm/N', 'receptance', 1e6),
        ('mm/s/N', 'mobility', 1e3),
        ('m/s2/N', 'accelerance', 1.0),
        ('m/s²/kN', 'accelerance', 1e3),
        ('MM/S2/N', 'accelerance', 1e3),
        ('(m/s^2)/N', 'accelerance', 1.0),
        ('(1/N)*(m/s²)', 'accelerance', 1.0),
        ('1/lbf*mm', 'receptance', 1e3 * 4.4482216152605),
        ('g/N', 'accelerance', 1.0 / 9.80665),
        ('g/lbf', 'accelerance', 4.4482216152605 / 9.80665),
    ],
)
def test_every_unit_comes_to_si(tmp_path: Path, unit: str, form: str, scale: float) -> None:
    truth = tap_test(floor=0.01, form=form)
    file = write_csv(
        tmp_path / 'test.csv', f'frequency (Hz), real ({unit}), imaginary ({unit}), coherence',
        truth.frequency, truth.response.real * scale, truth.response.imag * scale,
        truth.coherence,
    )  # fmt: skip
    (found,) = read_frequency_responses(file)
    assert found.form == form
    np.testing.assert_allclose(found.response, truth.response, rtol=1e-12)
    np.testing.assert_allclose(found.coherence, truth.coherence, rtol=1e-15)


def test_magnitude_and_phase_with_semicolons(tmp_path: Path) -> None:
    truth = tap_test()
    file = write_csv(
        tmp_path / 'test.csv', 'Frequency (rad/s);Magnitude (m/N);Phase (deg)',
        truth.frequency * 2.0 * np.pi, np.abs(truth.response),
        np.degrees(np.angle(truth.response)), separator=';',
    )  # fmt: skip
    (found,) = read_frequency_responses(file)
    np.testing.assert_allclose(found.response, truth.response, rtol=1e-12)
    np.testing.assert_allclose(found.frequency, truth.frequency, rtol=1e-12)
    assert found.coherence is None


def test_frequencies_in_kilohertz(tmp_path: Path) -> None:
    truth = tap_test()
    file = write_csv(
        tmp_path / 'test.csv', 'frequency (kHz),real (m/N),imaginary (m/N)',
        truth.frequency / 1e3, truth.response.real, truth.response.imag,
    )  # fmt: skip
    (found,) = read_frequency_responses(file)
    np.testing.assert_allclose(found.frequency, truth.frequency, rtol=1e-12)


def test_a_column_without_a_name_is_passed_over(tmp_path: Path) -> None:
    truth = tap_test()
    file = write_csv(
        tmp_path / 'test.csv', 'frequency (Hz),real (m/N),,imaginary (m/N)',
        truth.frequency, truth.response.real, np.zeros(truth.frequency.size),
        truth.response.imag,
    )  # fmt: skip
    (found,) = read_frequency_responses(file)
    np.testing.assert_allclose(found.response, truth.response, rtol=1e-12)


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('', 'empty'),
        ('a,b,c\n1,2,3\n', 'no frequency'),
        ('frequency (Hz),real (m/N)\n1,2\n', 'no imaginary'),
        ('frequency (Hz),real (kg),imaginary (kg)\n1,2,3\n', "'kg'"),
        ('frequency (Hz),real (m/N),imaginary (m/N)\n1,2,x\n', "'x'"),
        ('frequency (Hz),real (m/N),imaginary (m/N)\n1,2,inf\n', "line 2: 'inf'"),
        ('frequency (rpm),real (m/N),imaginary (m/N)\n1,2,3\n', 'must be in Hz, kHz or rad/s'),
        ('frequency (Hz),real (m/N),imaginary (m/s2/N)\n1,2,3\n', 'in the unit of the real one'),
        ('freq (Hz),real (m/N),imag (m/N),real (um/N)\n1,2,3,4\n', 'two columns real: leave one'),
        (HEAD + ''.join(f'{30 - k},2,3\n' for k in range(20)), '29 Hz is below'),
        (HEAD + ''.join(f'{k - 5},2,3\n' for k in range(20)), '-5 Hz is below'),
        (HEAD + ''.join(f'{k},0,0\n' for k in range(20)), 'nothing was measured'),
        (HEAD + ''.join(f'{k},1e200,0\n' for k in range(20)), 'nothing was measured'),
        ('frequency (Hz),real (m/N),imaginary (m/N)\n1,2,3\n', 'at least 16'),
        ('frequency (Hz),real (m/N),imaginary (m/N)\n1,2\n1,2,3\n', 'test.csv, line 2'),
        ('frequency (Hz),real (m/N),imaginary (m/N)\n', 'at least 16'),
        (
            '# by hand\nfrequency (Hz);real (m/N);imaginary (m/N)\n\n3.0,1.0,2.0\n',
            "line 4: it has 1 of the 3 columns that the head has, separated by ';'",
        ),
        (
            'frequency (Hz),real (m/N),imaginary (m/N)\n1,2,3\n1,2,x\n',
            "line 3: 'x' is no finite number",
        ),
        ('frequency,real,imaginary\n1,2,3\n', 'no unit of real: it must be there in parentheses'),
        ('frequency (Hz),magnitude (dB),phase (deg)\n1,2,3\n', "the unit of magnitude is 'dB'"),
    ],
)
def test_a_csv_that_cannot_be_used_is_a_sentence(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / 'test.csv'
    file.write_text(text)
    with pytest.raises(FrequencyResponseError) as mistake:
        read_frequency_responses(file)
    assert said in str(mistake.value)
    assert '\n' not in str(mistake.value)


def test_a_file_that_is_not_there_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(FrequencyResponseError, match='cannot be read'):
        read_frequency_responses(tmp_path / 'nothing.uff')


def write_universal(path: Path, truth: FrequencyResponse, binary: bool, **more: object) -> Path:
    pyuff = pytest.importorskip('pyuff', reason='the extra `identify` is not installed')
    common = {
        'binary': int(binary), 'rsp_node': 1, 'rsp_dir': 3, 'ref_node': 1, 'ref_dir': 3,
        'x': truth.frequency, 'id1': 'tip', 'rsp_ent_name': 'tool', 'ref_ent_name': 'tool',
        'abscissa_spacing': 1, 'abscissa_spec_data_type': 18, 'orddenom_spec_data_type': 13,
    }  # fmt: skip
    file = pyuff.UFF(str(path))
    response = {'func_type': 4, 'data': truth.response, 'ordinate_spec_data_type': 8, **more}
    file.write_sets(pyuff.prepare_58(**common, **response), 'add')
    if truth.coherence is not None:
        file.write_sets(pyuff.prepare_58(**common, func_type=6, data=truth.coherence), 'add')
    return path


@pytest.mark.parametrize('binary', [False, True])
def test_a_universal_file_with_its_coherence(tmp_path: Path, binary: bool) -> None:
    truth = tap_test(floor=0.01)
    (found,) = read_frequency_responses(write_universal(tmp_path / 'a.uff', truth, binary))
    assert found.form == 'receptance'
    np.testing.assert_allclose(found.response, truth.response, rtol=1e-8)
    assert found.coherence is not None
    np.testing.assert_allclose(found.coherence, truth.coherence, atol=1e-6)


def test_a_universal_file_in_g_over_newton(tmp_path: Path) -> None:
    truth = tap_test(floor=0.01, form='accelerance')
    in_g = FrequencyResponse(truth.frequency, truth.response / 9.80665, 'accelerance')
    labels = {'ordinate_spec_data_type': 12, 'ordinate_axis_units_lab': 'g',
              'orddenom_axis_units_lab': 'N'}  # fmt: skip
    (found,) = read_frequency_responses(
        write_universal(tmp_path / 'a.unv', in_g, binary=False, **labels)
    )
    assert found.form == 'accelerance'
    np.testing.assert_allclose(found.response, truth.response, rtol=1e-8)


def test_a_unit_that_is_no_utf8_and_no_unit_at_all(tmp_path: Path) -> None:
    """As LMS and others write them: `(1/N)*(m/s²)` in Latin-1, and a general type of data."""
    truth = tap_test(form='accelerance', coherence=False)
    file = write_universal(
        tmp_path / 'a.uff', truth, binary=False, ordinate_spec_data_type=1,
        ordinate_axis_units_lab='(1/N)*(m/s2)',
    )  # fmt: skip
    file.write_bytes(file.read_bytes().replace(b's2)', 's²)'.encode('latin-1')))
    (found,) = read_frequency_responses(file)
    np.testing.assert_allclose(found.response, truth.response, rtol=1e-8)
    unsaid = write_universal(tmp_path / 'b.uff', truth, binary=False, ordinate_spec_data_type=1)
    with pytest.raises(FrequencyResponseError, match='not said to be displacement'):
        read_frequency_responses(unsaid)


def test_what_only_looks_like_a_universal_file_is_a_sentence(tmp_path: Path) -> None:
    pytest.importorskip('pyuff', reason='the extra `identify` is not installed')
    file = tmp_path / 'a.uff'
    file.write_text('    -1\n    58\nnothing more')
    with pytest.raises(FrequencyResponseError, match=r'a\.uff'):
        read_frequency_responses(file)


def test_another_function_is_named_and_nothing_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A record over time, as analysers export them too; and a group, which pyuff prints."""
    truth = tap_test(coherence=False)
    file = write_universal(tmp_path / 'a.uff', truth, binary=False, func_type=1)
    group = [f'{1:10d}' + 6 * f'{0:10d}' + f'{1:10d}', 'Left', f'{8:10d}{7:10d}{0:10d}{0:10d}']
    group = ['    -1', '  2467', *group, '    -1', '']
    file.write_text('\n'.join(group) + file.read_text())
    with pytest.raises(FrequencyResponseError, match='response, but a record over time: export'):
        read_frequency_responses(file)
    assert capsys.readouterr().out == ''
