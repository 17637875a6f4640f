"""The table of parameters: made from the model, and the only judge of a value."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from lathe_chatter.errors import ParameterError
from lathe_chatter.model import BearingContact, Cut, Machine, Mode
from lathe_chatter.model.lathe_parameter_table import (
    LATHE,
    cut_from,
    machine_from,
    samples_per_tick,
)
from lathe_chatter.model.parameter_table import Row
from lathe_chatter.nodes.parameter_descriptor import descriptor_of
from lathe_chatter.nodes.parameter_tables import MONITOR

CONTRACT = {
    'spindle_speed_rpm': (3000.0, 'rev/min', True),
    'depth_of_cut': (0.0005, 'm', True),
    'bearing_clearance': (5e-6, 'm', True),
    'bearing_contact': ('gap', '', True),
    'feed_speed': (0.0025, 'm/s', True),
    'real_time_factor': (1.0, '', True),
    'force_noise': (0.0, 'N/sqrt(Hz)', True),
    'sensor_noise': (0.0, 'm', True),
    'runout': (0.0, 'm', True),
    'speed_variation_amplitude': (0.0, '', True),
    'speed_variation_frequency': (1.0, 'Hz', True),
    'tool_leaves_cut': (True, '', False),
    'cutting_coefficient': (3.5e6, 'N/m2', False),
    'tool.mass': (0.05, 'kg', False),
    'tool.natural_frequency': (775.0, 'rad/s', False),
    'tool.damping_ratio': (0.05, '', False),
    'workpiece.mass': (0.05, 'kg', False),
    'workpiece.natural_frequency': (650.0, 'rad/s', False),
    'workpiece.damping_ratio': (0.05, '', False),
    'bearing_stiffness': (0.5 * 0.05 * 650.0**2, 'N/m', False),
    'spindle_acceleration': (0.0, 'rev/min per s', False),
    'tick_rate': (500.0, 'Hz', False),
    'sample_rate': (1e4, 'Hz', False),
    'seed': (0, '', False),
    'publish_clock': (False, '', False),
    'await_readers': (0, '', False),
    'record': ('', '', False),
}


def test_the_table_keeps_the_contract() -> None:
    table = {row.name: (row.default, row.unit, row.run_time) for row in LATHE}
    assert {name: table.get(name) for name in CONTRACT} == CONTRACT


@pytest.mark.parametrize('row', [*LATHE, *MONITOR], ids=lambda row: row.name)
def test_every_row_accepts_its_default_and_says_what_it_is(row: Row) -> None:
    assert row.check(row.default) == row.default
    descriptor = descriptor_of(row)
    assert len(row.meaning) > 5
    assert row.unit in descriptor.description
    assert row.allowed in descriptor.additional_constraints
    assert descriptor.read_only != row.run_time


@pytest.mark.parametrize('row', [r for r in LATHE if isinstance(r.default, float)], ids=str)
def test_no_double_accepts_what_is_no_number(row: Row) -> None:
    for value in (math.nan, math.inf, -math.inf, 'x', True, [1.0], None, 10**300):
        with pytest.raises(ParameterError, match=rf'^{row.name} is .* it must be .*\.$'):
            row.check(value)


@pytest.mark.parametrize('row', [r for r in LATHE if isinstance(r.default, float)], ids=str)
def test_every_double_has_a_range_that_holds_its_limits(row: Row) -> None:
    (ends,) = descriptor_of(row).floating_point_range
    assert ends.from_value <= row.default <= ends.to_value
    assert math.isfinite(ends.from_value)
    assert math.isfinite(ends.to_value)
    with pytest.raises(ParameterError):
        row.check(math.nextafter(ends.to_value, math.inf))
    with pytest.raises(ParameterError):
        row.check(math.nextafter(ends.from_value, -math.inf))


def test_a_whole_number_becomes_a_double_where_nothing_is_lost() -> None:
    speed = LATHE['spindle_speed_rpm'].check(6000)
    assert isinstance(speed, float)
    assert speed == 6000.0


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('seed', 1.0),
        ('seed', -1),
        ('seed', 2**31),
        ('seed', True),
        ('publish_clock', 1),
        ('bearing_contact', 'loose'),
        ('bearing_contact', 3),
        ('real_time_factor', 0.001),
        ('workpiece.mass', 0.0),
    ],
)
def test_a_refusal_names_the_parameter_and_what_is_allowed(name: str, value: Any) -> None:
    with pytest.raises(ParameterError) as refusal:
        LATHE.complete({name: value})
    assert str(refusal.value).startswith(f'{name} is {value!r}')
    assert LATHE[name].allowed in str(refusal.value)


def test_real_time_factor_may_be_zero() -> None:
    assert LATHE['real_time_factor'].check(0) == 0.0


def test_values_become_the_machine_and_the_cut() -> None:
    given = {
        'depth_of_cut': 0.001,
        'bearing_contact': 'seated',
        'tool.mass': 0.2,
        'workpiece.natural_frequency': 500.0,
        'bearing_stiffness': 3e4,
    }
    values = LATHE.complete(given)
    cut = Cut(depth_of_cut=0.001, bearing_contact=BearingContact.SEATED)
    workpiece = Mode(0.05, 500.0, 0.05)
    machine = Machine(Mode(0.2, 775.0, 0.05), workpiece, bearing_stiffness=3e4)
    assert cut_from(values) == cut
    assert machine_from(values) == machine


def test_the_bearing_follows_the_workpiece_unless_it_has_a_stiffness_of_its_own() -> None:
    values = LATHE.complete({'workpiece.mass': 0.2})
    assert values['bearing_stiffness'] == 0.5 * 0.2 * 650.0**2
    assert (
        LATHE.complete({'workpiece.mass': 0.2, 'bearing_stiffness': 7})['bearing_stiffness'] == 7.0
    )


def test_a_tick_has_a_whole_number_of_samples() -> None:
    assert samples_per_tick(1e4, 500.0) == 20
    assert samples_per_tick(1000.0, 0.1) == 10_000
    with pytest.raises(ParameterError, match=r'sample_rate is 1250\.0 Hz'):
        LATHE.complete({'sample_rate': 1250})
    with pytest.raises(ParameterError, match='tick_rate, which is 2000 Hz'):
        LATHE.complete({'sample_rate': 1000.0, 'tick_rate': 2000.0})


def test_an_unknown_name_is_told_its_nearest() -> None:
    assert LATHE.unknown('depth_of_cutt').endswith('did you mean depth_of_cut?')
    assert LATHE.unknown('depht').endswith('did you mean depth_of_cut?')
    assert LATHE.unknown('zzz') == "There is no parameter 'zzz'."


def test_the_table_of_a_readme_has_every_row() -> None:
    lines = LATHE.markdown().splitlines()
    assert len(lines) == 2 + len(list(LATHE))
    assert len({line.count('|') for line in lines}) == 1
    assert ('| `depth_of_cut` | 0.0005 | from 0 to 0.1 m | run time | depth of cut w |') in lines


ROOT = Path(__file__).resolve().parents[2]


def parameter_tables(*arguments: str) -> int:
    script = ROOT / 'scripts' / 'parameter_tables'
    return subprocess.run([sys.executable, script, *arguments], check=False).returncode


def test_what_is_made_of_the_tables_is_current(tmp_path: Path) -> None:
    assert parameter_tables('--check') == 0, 'run scripts/parameter_tables'
    page = tmp_path / 'docs' / 'reference' / 'nodes.md'
    page.parent.mkdir(parents=True)
    current = (ROOT / 'docs' / 'reference' / 'nodes.md').read_text()
    page.write_text(current.replace('| `depth_of_cut` | 0.0005 |', '| `depth` | |'))
    assert parameter_tables('--check', '--root', str(tmp_path)) == 1
    assert parameter_tables('--root', str(tmp_path)) == 0
    assert page.read_text() == current
    assert parameter_tables('--check', '--root', str(tmp_path)) == 0


def test_the_parameter_file_of_a_lathe_overrules_no_machine_file() -> None:
    template = yaml.safe_load((ROOT / 'config' / 'parameters' / 'lathe.yaml').read_text())
    given = template['/**/lathe']['ros__parameters']
    machine = {'machine': 'chucked_shaft'}
    assert LATHE.complete({**given, **machine}) == LATHE.complete(machine)
