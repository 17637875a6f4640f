"""What the code before the move of its modules computed, recorded and found: it must not change.

Golden bytes guard a move and nothing else: whoever changes the numbers on purpose renews
golden.json, and says so in the changelog. They were computed on x86_64; elsewhere the last bits
may be others, and then nothing is claimed.
"""

from __future__ import annotations

import hashlib
import json
import platform
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lathe_chatter.detection import ChatterDetector
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut
from lathe_chatter.recording import verify
from lathe_chatter.samples import SAMPLE_COLUMNS

HERE = Path(__file__).parent
GOLDEN: dict[str, Any] = json.loads((HERE / 'golden.json').read_text(encoding='utf-8'))

CUTS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    'paper default': ({}, {}),
    'seated chatter': ({'depth_of_cut': 1e-3, 'bearing_contact': 'seated'}, {}),
    'no bearing': ({'depth_of_cut': 1e-3, 'bearing_contact': 'none'}, {}),
    'linear force': ({'depth_of_cut': 7e-4}, {'tool_leaves_cut': False}),
    'speed off the grid': ({'spindle_speed_rpm': 2999.7, 'depth_of_cut': 8e-4}, {}),
    'force noise': ({'force_noise': 0.02}, {'seed': 3}),
    'sensor noise and runout': ({'sensor_noise': 1e-6, 'runout': 2e-6}, {'seed': 4}),
    'speed variation': (
        {
            'speed_variation_amplitude': 0.1,
            'speed_variation_frequency': 2.0,
            'depth_of_cut': 6e-4,
        },
        {},
    ),
    'ramp': ({'depth_of_cut': 6e-4}, {'spindle_acceleration': 600.0}),
    'retuned and knocked': ({}, {}),
}

same_processor = pytest.mark.skipif(
    platform.machine() != 'x86_64', reason='the golden bits are those of x86_64'
)


def retuned(lathe: VirtualLathe, **changes: float) -> None:
    lathe.retune(lathe.cut.with_changes(**changes))


@same_processor
@pytest.mark.parametrize('name', CUTS)
def test_samples(name: str) -> None:
    cut, setup = CUTS[name]
    lathe = VirtualLathe(cut=Cut(**cut), **setup)
    parts = [lathe.advance(1500)]
    if name == 'ramp':
        retuned(lathe, spindle_speed_rpm=3600.0)
    if name == 'retuned and knocked':
        retuned(lathe, spindle_speed_rpm=3700.0, depth_of_cut=1.2e-3)
        lathe.knock(2e-3)
    parts.append(lathe.advance(1500))
    digest = hashlib.sha256(np.concatenate(parts).tobytes()).hexdigest()
    assert digest == GOLDEN['samples'][name]


@same_processor
def test_estimates() -> None:
    """To 1e-9: what NumPy and its libraries do in the design of the filters is not the same to the
    last bit on every processor of a kind."""
    lathe = VirtualLathe(cut=Cut(depth_of_cut=5e-4, force_noise=2e-4), seed=7)
    detector = ChatterDetector()
    rows = []
    for k in range(150):
        if k == 50:
            retuned(lathe, depth_of_cut=9e-4)
        if k == 120:
            retuned(lathe, spindle_speed_rpm=3536.0)
        found = detector.update(lathe.advance(400), SAMPLE_COLUMNS)
        figures = found.growth_rate, found.frequency, found.amplitude, found.recommended_speed_rpm
        rows.append((found.state, found.chatter, figures))
    assert any(flagged for _state, flagged, _figures in rows)
    for row, (state, flagged, *expected) in zip(rows, GOLDEN['estimates'], strict=True):
        assert row == (state, flagged, pytest.approx(expected, rel=1e-9, nan_ok=True))


def damaged(kind: str, place: Path) -> Path:
    """A copy of the recorded run with something done to it."""
    copy = place / kind.replace(' ', '_')
    shutil.copytree(HERE / 'run', copy)
    file = copy / 'run_0.mcap'
    data = bytearray(file.read_bytes())
    if kind == 'a bit of the first half flipped':
        data[len(data) // 3] ^= 4
    elif kind == 'the last tenth cut off':
        del data[len(data) * 9 // 10 :]
    elif kind == 'a hole of zeros':
        middle = len(data) // 2
        data[middle : middle + 64] = bytes(64)
    file.write_bytes(data)
    if kind == 'metadata gone':
        (copy / 'metadata.yaml').unlink()
    return copy


@pytest.mark.parametrize('kind', GOLDEN['verify'])
def test_a_run_recorded_before_the_move_is_verified_as_it_was(kind: str, tmp_path: Path) -> None:
    found = verify(damaged(kind, tmp_path))
    was = GOLDEN['verify'][kind]
    assert found.complete == was['complete']
    assert dict(sorted(found.messages.items())) == was['messages']
    said = [finding.text.replace(f'{found.run.path}/', '') for finding in found.findings]
    assert said == was['findings']
