"""Force noise, sensor noise and runout: how large they are, and what they leave alone.

Statistical bounds are five standard errors of the estimate for the length of the run.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine, Mode

_FREE = Cut(3000.0, 0.0, bearing_contact=BearingContact.NONE, feed_speed=0.0)
_STILL = (0.0, 0.0, 0.0, 0.0)
_SIGMAS = 5.0


def test_white_force_gives_an_oscillator_its_stationary_variance() -> None:
    """S / (4 zeta m^2 omega^3) for a force of autocorrelation S delta(t), S the density squared.

    The squared displacement is correlated over 1 / (zeta omega), so a run of length T holds
    zeta omega T independent values of it.
    """
    mass, omega, zeta, density = 0.05, 775.0, 0.05, 0.3
    lathe = VirtualLathe(
        Machine(tool=Mode(mass, omega, zeta)), _FREE.with_changes(force_noise=density),
        sample_rate=2e4, initial_state=_STILL, seed=1,
    )  # fmt: skip
    lathe.advance(20_000)
    x = lathe.advance(1_000_000)[:, 2]
    expected = density**2 / (4.0 * zeta * mass**2 * omega**3)
    independent = zeta * omega * len(x) / 2e4
    assert (x**2).mean() == pytest.approx(expected, rel=_SIGMAS * math.sqrt(2.0 / independent))


def test_a_held_force_gives_exactly_its_discrete_variance() -> None:
    """At 2 kHz the hold matters: the covariance is that of the sampled system, by Lyapunov."""
    machine, rate, density = Machine(), 2e3, 0.3
    tool = machine.tool
    a = np.array([[0.0, 1.0], [-(tool.natural_frequency**2), -tool.damping / tool.mass]])
    values, vectors = np.linalg.eig(a)
    step = ((vectors * np.exp(values / rate)) @ np.linalg.inv(vectors)).real
    hold = np.linalg.solve(a, (step - np.eye(2)) @ np.array([0.0, 1.0 / tool.mass]))
    covariance = solve_discrete_lyapunov(step, density**2 * rate * np.outer(hold, hold))
    lathe = VirtualLathe(
        machine, _FREE.with_changes(force_noise=density), sample_rate=rate, initial_state=_STILL
    )
    lathe.advance(2_000)
    samples = lathe.advance(400_000)
    independent = tool.damping_ratio * tool.natural_frequency * len(samples) / rate
    error = _SIGMAS * math.sqrt(2.0 / independent)
    assert (samples[:, 2] ** 2).mean() == pytest.approx(covariance[0, 0], rel=error)
    assert (samples[:, 3] ** 2).mean() == pytest.approx(covariance[1, 1], rel=error)
    assert not samples[:, 4:6].any()


@pytest.mark.parametrize('rate', [1e3, 1e4, 1e5])
def test_the_density_does_not_depend_on_the_sample_rate(rate: float) -> None:
    """A nearly free mass: its velocity is a random walk of variance S t / m^2.

    In a tenth of its softest period, over 400 seeds.
    """
    density, mass, duration, runs = 0.2, 0.05, 0.05, 400
    machine = Machine(tool=Mode(mass, 1e-3, 0.0))
    ends = []
    for seed in range(runs):
        lathe = VirtualLathe(
            machine, _FREE.with_changes(force_noise=density), sample_rate=rate, seed=seed,
            initial_state=_STILL, tool_leaves_cut=False,
        )  # fmt: skip
        ends.append(lathe.advance(round(duration * rate))[-1, 3])
    expected = density**2 * duration / mass**2
    assert np.mean(np.square(ends)) == pytest.approx(expected, rel=_SIGMAS * math.sqrt(2.0 / runs))


def test_the_seed_decides() -> None:
    cut = Cut(force_noise=0.1, sensor_noise=1e-7)
    runs = [VirtualLathe(cut=cut, seed=seed).advance(300) for seed in (3, 3, 4)]
    assert runs[0].tobytes() == runs[1].tobytes()
    assert not (runs[0][:, 2] == runs[2][:, 2]).any()


@pytest.mark.parametrize('contact', list(BearingContact))
def test_runout_and_sensor_noise_change_measurements_only(contact: BearingContact) -> None:
    clean = Cut(3000.0, 0.9e-3, bearing_contact=contact)
    disturbed = clean.with_changes(runout=3e-6, sensor_noise=2e-7)
    quiet, measured = VirtualLathe(cut=clean), VirtualLathe(cut=disturbed)
    plain, seen = quiet.advance(20_000), measured.advance(20_000)
    same = [0, 1, 3, 6, 7]  # time, angle, tool velocity, chip thickness, force
    assert seen[:, same].tobytes() == plain[:, same].tobytes()
    assert measured.events == quiet.events
    turn = 2.0 * math.pi * plain[:, 1]
    errors = np.column_stack(
        [seen[:, 2] - plain[:, 2], seen[:, 4] - plain[:, 4] - 3e-6 * np.cos(turn)]
    )
    bound = _SIGMAS / math.sqrt(len(errors))
    assert np.abs(errors.mean(axis=0)).max() < 2e-7 * bound
    assert np.abs((errors**2).mean(axis=0) / 4e-14 - 1.0).max() < math.sqrt(2.0) * bound
    assert abs((errors[:, 0] * errors[:, 1]).mean()) < 4e-14 * bound


@pytest.mark.parametrize('amplitude', [0.0, 0.3])
def test_the_velocity_of_runout_is_the_derivative_of_its_displacement(amplitude: float) -> None:
    """By central differences, whose error is (Omega dt)^2 / 6 of it and less than 1e-4."""
    cut = _FREE.with_changes(
        runout=1e-5, speed_variation_amplitude=amplitude, speed_variation_frequency=2.0
    )
    samples = VirtualLathe(cut=cut, initial_state=_STILL, sample_rate=2e4).advance(20_000)
    slope = (samples[2:, 4] - samples[:-2, 4]) * 1e4
    velocity = samples[1:-1, 5]
    assert np.abs(slope - velocity).max() < 1e-4 * np.abs(velocity).max()


def test_force_noise_acts_on_the_tool_while_it_cuts_too() -> None:
    """A stable cut answers small noise linearly: twice the noise, twice the vibration."""
    answers = []
    for density in (0.0, 1e-3, 2e-3):
        cut = Cut(3000.0, 0.4e-3, bearing_contact=BearingContact.NONE, force_noise=density)
        answers.append(VirtualLathe(cut=cut, seed=2).advance(5000)[:, 2])
    once, twice = answers[1] - answers[0], answers[2] - answers[0]
    assert np.abs(once).max() > 1e-9
    assert np.abs(twice - 2.0 * once).max() < 1e-9 * np.abs(twice).max()
