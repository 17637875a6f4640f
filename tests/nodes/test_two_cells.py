"""Two complete cells in one domain, told apart by all that is recorded, logged and reported."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters
from support.node_bench import Bench
from support.node_processes import NodeProcesses, Reports, Samples, contiguous

from lathe_chatter.lathe.change_and_knock_sentences import Change, parse_change
from lathe_chatter.recording import Run, read_run, verify
from lathe_chatter.recording.provenance import PARAMETERS
from lathe_chatter.recording.run_summary import SUMMARY

SPEEDS = {'left': 3000.0, 'right': 7500.0}
NODES = ('lathe', 'chatter_monitor', 'run_recorder')
SHARED = {'/rosout', '/diagnostics', '/parameter_events'}
NEW_DEPTH = 0.00062


def test_two_cells_are_told_apart_by_all_that_is_recorded_and_said(
    bench: Bench, nodes: NodeProcesses
) -> None:
    reports = Reports(bench)
    samples = {side: Samples(bench, f'/{side}/lathe/samples') for side in SPEEDS}
    for side, speed in SPEEDS.items():
        space = f'/{side}'
        nodes.start('lathe', f'spindle_speed_rpm:={speed}', namespace=space)
        nodes.start('chatter_monitor', namespace=space)
        nodes.start('run_recorder', f'output:={nodes.folder / side}', namespace=space)
    for side in SPEEDS:
        name = f'/{side}/run_recorder: recording'
        key = f'/{side}/lathe/samples: samples'
        bench.spin_until(
            lambda name=name, key=key: int(reports.value(name, key) or 0) > 1000, 'a record'
        )
        bench.spin_until(
            lambda name=f'/{side}/chatter_monitor: samples': reports.value(name, 'samples'),
            'the monitor',
        )

    (result,) = bench.set('/left/lathe', depth_of_cut=NEW_DEPTH)
    assert result.successful
    changes: list[Change] = []

    def changed() -> list[Change]:
        changes[:] = filter(None, map(parse_change, reports.sentences('left.lathe')))
        return changes

    bench.spin_until(changed, 'the change')
    # Both cut on beyond it, and their recorders have that.
    for side, heard in samples.items():
        bench.spin_until(lambda heard=heard: heard.ends[-1] > changes[0].time + 1.0, side)
        assert depth_of(bench, f'/{side}/lathe') == (NEW_DEPTH if side == 'left' else 0.0005)
        (times,) = heard.runs()
        assert contiguous(times)
    for side in SPEEDS:
        lathe = f'{PARAMETERS}/{side}/lathe'
        bench.spin_until(lambda side=side, lathe=lathe: lathe in noted(nodes, side), lathe)
        nodes.interrupt(f'/{side}/run_recorder')
    assert not any(map(parse_change, reports.sentences('right.lathe')))

    for side in SPEEDS:
        loggers = {f'{side}.{node}' for node in NODES}
        bench.spin_until(
            lambda loggers=loggers: loggers <= {e.name for e in reports.log}, 'a word of each'
        )
        found = {s.name: s for m in reports.diagnostics for s in m.status}
        for node in NODES:
            own = [s for name, s in found.items() if name.startswith(f'/{side}/{node}: ')]
            assert own
            assert {s.hardware_id.split(' ')[0] for s in own} == {side}
    for side, speed in SPEEDS.items():
        run = read_run(nodes.folder / side)
        assert {t for t in run.topics if not t.startswith(f'/{side}/')} <= SHARED
        assert run.samples_topic() == f'/{side}/lathe/samples'
        assert speed_in(run) == pytest.approx(speed, rel=1e-9)
        notes = noted(nodes, side)
        asked = json.loads(notes[f'{PARAMETERS}/{side}/lathe']['parameters'])
        assert asked['spindle_speed_rpm'] == speed
        verdicts = json.loads(notes[SUMMARY]['linear_model'])[f'/{side}/lathe/samples']
        assert [verdict['spindle_speed_rpm'] for verdict in verdicts] == [speed] * len(verdicts)
        depths = [0.0005, NEW_DEPTH] if side == 'left' else [0.0005]
        assert [verdict['depth_of_cut'] for verdict in verdicts] == depths
        assert verify(nodes.folder / side).samples.keys() == {f'/{side}/lathe/samples'}


def noted(nodes: NodeProcesses, side: str) -> dict[str, Any]:
    """The notes in a run, which opens also while it is being recorded."""
    return {note.name: note.values for note in read_run(nodes.folder / side).notes()}


def depth_of(bench: Bench, lathe: str) -> float:
    request = GetParameters.Request(names=['depth_of_cut'])
    (value,) = bench.call(GetParameters, f'{lathe}/get_parameters', request).values
    return float(value.double_value)


def speed_in(run: Run) -> float:
    """Spindle speed by the angle of the recorded samples, rev/min."""
    samples: Any = run.samples(columns=['time', 'spindle_angle']).columns
    turns, _ = np.polyfit(samples['time'], samples['spindle_angle'], 1)
    return 60.0 * float(turns)
