"""The advice that the table of a run lists, beside what was set."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support.two_lathes import FLAGS, record_two_lathes

from lathe_chatter.cli.main import main
from lathe_chatter.cli.report import _advice
from lathe_chatter.report.monitor_record import Flag


def test_the_speed_that_was_set_is_among_the_advice() -> None:
    times_and_speeds = np.array([[5.0, 5.5, 6.0, 9.0], [3635.2, 3634.4, 3633.1, 3632.0]])
    history: Any = SimpleNamespace(
        estimates={'recommended_speed_rpm': times_and_speeds},
        flags=[Flag(4.9, chatter=True)],
        changes=[SimpleNamespace(time=7.0, new={'spindle_speed_rpm': 3633.0})],
    )
    assert [f'{speed:.0f}' for _, speed in _advice(history)] == ['3635', '3633']


def test_each_lathe_of_a_run_has_a_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = record_two_lathes(tmp_path)
    assert main(['report', str(run)]) == 2
    for topic in ('/left/lathe/samples', '/right/lathe/samples'):
        assert topic in capsys.readouterr().err
        assert main(['report', str(run), '--topic', topic, '--json']) == 0
        found = json.loads(capsys.readouterr().out)
        cell = topic.split('/')[1]
        flags = [e['time'] for e in found['occurrences'] if e['what'] == 'chatter flagged']
        assert flags == [pytest.approx(0.02 * (FLAGS[cell] + 1))]
        assert Path(found['picture']).is_file()
        assert main(['report', str(run), '--topic', '/other/lathe/samples']) == 2
    assert len([*run.glob('*.png')]) == 2
