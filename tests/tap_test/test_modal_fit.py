from __future__ import annotations

import numpy as np
import pytest
from support.tap_tests import THREE_MODES, tap_test

from lathe_chatter.errors import ModalFitError
from lathe_chatter.tap_test import FrequencyResponse, fit_modes

pytest.importorskip('sdypy.EMA', reason='the extra `identify` is not installed')


@pytest.mark.parametrize('form', ['receptance', 'mobility', 'accelerance'])
@pytest.mark.parametrize('coherence', [True, False])
def test_three_modes_are_found_with_their_figures(form: str, coherence: bool) -> None:
    fit = fit_modes([tap_test(floor=0.01, form=form, coherence=coherence, seed=11)])
    assert len(fit.modes) == 3
    for mode, (frequency, damping, stiffness) in zip(fit.modes, THREE_MODES, strict=True):
        assert mode.frequency == pytest.approx(frequency, rel=1e-3)
        assert mode.damping_ratio == pytest.approx(damping, rel=0.03)
        assert mode.stiffness == pytest.approx(stiffness, rel=0.03)
    assert fit.warnings == ()


def test_without_noise_the_modes_are_exact() -> None:
    fit = fit_modes([tap_test(floor=1e-9)])
    assert len(fit.modes) == 3
    for mode, (frequency, damping, stiffness) in zip(fit.modes, THREE_MODES, strict=True):
        assert mode.frequency == pytest.approx(frequency, rel=1e-7)
        assert mode.damping_ratio == pytest.approx(damping, rel=1e-5)
        assert mode.stiffness == pytest.approx(stiffness, rel=1e-5)


def test_standard_errors_are_those_of_repeated_tests() -> None:
    # 30 tests, 9 figures each: the mean square of error/standard error is 1 +- 0.09.
    ratios = []
    for seed in range(30):
        fit = fit_modes([tap_test(floor=0.01, form='accelerance', seed=100 + seed)], modes=3)
        for mode, truth in zip(fit.modes, THREE_MODES, strict=True):
            found = (mode.frequency, mode.damping_ratio, mode.stiffness)
            ratios += [(f - t) / e for f, t, e in zip(found, truth, mode.errors, strict=True)]
    assert np.mean(np.square(ratios)) == pytest.approx(1.0, abs=0.35)


def test_two_tests_of_one_point_are_better_than_one() -> None:
    first, second = (tap_test(floor=0.01, seed=seed) for seed in (1, 2))
    one, both = fit_modes([first], modes=3), fit_modes([first, second], modes=3)
    for alone, together in zip(one.modes, both.modes, strict=True):
        assert together.errors[2] == pytest.approx(alone.errors[2] / np.sqrt(2.0), rel=0.15)


def test_a_mode_at_the_edge_and_a_low_coherence_are_warned_of() -> None:
    at_edge = fit_modes([tap_test(floor=0.001, frequency=np.arange(60.0, 860.0, 0.5))], modes=3)
    assert any('845' in said and 'edge' in said for said in at_edge.warnings)
    near = np.arange(200.0, 400.0, 0.25)
    test = tap_test(((300.0, 0.03, 1e7),), floor=0.8, averages=3, seed=4, frequency=near)
    noisy = fit_modes([test], modes=1)
    assert any('coherence' in said for said in noisy.warnings)


def test_what_was_not_measured_where_the_force_acts_is_warned_of() -> None:
    """There a mode moves against the force, as none does where it acts."""
    modes = [(f, zeta, -k if f == 310.0 else k) for f, zeta, k in THREE_MODES]
    fit = fit_modes([tap_test(modes, floor=0.002, form='accelerance')])
    assert any('310' in said and 'against the force' in said for said in fit.warnings)


def test_a_response_of_another_point_is_warned_of() -> None:
    first = tap_test(((300.0, 0.03, 1e7),), floor=0.01, seed=1)
    other = tap_test(((120.0, 0.03, 1e7),), floor=0.01, seed=2)
    fit = fit_modes([first, other])
    assert [mode.frequency for mode in fit.modes] == [pytest.approx(300.0, rel=1e-3)]
    assert any('another point' in said for said in fit.warnings)
    same = tap_test(((300.0, 0.03, 1e7),), floor=0.01, seed=3)
    assert fit_modes([first, same]).warnings == ()


def test_modes_that_are_too_few_are_warned_of() -> None:
    too_few = fit_modes([tap_test(floor=0.01)], modes=1).warnings
    assert any('unexplained' in said and 'point' not in said for said in too_few)


def test_modes_closer_than_they_are_wide_are_warned_of() -> None:
    close = ((300.0, 0.03, 1e7), (309.0, 0.03, 1.2e7))
    fit = fit_modes([tap_test(close, floor=1e-4)], modes=2)
    assert any('told apart' in said for said in fit.warnings)


def test_a_response_with_its_sign_reversed_is_told_as_that() -> None:
    sound = tap_test(floor=0.01)
    turned = FrequencyResponse(sound.frequency, -sound.response, sound.form)
    with pytest.raises(ModalFitError, match='Its sign is reversed'):
        fit_modes([turned])


def test_noise_alone_is_no_body() -> None:
    with pytest.raises(ModalFitError, match='of 8 modes were found'):
        fit_modes([tap_test(((5000.0, 0.01, 1e9),), floor=1.0, seed=3)], modes=8)
    with pytest.raises(ModalFitError, match='from 1 to'):
        fit_modes([tap_test()], modes=0)
