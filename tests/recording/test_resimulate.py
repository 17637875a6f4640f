"""Runs computed again: samples follow from their record, and what was altered is found."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support.recorded import topic

from lathe_chatter.array_types import Array
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.change_and_knock_sentences import (
    BEGINNING,
    BEGINNING_AGAIN,
    change_sentence,
    knock_sentence,
)
from lathe_chatter.lathe.config import recorded_config
from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.model.lathe_parameter_table import parameters_of
from lathe_chatter.recording import LatheRun, Resimulation, RunWriter, read_run, resimulate
from lathe_chatter.recording.provenance import IDENTITY, PARAMETERS, identity, parameter_values
from lathe_chatter.recording.ros_messages import parameters_bytes
from lathe_chatter.samples import SAMPLE_COLUMNS

TICK = 20
Alter = Callable[[int, Array], Array]


def play(
    folder: Path,
    lathe: VirtualLathe,
    *,
    ticks: int = 100,
    alter: Alter = lambda _k, a: a,
    first: int = 0,
    beginning: str = BEGINNING,
    made_by: dict[str, str] | None = None,
) -> None:
    """Record a lathe to which everything happens that can; ticks before `first` are not kept."""
    with LatheRun(folder, parameters_of(lathe)) as run:
        if made_by is not None:
            run.writer.note(IDENTITY, made_by)
        if beginning:
            run.log(beginning)
        for k in range(ticks):
            if k in (30, 55):
                speed, depth = (3333.3 + k, 0.0007 + 1e-5 * k / 3.0)
                cut = lathe.cut.with_changes(spindle_speed_rpm=speed, depth_of_cut=depth)
                run.log(change_sentence(lathe.time, lathe.cut, cut))
                lathe.retune(cut)
            if k == 40:
                run.log(knock_sentence(lathe.time, 1.0 / 300.0))
                lathe.knock(1.0 / 300.0)
            samples = lathe.advance(TICK)
            if k >= first:
                run.write(alter(k, samples))


def again(folder: Path) -> Resimulation:
    (found,) = resimulate(read_run(folder, damaged=True))
    return found


@pytest.mark.parametrize(
    'lathe',
    [
        VirtualLathe,
        lambda: VirtualLathe(
            Machine(Mode(0.06, 700.0, 0.03), bearing_stiffness=1e4),
            Cut(force_noise=1e-3, sensor_noise=1e-7, runout=1e-6, depth_of_cut=0.001),
            seed=7,
            sample_rate=44100.0,
        ),
        lambda: VirtualLathe(
            cut=Cut(speed_variation_amplitude=0.1, bearing_contact='seated'),
            spindle_acceleration=3000.0,
            tool_leaves_cut=False,
        ),
    ],
    ids=['gap', 'noise', 'ramp'],
)
def test_a_run_with_changes_and_a_knock_follows_from_its_record(
    lathe: Callable[[], VirtualLathe], tmp_path: Path
) -> None:
    play(tmp_path / 'run', lathe())
    found = again(tmp_path / 'run')
    assert found == Resimulation('/lathe/samples', compared=100 * TICK)
    assert found.proven


@pytest.mark.parametrize('column', range(len(SAMPLE_COLUMNS)))
def test_one_altered_bit_is_found_and_named(column: int, tmp_path: Path) -> None:
    was: list[float] = []

    def alter(k: int, samples: Array) -> Array:
        if k in (60, 70):
            was.append(float(samples[5, column]))
            samples[5, column] = np.nextafter(samples[5, column], np.inf)
        return samples

    play(tmp_path / 'run', VirtualLathe(), alter=alter)
    found = again(tmp_path / 'run')
    assert not found.proven
    assert found.compared == 60 * TICK + 5
    assert found.difference is not None
    assert found.difference.time == (60 * TICK + 6) / 1e4
    assert found.difference.column == SAMPLE_COLUMNS[column]
    assert found.difference.computed == was[0]
    assert found.difference.recorded == np.nextafter(was[0], np.inf)


def test_a_sample_that_was_taken_out_does_not_hide_an_altered_one(tmp_path: Path) -> None:
    def alter(k: int, samples: Array) -> Array:
        if k == 80:
            samples[0, 2] = -samples[0, 2]
        return samples[:7] if k == 33 else samples

    play(tmp_path / 'run', VirtualLathe(), alter=alter)
    found = again(tmp_path / 'run')
    assert found.difference is not None
    assert (found.difference.time, found.difference.column) == (1601 / 1e4, 'tool_displacement')


def test_a_run_without_its_head_is_compared_where_it_is(tmp_path: Path) -> None:
    play(tmp_path / 'run', VirtualLathe(), first=35)
    assert again(tmp_path / 'run') == Resimulation('/lathe/samples', compared=65 * TICK)


def test_a_record_that_began_midway_says_that_it_cannot_be_judged(tmp_path: Path) -> None:
    lathe = VirtualLathe()
    lathe.advance(500)
    lathe.retune(Cut(depth_of_cut=0.001))  # nobody recorded it
    play(tmp_path / 'run', lathe, beginning='')
    found = again(tmp_path / 'run')
    assert found.compared == 0
    assert not found.proven
    assert 'The record does not begin with the cut' in found.obstacle


def test_a_reset_begins_again(tmp_path: Path) -> None:
    lathe = VirtualLathe(cut=Cut(force_noise=1e-3), seed=3)
    parameters = parameters_of(lathe)
    with LatheRun(tmp_path / 'run', parameters) as run:
        run.log(BEGINNING)
        run.write(lathe.advance(400))
        deeper = lathe.cut.with_changes(depth_of_cut=0.0008)
        run.log(change_sentence(lathe.time, lathe.cut, deeper))
        run.log(BEGINNING_AGAIN)
        lathe = recorded_config({**parameters, 'depth_of_cut': 0.0008}).lathe()
        run.write(lathe.advance(300))
    assert again(tmp_path / 'run') == Resimulation('/lathe/samples', compared=700)


@pytest.mark.parametrize(('asked', 'from_name'), [(True, 9), (True, 0), (False, 0), (False, 9)])
def test_a_lathe_that_was_started_again_is_computed_with_its_own_parameters(
    asked: bool, from_name: int, tmp_path: Path
) -> None:
    first = VirtualLathe(cut=Cut(force_noise=1e-3), seed=3)
    second = VirtualLathe(Machine(Mode(0.06, 700.0, 0.03)), Cut(7000.0, 0.0007), seed=4)
    deeper = second.cut.with_changes(depth_of_cut=0.0008)
    with LatheRun(tmp_path / 'run', parameters_of(first)) as run:
        run.log(BEGINNING)
        run.write(first.advance(400))
        told = [(parameters_of(first), time.time_ns())]
        # It is killed, and started with other words: it declares before it begins.
        names = [*parameters_of(second).items()][from_name:]  # the recorder may have come late
        declared = parameters_bytes('/lathe', dict(names), time.time_ns())
        run._add('/parameter_events', declared)
        run.log(BEGINNING)
        run.write(second.advance(200))
        run.log(change_sentence(second.time, second.cut, deeper))
        second.retune(deeper)
        run.write(second.advance(100))
        if asked:
            told.append((parameters_of(second), time.time_ns()))
        run.writer.note(f'{PARAMETERS}/lathe', parameter_values(told))
    found = again(tmp_path / 'run')
    if asked or not from_name:
        assert found == Resimulation('/lathe/samples', compared=700)
    else:
        assert found.compared == 400
        assert 'with what parameters is not in the record' in found.obstacle


def test_a_run_of_other_software_is_not_called_altered(tmp_path: Path) -> None:
    def alter(k: int, samples: Array) -> Array:
        samples[3, 2] += 1e-18 * (k == 10)
        return samples

    play(tmp_path / 'here', VirtualLathe(), alter=alter)
    here = again(tmp_path / 'here')
    assert here.difference is not None
    assert here.obstacle == ''
    made_by = {**identity(), 'core': 'of yesterday'}
    play(tmp_path / 'there', VirtualLathe(), alter=alter, made_by=made_by)
    there = again(tmp_path / 'there')
    assert there.difference == here.difference
    assert there.obstacle.startswith('It was computed by other software: core of yesterday and ')


def test_a_change_that_may_be_in_a_gap_is_no_alteration(tmp_path: Path) -> None:
    """The samples about the change are missing, and its sentence too."""
    lathe = VirtualLathe()
    with LatheRun(tmp_path / 'run', parameters_of(lathe)) as run:
        run.log(BEGINNING)
        run.write(lathe.advance(400))
        lathe.advance(200)
        lathe.retune(lathe.cut.with_changes(depth_of_cut=0.0008))
        lathe.advance(200)
        run.write(lathe.advance(400))
    found = again(tmp_path / 'run')
    assert found.compared == 400
    assert found.difference is not None
    assert found.difference.time == 801 / 1e4
    assert found.obstacle.startswith('Samples are missing before it')


def test_without_a_log_a_changed_cut_is_no_alteration(tmp_path: Path) -> None:
    lathe = VirtualLathe()
    with LatheRun(tmp_path / 'run', parameters_of(lathe)) as run:
        run.write(lathe.advance(400))
        lathe.retune(lathe.cut.with_changes(depth_of_cut=0.0008))
        run.write(lathe.advance(400))
    found = again(tmp_path / 'run')
    assert found.compared == 400
    assert found.obstacle.startswith('The record has nothing of the log of the lathe')


def test_two_lathes_in_one_run_are_judged_each_by_its_own_record(tmp_path: Path) -> None:
    runs: dict[str, VirtualLathe] = {
        '/cell1/lathe': VirtualLathe(cut=Cut(force_noise=1e-3), seed=1),
        '/cell2/lathe': VirtualLathe(cut=Cut(depth_of_cut=0.0007)),
    }
    for name, lathe in runs.items():
        with LatheRun(tmp_path / name[1:6], parameters_of(lathe), name=name) as run:
            run.log(BEGINNING)
            for k in range(20):
                if k == 7:
                    deeper = lathe.cut.with_changes(depth_of_cut=lathe.cut.depth_of_cut + 1e-4)
                    run.log(change_sentence(lathe.time, lathe.cut, deeper))
                    lathe.retune(deeper)
                samples = lathe.advance(TICK)
                samples[3, 4] += 1e-18 * (name == '/cell2/lathe' and k == 9)
                run.write(samples)
    with RunWriter(tmp_path / 'both') as writer:
        for cell in ('cell1', 'cell2'):
            one = read_run(tmp_path / cell)
            for note in one.notes():
                if note.name.startswith('lathe_chatter/parameters') or note.name == IDENTITY:
                    writer.note(note.name, note.values)
            for raw in one.raw_messages():
                writer.add_topic(topic(raw.topic, raw.type))
                writer.write(
                    raw.topic, raw.data, log_time=raw.log_time, publish_time=raw.publish_time
                )
    first, second = resimulate(read_run(tmp_path / 'both'))
    assert first == Resimulation('/cell1/lathe/samples', compared=20 * TICK)
    assert second.difference is not None
    assert second.compared == 9 * TICK + 3
    assert second.difference.column == 'workpiece_displacement'


def test_what_happens_between_two_resets_or_in_a_pause_is_no_obstacle(tmp_path: Path) -> None:
    """A pause stops simulated time; what is changed meanwhile has the time at which it stopped."""
    lathe = VirtualLathe(cut=Cut(sensor_noise=1e-8), seed=2)
    parameters = parameters_of(lathe)
    with LatheRun(tmp_path / 'run', parameters) as run:
        run.log(BEGINNING)
        run.write(lathe.advance(200))
        for depth in (0.0008, 0.0004, 0.0006):  # while paused, one after the other
            changed = lathe.cut.with_changes(depth_of_cut=depth)
            run.log(change_sentence(lathe.time, lathe.cut, changed))
            lathe.retune(changed)
        run.write(lathe.advance(200))
        for depth in (0.0005, 0.0009, 0.0007):  # reset, changed and reset before a sample came
            run.log(BEGINNING_AGAIN)
            changed = lathe.cut.with_changes(depth_of_cut=depth)
            run.log(change_sentence(0.0, lathe.cut, changed))
            lathe = recorded_config({**parameters, 'depth_of_cut': depth}).lathe()
        run.write(lathe.advance(100))
        run.log(BEGINNING_AGAIN)
        lathe = recorded_config({**parameters, 'depth_of_cut': 0.0007}).lathe()
        run.write(lathe.advance(100))
        run.log(change_sentence(lathe.time, lathe.cut, Cut(sensor_noise=1e-8)))
        lathe.retune(Cut(sensor_noise=1e-8))
        run.write(lathe.advance(200))
    assert again(tmp_path / 'run') == Resimulation('/lathe/samples', compared=800)


def test_a_reset_before_the_first_sample_that_was_recorded(tmp_path: Path) -> None:
    lathe = VirtualLathe(cut=Cut(force_noise=1e-3))
    deeper = lathe.cut.with_changes(depth_of_cut=0.0008)
    with LatheRun(tmp_path / 'run', parameters_of(lathe)) as run:
        run.log(BEGINNING)
        run.log(change_sentence(0.3, lathe.cut, deeper))
        run.log(BEGINNING_AGAIN)
        lathe = VirtualLathe(cut=deeper)
        lathe.advance(60)  # not recorded either
        run.write(lathe.advance(100))
    assert again(tmp_path / 'run') == Resimulation('/lathe/samples', compared=100)


def test_every_change_of_a_cut_can_be_told_and_done_again(tmp_path: Path) -> None:
    """Ramps, contact, noise, speed variation: anything at any tick, in any order."""
    generator = np.random.default_rng(8)
    choices: dict[str, Callable[[], object]] = {
        'spindle_speed_rpm': lambda: float(generator.uniform(2000.0, 8000.0)),
        'depth_of_cut': lambda: float(generator.uniform(0.0, 0.001)),
        'bearing_clearance': lambda: float(generator.uniform(0.0, 1e-5)),
        'bearing_contact': lambda: str(generator.choice(['none', 'gap', 'seated', 'both_sides'])),
        'feed_speed': lambda: float(generator.uniform(0.0, 0.005)),
        'feed_per_revolution': lambda: float(generator.choice([0.0, 5e-5 / 3.0])),
        'process_damping': lambda: float(generator.choice([0.0, 1e3 / 3.0])),
        'workpiece_diameter': lambda: float(generator.uniform(0.02, 0.1)),
        'unbalance': lambda: float(generator.choice([0.0, 1e-7 / 3.0])),
        'cutting_force_noise': lambda: float(generator.choice([0.0, 1e-3 / 3.0])),
        'acceleration_noise': lambda: float(generator.choice([0.0, 1e-2 / 3.0])),
        'tool_runout': lambda: float(generator.uniform(0.0, 1e-6)),
        'force_noise': lambda: float(generator.choice([0.0, 1e-3 / 3.0])),
        'sensor_noise': lambda: float(generator.choice([0.0, 1e-8 / 3.0])),
        'runout': lambda: float(generator.uniform(0.0, 1e-6)),
        'speed_variation_amplitude': lambda: float(generator.uniform(0.0, 0.3)),
        'speed_variation_frequency': lambda: float(generator.uniform(0.5, 20.0)),
    }
    assert set(choices) == set(Cut.__dataclass_fields__)
    lathe = VirtualLathe(seed=9, spindle_acceleration=5e4)
    with LatheRun(tmp_path / 'run', parameters_of(lathe)) as run:
        run.log(BEGINNING)
        for _ in range(120):
            if generator.uniform() < 0.5:
                names = generator.choice(list(choices), size=2, replace=False).tolist()
                cut = lathe.cut.with_changes(**{name: choices[name]() for name in names})
                if sentence := change_sentence(lathe.time, lathe.cut, cut):
                    run.log(sentence)
                lathe.retune(cut)
            if generator.uniform() < 0.1:
                impulse = float(generator.normal(scale=1e-3))
                run.log(knock_sentence(lathe.time, impulse))
                lathe.knock(impulse)
            run.write(lathe.advance(int(generator.integers(1, 60))))
    found = again(tmp_path / 'run')
    assert found == Resimulation('/lathe/samples', compared=lathe.samples_taken)
