"""Scenarios played without ROS: what happens when, in the record and in the samples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lathe_chatter.detection.estimate import FIGURES
from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.change_and_knock_sentences import Knock
from lathe_chatter.model import Cut
from lathe_chatter.recording import read_run, resimulate, verify
from lathe_chatter.report.run_history import read_history
from lathe_chatter.scenario import Scenario, Step, load_scenario, shipped_scenarios
from lathe_chatter.scenario.simulation import needs_monitor, simulate
from lathe_chatter.stability import rightmost_root


def test_a_run_is_the_lathe_itself(tmp_path: Path) -> None:
    """Changes and knocks at samples of their own, that no block would end at."""
    changes = {'depth_of_cut': 0.00065, 'spindle_speed_rpm': 3100.0}
    scenario = Scenario(
        'a', 'a', 1.0, {'bearing_clearance': 1e-5, 'tick_rate': 100.0}, (Step(changes, at=0.1234),)
    )
    done = simulate(scenario, tmp_path / 'run', knocks=[Knock(0.5677, 2e-3)], monitor=False)
    lathe = VirtualLathe(cut=Cut(bearing_clearance=1e-5))
    parts = [lathe.advance(1234)]
    lathe.retune(lathe.cut.with_changes(**changes))
    parts.append(lathe.advance(5677 - 1234))
    lathe.knock(2e-3)
    parts.append(lathe.advance(10_000 - 5677))
    history = read_history(tmp_path / 'run')
    expected = np.concatenate(parts)
    for number, values in enumerate(read_run(tmp_path / 'run').samples().columns.values()):
        assert values.tobytes() == np.ascontiguousarray(expected[:, number]).tobytes()
    assert done.samples == 10_000
    assert done.flagged is None
    assert [(change.time, change.new) for change in history.changes] == [(0.1234, changes)]
    assert history.knocks == [Knock(0.5677, 2e-3)]
    assert verify(tmp_path / 'run').complete
    (again,) = resimulate(read_run(tmp_path / 'run'))
    assert again.compared == 10_000


def test_the_shipped_story_is_told_without_ros(tmp_path: Path) -> None:
    scenario = load_scenario(shipped_scenarios()['clearance'])
    assert needs_monitor(scenario)
    told: list[str] = []
    done = simulate(scenario, tmp_path / 'run', tell=lambda _time, what: told.append(what))
    assert done.flagged
    assert done.cleared
    history = read_history(tmp_path / 'run')
    deeper, faster = history.changes
    assert deeper.time == 3.0
    flagged, cleared = history.flags
    assert flagged.chatter
    assert not cleared.chatter
    # The step waits a second for the monitor, which is asked every 10 ms.
    assert flagged.time + 1.0 <= faster.time <= flagged.time + 1.02
    cut = history.cut_at(history.duration)
    for seated in (False, True):
        root = rightmost_root(
            history.sessions[0].machine, cut.spindle_speed_rpm, cut.depth_of_cut, seated=seated
        )
        assert root.real < 0.0
    assert len(told) == 5
    assert told[2].startswith('advice: try ')


def test_what_is_known_of_a_cut_is_published_as_by_the_node(tmp_path: Path) -> None:
    given = {'force_noise': 0.01}
    simulate(Scenario('a', 'a', 8.0, given), tmp_path / 'run', monitor=True)
    topics = {name for name in read_run(tmp_path / 'run').topics if '/chatter_monitor/' in name}
    figures = {*FIGURES} - {'recommended_speed_rpm'}  # nothing chatters
    assert topics == {f'/chatter_monitor/{name}' for name in ('chatter', 'state', *figures)}


def test_a_lathe_that_ends_says_why(tmp_path: Path) -> None:
    given = {'depth_of_cut': 0.002, 'tool_leaves_cut': False, 'bearing_contact': 'seated'}
    done = simulate(Scenario('a', 'a', 60.0, given), tmp_path / 'run', monitor=False)
    assert 'a displacement passed 1 m' in done.guard
    assert 0.0 < done.time < 60.0
    assert verify(tmp_path / 'run').complete


@pytest.mark.parametrize('where', ['parameters', 'steps'])
def test_an_unknown_parameter_is_named(tmp_path: Path, where: str) -> None:
    wrong = {'depth': 1e-3}
    scenario = Scenario(
        'a', 'a', 0.1, wrong if where == 'parameters' else {},
        () if where == 'parameters' else (Step(wrong, at=0.05),),
    )  # fmt: skip
    with pytest.raises(ParameterError, match="'depth'"):
        simulate(scenario, tmp_path / 'run', monitor=False)


def test_a_machine_file_that_lacks_a_body_is_warned_of_once(tmp_path: Path) -> None:
    file = tmp_path / 'tool.yaml'
    file.write_text('tool: {modes: [{frequency: 125 Hz, damping_ratio: 5 %, mass: 50 g}]}\n')
    told: list[str] = []
    scenario = Scenario('cut', 'A cut', 0.2, parameters={'machine': str(file)})
    simulate(scenario, tmp_path / 'run', tell=lambda _now, what: told.append(what))
    assert ['lacks a workpiece (50 g' in each for each in told] == [True]
