"""How fast the three nodes go together, with nothing lost."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from ear import DEEP, ear, wait_for_node
from processes import LATHE, MONITOR, RECORDER, running

from lathe_chatter.recording import verify

FACTORS = (10, 20, 30, 40, 0)


def measure_factor(seconds: float) -> None:
    """The real-time factor that lathe, monitor and recorder reach at 500 ticks."""
    with tempfile.TemporaryDirectory() as folder:
        for factor in FACTORS:
            _measure(factor, seconds, Path(folder, f'run-{os.getpid()}-{factor}'))


def _measure(factor: int, seconds: float, run: Path) -> None:
    values: dict[tuple[str, str], str] = {}
    reached: list[float] = []

    def note(message: DiagnosticArray) -> None:
        for status in message.status:
            for entry in status.values:
                values[status.name, entry.key] = entry.value
                if entry.key == 'real-time factor':
                    reached.append(float(entry.value))

    with ear() as listener, running(RECORDER, '-p', f'output:={run}'), running(MONITOR):
        listener.node.create_subscription(DiagnosticArray, '/diagnostics', note, DEEP)
        wait_for_node('/run_recorder')
        wait_for_node('/chatter_monitor')
        pace = '-p', f'real_time_factor:={factor}.0', '-p', 'await_readers:=2'
        with running(LATHE, *pace):
            listener.spin(lambda: len(reached) > 2, limit=60.0)
            reached.clear()
            listener.spin(limit=seconds)
            mean = sum(reached) / max(1, len(reached))
            given_up = float(values.get(('/lathe: pace', 'lag given up, s'), 'nan'))
        listener.spin(limit=2.0)
        lost = values.get(('/chatter_monitor: samples', 'samples lost'), 'an unknown number of')
    losses = [finding.text for finding in verify(run).findings if finding.loss]
    print(
        f'factor {factor or "free":>4}: {mean:5.1f} reached, {given_up:.3f} s given up, {lost} '
        f'samples lost by the monitor; the record: {"; ".join(losses) or "complete"}',
        flush=True,
    )
