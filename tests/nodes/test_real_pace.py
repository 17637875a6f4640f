"""The pace of real processes, by the times at which DDS had their samples sent."""

from __future__ import annotations

import numpy as np
from support.node_bench import Bench
from support.node_processes import NodeProcesses, Reports, Samples, contiguous

FACTORS = (0.5, 1.0, 2.0)
LONG_ENOUGH = 2.0
"""s that are looked at."""
CATCH_UP = 0.05
"""s that a lathe may be behind before it gives up."""
TOLERANCE = 0.1


def test_simulated_time_follows_the_clock_at_the_factor_asked_for(
    bench: Bench, nodes: NodeProcesses
) -> None:
    reports = Reports(bench)
    heard = {factor: Samples(bench, f'/{name(factor)}/lathe/samples') for factor in FACTORS}
    for factor in FACTORS:
        space = f'/{name(factor)}'
        deep = f'qos_overrides.{space}/lathe/samples.publisher.depth:=10000'
        nodes.start('lathe', f'real_time_factor:={factor}', deep, namespace=space)
    # The beginning is not looked at: all of them are starting then.
    for factor, samples in heard.items():
        bench.spin_until(lambda samples=samples: len(samples) > 100, f'samples at {factor}')
    first = {factor: len(samples) for factor, samples in heard.items()}
    for factor, samples in heard.items():
        bench.spin_until(
            lambda factor=factor, samples=samples: seconds(samples, first[factor]) > LONG_ENOUGH,
            f'more samples at {factor}',
        )
    since = reports.count()
    for factor, samples in heard.items():
        pace = f'/{name(factor)}/lathe: pace'
        bench.spin_until(lambda pace=pace: reports.value(pace, 'ticks', since), pace)
        given_up = float(reports.value(pace, 'lag given up, s'))
        passed = seconds(samples, first[factor])
        cut = samples.ends[-1] - samples.ends[first[factor]]
        # What was given up counts from the start, and so may be more than belongs here.
        least = factor * (passed - CATCH_UP) - given_up
        most = factor * (passed + CATCH_UP)
        assert (1.0 - TOLERANCE) * least <= cut <= (1.0 + TOLERANCE) * most
        assert given_up < 9.0 * samples.ends[-1]
        (times,) = samples.runs()
        assert contiguous(times)


def test_as_fast_as_possible_it_leaves_out_nothing_and_gives_up_nothing(
    bench: Bench, nodes: NodeProcesses
) -> None:
    reports, samples = Reports(bench), Samples(bench)
    nodes.start('lathe', 'real_time_factor:=0.0', 'await_readers:=1')
    bench.spin_until(lambda: len(samples) > 2500, 'samples')
    assert bench.pause('/lathe').success
    bench.steps('/lathe', 1)
    end = bench.trigger('/lathe/step').message
    bench.spin_until(lambda: end == f'Now at {samples.ends[-1]:.6f} s.', 'the last sample')
    (times,) = samples.runs()
    assert contiguous(times)
    assert times[0] == 1e-4
    since = reports.count()
    bench.spin_until(lambda: reports.value('/lathe: pace', 'ticks', since), 'a report')
    assert reports.value('/lathe: pace', 'overruns') == '0'
    assert int(reports.value('/lathe: pace', 'ticks')) == times.size // 20


def name(factor: float) -> str:
    """Of the namespace."""
    return f'at_{factor}'.replace('.', '_')


def seconds(samples: Samples, first: int) -> float:
    """Between the sending of a block and of the newest."""
    return float(np.subtract(samples.sent[-1], samples.sent[first - 1])) / 1e9
