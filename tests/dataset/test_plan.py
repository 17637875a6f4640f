"""A plan is read with units, and what is wrong in it is one sentence with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lathe_chatter.dataset.plan import load_plan
from lathe_chatter.dataset.windows import drawn_machine, drawn_run
from lathe_chatter.errors import PlanError
from lathe_chatter.model.machine_file import load_machine
from lathe_chatter.stability import safe_limit

EXAMPLE = Path(__file__).parents[2] / 'examples' / 'datasets' / 'chatter.yaml'


def written(folder: Path, text: str) -> Path:
    path = folder / 'plan.yaml'
    path.write_text(text, encoding='utf-8')
    return path


def test_the_example_is_what_it_says() -> None:
    plan = load_plan(EXAMPLE)
    assert (plan.length, plan.starts, plan.samples) == (1000, range(6000, 11001, 1000), 12000)
    assert len(plan.starts) == 6
    assert plan.windows == 150 * 10 * 6
    assert plan.machines_of() == {'train': range(105), 'test': range(105, 150)}
    assert plan.cut['sensor_noise'].values == (1e-7,)
    assert plan.machine['cutting_coefficient'].values == (2e6, 6e6)


def test_what_a_machine_file_lacks_is_known_unless_the_plan_has_it(tmp_path: Path) -> None:
    mode = '{modes: [{frequency: 200 Hz, damping_ratio: 2 %, mass: 5 kg}]}'
    (tmp_path / 'mine.yaml').write_text(f'tool: {mode}\nworkpiece: rigid\n')
    (doubt,) = load_plan(written(tmp_path, 'machine: {machine: mine.yaml}')).doubts
    assert 'mine lacks a cutting coefficient' in doubt
    beside = 'machine: {machine: mine.yaml, cutting_coefficient: {uniform: [1e9, 2e9]}}'
    assert load_plan(written(tmp_path, beside)).doubts == ()
    assert load_plan(EXAMPLE).doubts == ()


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('cut: {depht_of_cut: 1 mm}', "line 1: cut: there is no 'depht_of_cut': did you mean"),
        ('sead: 3', "there is no 'sead': did you mean seed"),
        ('machines: 2.5', 'machines is 2.5: it must be a whole number from 1'),
        ('duration: 3 m', "duration is '3 m': it must be a finite number from 0"),
        ('form: csv', "form is 'csv': it must be one of parquet, hdf5, zarr, mcap"),
        ('cut:\n  spindle_speed_rpm: {uniform: [3000]}', 'line 2: cut.spindle_speed_rpm: uniform'),
        ('cut: {depth_of_cut: {log_uniform: [0, 1 mm]}}', 'log_uniform must begin above 0'),
        (
            'cut: {depth_of_cut: {uniform: [2 mm, 1 mm]}}',
            'cut.depth_of_cut: uniform: the lowest, 2 mm, must be below 1 mm',
        ),
        ('cut: {depth_of_cut: {uniform: [2 mm, 0]}}', '2 mm, must be below 0'),
        ('cut: {depth_of_cut: {of_limit: {normal: [1, 0]}}}', 'mean and standard deviation'),
        ('cut: {feed_speed: {of_limit: 1}}', "there is no 'of_limit'"),
        ('cut: {spindle_speed_rpm: {choice: []}}', 'choice must be a list'),
        ('cut: {depth_of_cut: 1 kg}', "cut.depth_of_cut is '1 kg': it must be a finite number"),
        ('cut: {bearing_contact: loose}', 'it must be one of none, gap, seated, both_sides'),
        ('cut: {speed_variation_amplitude: 0.1}', "there is no 'speed_variation_amplitude'"),
        (
            'machine:\n  machine: nowhere.yaml',
            'plan.yaml, line 2: machine.machine: The machine nowhere.yaml cannot be read',
        ),
        ('machine: {machine: chucked_shaft, errors: file}', 'chucked_shaft has none'),
        (
            'machine: {machine: chucked_shaft, tool.mass: 1}',
            'left to the machine file',
        ),
        ('machine: {errors: "luck=2%"}', 'of frequency, damping, stiffness and C'),
        ('sensors: {columns: [tool_position]}', 'columns must be a list of some of time, '),
        ('events: [{at: 1}]', 'an event needs at, and set or knock'),
        ('events: [{at: 3, knock: 1e-3}]', 'events[0]: at is 3 s, and the run ends at 2 s'),
        (
            'events: [{at: {normal: [5 s, 0.1 s]}, knock: 1e-3}]',
            'events[0]: at is 5 s, and the run ends at 2 s',
        ),
        (
            'events: [{at: 1, over: 1, set: {bearing_contact: gap}}]',
            'bearing_contact can only change at once',
        ),
        ('windows: {length: 3}', 'a window must lie within the run of 2 s'),
        ('splits: {train: 50 %}', 'the shares must add up to 1'),
        ('splits: {../train: 100 %}', 'must be a name of letters'),
        (
            'seed: {uniform: [1, 2]}',
            "seed is '{uniform: [1, 2]}': it must be a whole",
        ),
        ('cut: [', 'line 1: expected'),
        ('', 'it must be a mapping'),
    ],
)
def test_a_mistake_is_one_sentence(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(PlanError) as found:
        load_plan(written(tmp_path, text))
    assert words in str(found.value)
    assert '\n' not in str(found.value)
    assert 'plan.yaml' in str(found.value) or 'luck' in text


def test_what_is_drawn_is_what_the_plan_says(tmp_path: Path) -> None:
    plan = load_plan(
        written(
            tmp_path,
            'machines: 400\n'
            'machine: {tool.mass: {normal: [50 g, 5 g]}, errors: "C=10%"}\n'
            'cut: {spindle_speed_rpm: {log_uniform: [1000, 9000]}, depth_of_cut: {of_limit: 0.9}}',
        )
    )
    machines = [drawn_machine(plan, number) for number in range(plan.machines)]
    masses = np.array([each.machine.tool.mass for each in machines])
    assert masses.mean() == pytest.approx(0.05, rel=0.02)
    assert masses.std() == pytest.approx(0.005, rel=0.15)
    coefficients = [each.machine.cutting_coefficient for each in machines]
    assert np.log(coefficients).std() == pytest.approx(0.1, rel=0.15)
    runs = [drawn_run(plan, k, each, 0) for k, each in enumerate(machines)]
    speeds = np.array([run.cuts[0].spindle_speed_rpm for run in runs])
    assert np.median(speeds) == pytest.approx(3000.0, rel=0.15)
    for run in runs[:5]:
        limit = float(safe_limit(run.config.machine, run.cuts[0]).depth_of_cut)
        assert run.cuts[0].depth_of_cut == pytest.approx(0.9 * limit)
    assert len({run.config.setup.seed for run in runs}) == len(runs)
    assert drawn_run(plan, 7, drawn_machine(plan, 7), 0) == runs[7]


def test_a_window_of_less_than_a_sample_is_not_the_whole_run(tmp_path: Path) -> None:
    (tmp_path / 'a.yaml').write_text('windows: {length: 0.05 ms, every: 0.3 s}')
    assert load_plan(tmp_path / 'a.yaml').length == 1


def test_machines_come_from_files_beside_the_plan(tmp_path: Path) -> None:
    """With their errors; and the plan holds them, so that no worker needs the file."""
    text = (
        load_machine('boring_bar')
        .text()
        .replace('"material": {', '"material": {"errors": {"cutting_coefficient": "20 %"}, ')
    )
    (tmp_path / 'mine.yaml').write_text(text, encoding='utf-8')
    plan = load_plan(written(tmp_path, 'machine: {machine: mine.yaml, errors: file}'))
    (tmp_path / 'mine.yaml').unlink()
    found = [drawn_machine(plan, k).machine.cutting_coefficient for k in range(200)]
    usual = load_machine('boring_bar').machine.cutting_coefficient
    assert np.log(np.array(found) / usual).std() == pytest.approx(0.2, rel=0.2)


def test_a_comment_changes_no_data_and_a_number_does(tmp_path: Path) -> None:
    one = repr(load_plan(written(tmp_path, 'seed: 1')))
    assert repr(load_plan(written(tmp_path, 'seed: 1  # of all\ntitle: Other'))) == one
    assert repr(load_plan(written(tmp_path, 'seed: 2'))) != one
