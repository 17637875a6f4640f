"""A run in which two lathes sent their samples on one topic: said as it is, and soon."""

from __future__ import annotations

from pathlib import Path

import pytest

from lathe_chatter.cli.main import main
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model.lathe_parameter_table import parameters_of
from lathe_chatter.recording import LatheRun, verify


@pytest.fixture
def mixed(tmp_path: Path) -> Path:
    lathes = [VirtualLathe(), VirtualLathe()]
    lathes[1].advance(200_000)
    with LatheRun(tmp_path / 'run', parameters_of(lathes[0])) as run:
        for k in range(1000):
            for lathe in lathes[: 1 + (k >= 100)]:
                run.write(lathe.advance(20))
    return tmp_path / 'run'


def test_verify_says_that_they_are_mixed_and_counts_none_as_missing(mixed: Path) -> None:
    found = verify(mixed)
    (finding,) = found.findings
    assert finding.text == (
        '/lathe/samples: samples of several publishers are mixed, first at 0.202100 s and last at '
        '21.798100 s of simulated time, which goes to and fro 1798 times there: whether any are '
        'missing cannot be told.'
    )
    assert found.lossy


@pytest.mark.parametrize('verb', [['report'], ['verify', '--resimulate']])
def test_neither_report_nor_computing_again_takes_them_for_one_lathe(
    verb: list[str], mixed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code = main([verb[0], str(mixed), *verb[1:]])
    out, err = capsys.readouterr()
    if verb == ['report']:
        assert code == 2
        assert err.strip() == (
            'lathe-chatter report: From 0.202100 s on the samples of several publishers are mixed '
            'in /lathe/samples, and nobody can tell which is whose.'
        )
        assert not (mixed / 'report.png').exists()
    else:
        assert code == 1
        assert 'UNSURE /lathe/samples: not provable beyond 0 samples, because: From 0.2021' in out
