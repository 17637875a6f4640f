"""The truth of windows, against what is computed of the same cuts in other ways."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lathe_chatter.dataset.plan import Plan, load_plan
from lathe_chatter.dataset.windows import drawn_machine, drawn_run, windows_of
from lathe_chatter.stability import contact_at, rightmost_root

TEXT = """
machines: 3
runs: 4
duration: 1 s
machine: {tool.natural_frequency: {uniform: [700 rad/s, 800 rad/s]}}
cut:
  spindle_speed_rpm: {uniform: [2500, 3500]}
  depth_of_cut: {of_limit: 0.8}
  force_noise: 0.002
events:
  - {at: {uniform: [0.1, 0.3]}, set: {depth_of_cut: {of_limit: {uniform: [0.7, 1.6]}}}}
  - {at: 0.5 s, over: 0.2 s, share: 50 %, set: {spindle_speed_rpm: {uniform: [2500, 3500]}}}
  - {at: 0.8 s, knock: {choice: [0.001, -0.001]}}
windows: {length: 50 ms, every: 30 ms}
"""


@pytest.fixture(scope='module')
def plan(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    path = tmp_path_factory.mktemp('plan') / 'plan.yaml'
    path.write_text(TEXT.replace('50 ms', '0.05 s').replace('30 ms', '0.03 s'), encoding='utf-8')
    return load_plan(path)


def test_signals_and_truth_are_those_of_the_same_lathe(plan: Plan) -> None:
    """Each run again with a lathe by hand: samples, roots, onset, contact and loss of cut."""
    machines = {number: drawn_machine(plan, number) for number in range(plan.machines)}
    table, runs = windows_of(plan, machines)
    assert len(table['machine']) == plan.windows
    assert {*table['stable'].tolist()} == {True, False}
    for run in runs:
        assert run == drawn_run(plan, run.machine, machines[run.machine], run.number)
        own = (table['machine'] == run.machine) & (table['run'] == run.number)
        lathe = run.config.lathe()
        samples, cuts, touching = [], [], []
        onset, before = np.nan, np.nan
        for sample in range(plan.samples):
            if sample in run.cuts:
                lathe.retune(run.cuts[sample])
                here = contact_at(run.config.machine, lathe.cut)
                before = onset = np.nan if here.stable else sample if np.isnan(before) else before
            if sample in run.knocks:
                lathe.knock(run.knocks[sample])
            samples.append(lathe.advance(1)[0])
            cuts.append((lathe.cut, onset))
            touching.append(lathe.bearing_engaged)
        every = np.array(samples)
        for k, start in enumerate(plan.starts):
            window = slice(start, start + plan.length)
            found = {name: values[own][k] for name, values in table.items()}
            signal = every[window, 2].astype('f4')
            assert found['tool_displacement'].tobytes() == signal.tobytes()
            cut, onset = cuts[window.stop - 1]
            contact = contact_at(run.config.machine, cut)
            root = rightmost_root(
                run.config.machine, cut.spindle_speed_rpm, cut.depth_of_cut, seated=contact.seated
            )
            assert found['growth_rate'] == pytest.approx(root.real, rel=1e-9)
            assert found['frequency'] == pytest.approx(root.imag / 2.0 / np.pi, rel=1e-9)
            assert found['stable'] == contact.stable
            since = (window.stop - onset) / plan.sample_rate
            assert found['seconds_since_onset'] == pytest.approx(since, nan_ok=True)
            assert found['depth_of_cut'] == cut.depth_of_cut
            # Shares to a sample or two at each change of contact.
            out = (every[window, 7] <= 0.0).mean()
            assert found['share_out_of_cut'] == pytest.approx(out, abs=0.03)
            share = np.mean(touching[window])
            assert found['share_on_bearing'] == pytest.approx(share, abs=0.03)
            word = 'free' if share == 0.0 else 'seated' if share == 1.0 else 'rattling'
            if 0.0 < share < 1.0 or found['share_on_bearing'] in {0.0, 1.0}:
                assert found['regime'] == word


def test_a_run_that_its_guard_ends_has_fewer_windows(tmp_path: Path) -> None:
    path = tmp_path / 'plan.yaml'
    path.write_text(
        'machines: 1\nduration: 4 s\nmachine: {tool_leaves_cut: false}\n'
        'cut: {depth_of_cut: 2 mm}\nwindows: {length: 0.1 s}',
        encoding='utf-8',
    )
    plan = load_plan(path)
    table, _ = windows_of(plan, {0: drawn_machine(plan, 0)})
    assert 0 < len(table['start']) < plan.windows
    assert not table['stable'].any()
