"""A scenario with a machine of its own: a tool of 2 kg, a shaft of 20 kg, steel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from lathe_chatter.errors import ScenarioError
from lathe_chatter.model.machine_file import load_machine
from lathe_chatter.recording import read_run, resimulate
from lathe_chatter.scenario import load_scenario
from lathe_chatter.scenario.simulation import simulate
from lathe_chatter.stability import rightmost_root

MACHINE = """
tool: {modes: [{frequency: 300 Hz, damping_ratio: 3 %, mass: 2 kg}]}
workpiece: {modes: [{frequency: 120 Hz, damping_ratio: 3 %, mass: 20 kg}]}
material: {cutting_coefficient: 1500 MPa}
spindle: {slowest_speed: 100 rpm, fastest_speed: 3000 rpm}
cut: {spindle_speed: 1500 rpm, depth_of_cut: 0.2 mm, feed: 0.2 mm/rev}
"""
SCENARIO = """
duration: 4.5
parameters: {machine: lathe.yaml}
steps:
  - at: 1.5
    set: {depth_of_cut: 0.4 mm}
  - when: flagged
    after: 1.0
    set: {spindle_speed_rpm: recommended}
expect: {flagged: true, cleared: true}
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    (tmp_path / 'lathe.yaml').write_text(MACHINE)
    file = tmp_path / 'scenario.yaml'
    file.write_text(SCENARIO)
    return file


def test_a_machine_without_a_spindle_is_advised_no_speed_out_of_reach(tmp_path: Path) -> None:
    """A body of several modes is not identified: 60 f/k is all there is, of some 1000 Hz."""
    modes = '{frequency: 1000 Hz, damping_ratio: 3 %, mass: 2 kg}'
    modes += ', {frequency: 2500 Hz, damping_ratio: 3 %, mass: 2 kg}'
    (tmp_path / 'lathe.yaml').write_text(
        f'tool: {{modes: [{modes}]}}\nmaterial: {{cutting_coefficient: 1500 MPa}}\n'
        'workpiece: {modes: [{frequency: 3000 Hz, damping_ratio: 3 %, mass: 50 kg}]}\n'
        'cut: {spindle_speed: 6000 rpm, depth_of_cut: 1 mm, feed: 0.1 mm/rev}\n'
    )
    file = tmp_path / 'scenario.yaml'
    file.write_text(
        'duration: 2\nparameters: {machine: lathe.yaml}\n'
        'steps:\n  - at: 1.5\n    set: {depth_of_cut: 5 mm}\n'
    )
    told: list[str] = []
    done = simulate(load_scenario(file), tmp_path / 'run', tell=lambda _t, what: told.append(what))
    assert done.flagged
    assert 'advice: no stable speed is known' in told
    assert not any(what.startswith('advice: try') for what in told)


def test_chatter_is_flagged_and_cured_within_the_range_of_the_spindle(
    scenario: Path, tmp_path: Path
) -> None:
    loaded = load_scenario(scenario)
    told: list[str] = []
    done = simulate(loaded, tmp_path / 'run', tell=lambda _t, what: told.append(what))
    assert done.flagged
    assert done.cleared
    changes = [what for what in told if what.startswith('spindle_speed_rpm')]
    speed = float(changes[0].split('=')[1].split()[0])
    assert 100.0 <= speed <= 3000.0
    machine = load_machine(tmp_path / 'lathe.yaml').machine
    before = rightmost_root(machine, 1500.0, 4e-4, seated=False)
    assert before.real > 0.0
    assert rightmost_root(machine, speed, 4e-4, seated=False).real < 0.0


def test_the_run_holds_the_machine_and_is_proven_without_its_file(
    scenario: Path, tmp_path: Path
) -> None:
    simulate(load_scenario(scenario), tmp_path / 'run', monitor=False)
    (tmp_path / 'lathe.yaml').unlink()
    proofs = resimulate(read_run(tmp_path / 'run'))
    assert [proof.proven for proof in proofs] == [True]


def test_a_machine_that_is_none_is_refused_with_its_line(scenario: Path, tmp_path: Path) -> None:
    (tmp_path / 'lathe.yaml').write_text('tool:\n  modes: 3\n')
    with pytest.raises(ScenarioError, match=r'lathe\.yaml, line 2'):
        load_scenario(scenario)


def test_a_feed_speed_that_does_not_rule_is_refused_and_one_that_does_is_taken(
    scenario: Path, tmp_path: Path
) -> None:
    for changes, rules in (
        ('feed_speed: 1 mm/s', False),
        ('feed_speed: 1 mm/s, feed_per_revolution: 0', True),
        ('feed_speed: 1 mm/s, feed_per_revolution: 0.1 mm', True),
    ):
        text = SCENARIO.replace('depth_of_cut: 0.4 mm', changes)
        scenario.write_text(text)
        if rules:
            assert load_scenario(scenario).steps[0].changes['feed_speed'] == 1e-3
            continue
        with pytest.raises(ScenarioError, match='step 1: feed_speed is'):
            load_scenario(scenario)
    scenario.write_text(SCENARIO.replace('depth_of_cut: 0.4 mm', 'feed_speed: 1 mm/s').replace(
        'machine: lathe.yaml', 'seed: 1'
    ))  # fmt: skip
    loaded = load_scenario(scenario)
    with pytest.raises(ScenarioError, match='step 1: feed_speed'):
        replace(loaded, parameters={'machine': str(tmp_path / 'lathe.yaml')})


def test_a_speed_that_the_spindle_has_not_is_told(scenario: Path, tmp_path: Path) -> None:
    scenario.write_text(SCENARIO.replace('depth_of_cut: 0.4 mm', 'spindle_speed_rpm: 3500'))
    told: list[str] = []
    loaded = replace(load_scenario(scenario), duration=2.0, expect={})
    simulate(loaded, tmp_path / 'run', tell=lambda _t, what: told.append(what))
    doubt = 'The spindle turns outside of what the machine file says it can, 100 to 3000 rev/min.'
    assert told.count(doubt) == 1
