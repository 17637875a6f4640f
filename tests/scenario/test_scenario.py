"""Scenario files: the shipped ones can be played, and a mistake is named where it stands."""

from __future__ import annotations

from pathlib import Path

import pytest

from lathe_chatter.errors import ScenarioError
from lathe_chatter.model import Cut
from lathe_chatter.scenario import (
    RECOMMENDED,
    Step,
    find_scenario,
    load_scenario,
    shipped_scenarios,
)


def _write(folder: Path, text: str) -> Path:
    file = folder / 'mine.yaml'
    file.write_text(text, encoding='utf-8')
    return file


@pytest.mark.parametrize('name', ['clearance', 'no_clearance', 'supervised', 'asked'])
def test_shipped_scenarios_can_be_played(name: str) -> None:
    scenario = load_scenario(find_scenario(name))
    assert scenario.name == name
    cut = Cut(**scenario.parameters)
    for step in scenario.steps:
        numbers = {key: value for key, value in step.changes.items() if value != RECOMMENDED}
        assert set(step.changes) <= set(Cut.__dataclass_fields__)
        cut = cut.with_changes(**numbers)
        assert step.because
    times = [step.at for step in scenario.steps if step.at is not None]
    assert times == sorted(times)
    assert all(time < scenario.duration for time in times)
    assert 'flagged' in scenario.expect


def test_shipped_scenarios_are_found_by_name() -> None:
    assert {'clearance', 'no_clearance', 'supervised', 'asked'} <= set(shipped_scenarios())


def test_a_scenario_is_read_as_it_is_written(tmp_path: Path) -> None:
    scenario = load_scenario(
        _write(
            tmp_path,
            """
            title: Two changes
            duration: 4
            parameters: {depth_of_cut: 0.0004}
            steps:
              - {at: 1, set: {depth_of_cut: 0.001}, because: deeper}
              - {when: flagged, after: 0.5, set: {spindle_speed_rpm: recommended}}
            expect: {flagged: true}
            """,
        )
    )
    assert (scenario.name, scenario.title, scenario.duration) == ('mine', 'Two changes', 4.0)
    assert scenario.parameters == {'depth_of_cut': 0.0004}
    assert scenario.steps == (
        Step({'depth_of_cut': 0.001}, at=1.0, because='deeper'),
        Step({'spindle_speed_rpm': RECOMMENDED}, when='flagged', after=0.5),
    )
    assert scenario.expect == {'flagged': True}


def test_the_least_that_a_scenario_needs_is_its_duration(tmp_path: Path) -> None:
    scenario = load_scenario(_write(tmp_path, 'duration: 1'))
    assert (scenario.title, scenario.steps, dict(scenario.parameters)) == ('mine', (), {})


@pytest.mark.parametrize(
    ('text', 'complaint'),
    [
        ('', 'is empty or no mapping'),
        ('[1, 2]', 'is empty or no mapping'),
        ('a: [', 'cannot be read: at line 1, column 5, '),
        ('a: \x07', 'cannot be read'),
        ('title: nothing', 'needs duration'),
        ('duration: soon', "duration is 'soon': it must be"),
        ('duration: -1', 'duration is -1 s'),
        ('duration: .nan', 'duration is nan s'),
        ('duration: 1\nspeed: 2', "no key 'speed': known are duration"),
        ('duration: 1\nparameters: [1]', 'parameters must be a mapping'),
        ('duration: 1\nparameters: {1: 2}', 'parameters must be a mapping of names'),
        ('duration: 1\nsteps: {at: 1}', 'steps must be a list'),
        ('duration: 1\nsteps: [5]', 'step 1 must be a mapping'),
        ('duration: 1\nsteps: [{set: {runout: 0}}]', 'step 1 must have either at'),
        ('duration: 1\nsteps: [{at: 1, when: flagged, set: {runout: 0}}]', 'either at'),
        (
            'duration: 1\nsteps: [{when: now, set: {runout: 0}}]',
            "when is 'now': it must be flagged",
        ),
        (
            'duration: 1\nsupervisor: {}\nsteps: [{at: 1, accept: true, set: {runout: 0}}]',
            'must set at least one parameter, or accept: true',
        ),
        ('duration: 1\nsteps: [{when: asked, accept: true}]', 'no supervisor asks'),
        ('duration: 1\nsteps: [{when: null, set: {runout: 0}}]', 'when is None'),
        ('duration: 1\nsteps: [{at: null, set: {runout: 0}}]', 'at is None'),
        ('duration: 1\nsteps: [{at: 1}]', 'must set at least one parameter'),
        (
            'duration: 1\nsteps: [{at: 1, set: {runout: 0}}, {at: x, set: {runout: 0}}]',
            "step 2: at is 'x'",
        ),
        ('duration: 1\nsteps: [{at: 1, set: {runout: 0}, why: b}]', "no key 'why'"),
        ('duration: 0', 'duration is 0 s: it must be more'),
        (
            'duration: 1\nsteps: [{at: 0.5, set: {runout: 0}}, {at: 0.2, set: {runout: 0}}]',
            'step 2 is at 0.2 s, and one before it at 0.5 s',
        ),
        ('duration: 1\nsteps: [{at: 2, set: {runout: 0}}]', 'the run ends at 1 s'),
        (
            'duration: 1\nsteps: [{at: 1, set: {runout: deep}}]',
            "step 1: runout is 'deep': it must be",
        ),
        ('duration: 1\nsteps: [{at: 1, set: {depth_of_cut: 5}}]', 'from 0 to 0.1 m'),
        ('duration: 1\nsteps: [{at: 1, set: {sample_rate: 5}}]', "'sample_rate' cannot change"),
        ('duration: 1\nsteps: [{at: 1, set: {depth: 5}}]', 'did you mean depth_of_cut?'),
        ('duration: 1\nsteps: [{at: 1, set: {zzz: 5}}]', 'what can change is'),
        (
            'duration: 1\nsteps: [{at: 1, set: {depth_of_cut: 1 kg}}]',
            "depth_of_cut is '1 kg': it must be",
        ),
        ('duration: 1\nexpect: {flagged: 1}', 'expect.flagged must be true or false'),
        ('duration: 1\nexpect: {chatter: true}', "no key 'chatter'"),
    ],
)
def test_a_mistake_is_named_in_one_sentence(tmp_path: Path, text: str, complaint: str) -> None:
    file = _write(tmp_path, text)
    with pytest.raises(ScenarioError) as mistake:
        load_scenario(file)
    message = str(mistake.value)
    assert complaint in message
    assert str(file) in message
    assert '\n' not in message


def test_what_is_no_text_is_refused(tmp_path: Path) -> None:
    file = tmp_path / 'mine.yaml'
    file.write_bytes(b'\xff\xfe\x00\xd8')
    with pytest.raises(ScenarioError, match='cannot be read'):
        load_scenario(file)


def test_an_unknown_scenario_names_those_that_exist() -> None:
    with pytest.raises(ScenarioError, match=r"'none\.yaml'.*clearance, no_clearance"):
        find_scenario('none.yaml')


def test_numbers_that_yaml_takes_for_texts_are_numbers(tmp_path: Path) -> None:
    text = (
        'duration: 1\nparameters:\n  cutting_coefficient: 5.0e6'
        '\n  bearing_clearance: "5e-06"\n  seed: "3"'
        '\nsteps: [{at: 1, set: {depth_of_cut: 1.0e-3}}]'
    )
    scenario = load_scenario(_write(tmp_path, text))
    assert scenario.parameters == {
        'cutting_coefficient': 5e6,
        'bearing_clearance': 5e-6,
        'seed': 3,
    }
    assert scenario.steps[0].changes == {'depth_of_cut': 1e-3}
