from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lathe_chatter.errors import MachineFileError, ParameterError
from lathe_chatter.lathe.config import config_from
from lathe_chatter.model import BearingContact, Cut, Machine, Mode
from lathe_chatter.model.lathe_parameter_table import LATHE, machine_from
from lathe_chatter.model.machine_file import load_machine, shipped_machines
from lathe_chatter.model.uncertainty import uncertainty_from
from lathe_chatter.stability import critical_depths

SHAFT = """
tool:
  modes:
    - {frequency: 312 Hz, damping_ratio: 3 %, stiffness: 21 N/um}
workpiece:
  modes:
    - {frequency: 754 rad/s, damping_ratio: 0.03, mass: 20 kg}
    - {frequency: 480, damping_ratio: 0.02, mass: 8, bearing: -0.8}
bearing: {stiffness: 5.0e7, clearance: 12 um, contact: seated}
material: {cutting_coefficient: 1500 MPa, process_damping: 450 kN/m}
spindle: {slowest_speed: 60 rpm, fastest_speed: 3000, acceleration: 500 rpm/s}
cut: {spindle_speed: 900 rpm, depth_of_cut: 0.5 mm, feed: 0.2 mm/rev, workpiece_diameter: 80 mm}
"""


def test_a_machine_with_units() -> None:
    found = load_machine(SHAFT)
    tool, (first, second) = found.machine.tool, found.machine.workpiece.modes
    assert tool.natural_frequency == pytest.approx(2.0 * math.pi * 312.0, rel=1e-15)
    assert tool.stiffness == pytest.approx(21e6, rel=1e-14)
    assert (first.natural_frequency, first.mass) == (754.0, 20.0)
    assert (second.bearing, second.chip) == (-0.8, 1.0)
    assert found.machine.bearing_stiffness == 5e7
    assert found.machine.cutting_coefficient == 1.5e9
    assert (found.slowest_speed, found.fastest_speed) == (60.0, 3000.0)
    assert found.spindle_acceleration == 500.0
    assert found.cut.bearing_clearance == 12e-6
    assert found.cut.bearing_contact is BearingContact.SEATED
    assert found.cut.depth_of_cut == 5e-4
    assert (found.cut.feed_per_revolution, found.cut.feed) == (2e-4, 2e-4)
    assert found.cut.feed_speed == pytest.approx(2e-4 * 15.0, rel=1e-15)
    assert (found.cut.process_damping, found.cut.workpiece_diameter) == (4.5e5, 0.08)
    assert found.speed_range == (60.0, 3000.0)


def test_a_feed_is_per_revolution_or_a_speed() -> None:
    per_turn, speed, none = (
        load_machine(f'{{cut: {{spindle_speed: 600, {feed}}}}}').cut
        for feed in ('feed: 0.1 mm/rev', 'feed_speed: 90 mm/min', 'feed: 0')
    )
    assert per_turn.with_changes(spindle_speed_rpm=1200.0).feed == 1e-4
    assert speed.with_changes(spindle_speed_rpm=1200.0).feed == pytest.approx(75e-6)
    assert none.feed == 0.0
    # A feed speed that is given beside the file rules, and so it does after it was recorded.
    config = config_from({'machine': SHAFT, 'feed_speed': 0.001})
    assert config.cut.feed == pytest.approx(0.001 / 15.0)
    assert config_from(config.parameters()) == config


def test_a_fast_machine_is_sampled_fast_enough() -> None:
    fast = '{tool: {modes: [{frequency: 5.05 kHz, damping_ratio: 2 %, mass: 4 g}]}}'
    assert config_from({'machine': fast}).setup.sample_rate == 51e3
    assert LATHE.complete({'machine': fast})['sample_rate'] == 51e3
    assert config_from({'machine': fast, 'sample_rate': 2e4}).setup.sample_rate == 2e4
    assert config_from({'machine': SHAFT}).setup.sample_rate == 1e4


def test_the_shipped_paper_is_the_paper() -> None:
    found = load_machine('paper')
    assert found.machine == Machine()
    assert found.cut == Cut()


@pytest.mark.parametrize('name', ['paper', 'chucked_shaft', 'boring_bar'])
def test_what_is_saved_comes_back_to_the_last_bit(name: str, tmp_path: Path) -> None:
    assert name in shipped_machines()
    found = load_machine(name)
    found.save(tmp_path / 'again.yaml')
    for again in (load_machine(tmp_path / 'again.yaml'), load_machine(found.text())):
        assert again.machine == found.machine
        assert again.cut == found.cut
        assert again.speed_range == found.speed_range
        assert again.spindle_acceleration == found.spindle_acceleration


def test_everything_that_a_file_says_comes_back(tmp_path: Path) -> None:
    found = load_machine(SHAFT.replace('mass: 20 kg', 'mass: 20 kg, errors: {mass: 3 %}'))
    cut = found.cut.with_changes(bearing_contact='both_sides', feed_speed=0.002)
    found = replace(found, cut=cut, name='again')
    found.save(tmp_path / 'again.yaml')
    assert load_machine(tmp_path / 'again.yaml') == found


ONE_MODE = 'tool: {modes: [{frequency: 3, damping_ratio: 0.1, mass: 1%s}],\n'


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('tool: {modes: [{frequency: 312 kg, damping_ratio: 0.1, mass: 1}]}\n',
         ('line 1', "tool.modes[0].frequency is '312 kg':", 'in Hz, kHz, 1/s, rad/s')),
        ('tool:\n  modes:\n    - {frequency: 3, damping_ratio: 2, mass: 1}\n',
         ('line 3', 'damping_ratio is 2', 'from 0 to 1')),
        ('tool: {modes: [{frequency: 3 Hz, damping_ratio: 0.1, mass: 1, stiffness: 3}]}\n',
         ('either mass or stiffness',)),
        ('tool: {modes: [{damping_ratio: 0.1, mass: 1}]}\n', ('needs frequency',)),
        ('tool: {modes: []}\n', ('modes must be a list',)),
        ('tol: {}\n', ("no 'tol'", 'tool')),
        ('\n\nbearing: {contact: both}\n', ('line 3', "contact is 'both'", 'seated')),
        ('spindle: {slowest_speed: 3000, fastest_speed: 60}\n', ('fastest_speed is 60',)),
        ('cut: {depth_of_cut: 1 kg}\n', ('depth_of_cut', 'mm')),
        ('cut: {feed: [1, 2]}\n', ('cut.feed',)),
        ('tool: [\n', ('line',)),
        ('- 1\n', ('mapping',)),
        ('tool: {modes: [{frequency: 3, damping_ratio: 0.1, mass: 1}], covariance: [[1]]}\n',
         ('covariance', '3 x 3')),
        (ONE_MODE % '' + '  covariance: [[.inf, 0, 0], [0, 1, 0], [0, 0, 1]]}\n',
         ('line 2', 'variances from 0')),
        (ONE_MODE % ', errors: {chip: 1 %}' + '}\n',
         ("no 'chip'", 'known are frequency')),
        (ONE_MODE % ', errors: {stiffness: 1 %}' + '}\n',
         ('line 1', 'stiffness has an error here and no value')),
        (ONE_MODE % ',\n  errors: {frequency: 31 Hz}' + '}\n',
         ('line 2', 'errors.frequency is 31', 'to 30 Hz')),
        ('tool: {modes: [{frequency: .nan, damping_ratio: 0.1, mass: 1}]}\n', ("is '.nan'",)),
        ('tool: {modes: [{frequency: 1e400, damping_ratio: 0.1, mass: 1}]}\n', ('is inf Hz',)),
        ('tool: {modes: [{frequency: 3 rad/s, damping_ratio: 0.1, stiffness: 1e9}]}\n',
         ('mass is', 'to 1e+06 kg')),
        ('tool: {modes: [' + 17 * '{frequency: 3, damping_ratio: 0.1, mass: 1},' + ']}\n',
         ('at most 16',)),
        ('bearing: {contact: [gap]}\n', ("contact is '[gap]'", 'both_sides')),
        ('bearing: {clearance: 5 mm}\n', ('bearing.clearance is 0.005 m', 'to 0.001 m')),
        ('material: {process_damping: 3 m}\n', ("process_damping is '3 m'", 'N/m')),
        ('material: {cutting_coefficient: 1500 Mpa}\n', ("is '1500 Mpa'", 'MPa')),
        ('material: {errors: {cutting_coefficient: 1 %}}\n', ('no value beside it',)),
        ('material: {process_damping: 1, errors: {process_damping: 1 %}}\n',
         ("errors: there is no 'process_damping'",)),
        ('spindle: {slowest_speed: slow}\n', ("slowest_speed is 'slow'", 'in rev/min, rpm')),
        # A percentage that lacks its sign would make certain what is not known.
        ('material: {cutting_coefficient: 1500 MPa, errors: {cutting_coefficient: 15}}\n',
         ('line 1', 'cutting_coefficient is 1e-08 of its value', 'as 2 % is')),
        ('cut: {errors: {feed: 1 %}}\n', ("cut: there is no 'errors'",)),
        ('cut: {feed: 0.2 mm/s}\n', ("feed is '0.2 mm/s'", 'mm/rev')),
        ('cut: {feed_speed: 0.2 mm/rev}\n', ("feed_speed is '0.2 mm/rev'", 'mm/min')),
        ('cut: {workpiece_diameter: 0}\n', ('workpiece_diameter is 0 m',)),
        ('cut: {}\ncut: {}\n', ('line 2', "'cut' stands there twice")),
        ('? [1, 2]\n: 3\n', ('line 1', 'a name must be a text')),
        ('tool: *x\n', ('undefined alias',)),
        ('a: b\n---\nc: d\n', ('another document',)),
        ('{"tool": ' * 2000 + '\n', ('nested too deeply',)),
        ('tool: {modes: &a [*a]}\n', ('line 1', 'mapping')),
    ],
)  # fmt: skip
def test_a_mistake_is_one_sentence_with_its_line(text: str, said: tuple[str, ...]) -> None:
    with pytest.raises(MachineFileError) as mistake:
        load_machine(text)
    for part in said:
        assert part in str(mistake.value)
    assert '\n' not in str(mistake.value)


def test_a_file_that_is_not_there_names_those_that_are() -> None:
    with pytest.raises(MachineFileError, match='chucked_shaft'):
        load_machine('nowhere.yaml')


def test_a_lathe_and_its_record_have_the_machine_of_a_file(tmp_path: Path) -> None:
    file = tmp_path / 'shaft.yaml'
    file.write_text(SHAFT)
    config = config_from({'machine': str(file), 'depth_of_cut': 1e-4})
    assert config.machine == load_machine(file).machine
    assert config.cut.depth_of_cut == 1e-4
    assert config.cut.spindle_speed_rpm == 900.0
    assert config.setup.spindle_acceleration == 500.0
    file.unlink()  # what is recorded is the machine, and not where it stood
    again = config_from(config.parameters())
    assert again == config
    assert again.described is not None
    assert again.described.speed_range == (60.0, 3000.0)


def test_a_record_has_the_standard_errors_of_a_file() -> None:
    config = config_from({'machine': ERRORS, 'tool.mass': 3.0})
    again = config_from(config.parameters())
    assert again.described is not None
    assert again.described.machine == config.machine
    assert again.described.uncertainty is not None
    assert again.described.uncertainty.error_of('cutting_coefficient') == pytest.approx(0.1)


def test_what_is_given_beside_the_file_wins() -> None:
    config = config_from({'machine': SHAFT, 'tool.mass': 3.0, 'cutting_coefficient': 2e9})
    assert config.machine.tool.mass == 3.0
    assert config.machine.cutting_coefficient == 2e9
    with pytest.raises(ParameterError, match=r'workpiece.mass.*several modes'):
        machine_from({'machine': SHAFT, 'workpiece.mass': 3.0})


def test_a_node_has_the_text_of_its_machine_and_no_false_modes(tmp_path: Path) -> None:
    file = tmp_path / 'shaft.yaml'
    file.write_text(SHAFT)
    values = LATHE.complete({'machine': str(file)})
    assert load_machine(str(values['machine'])).machine == load_machine(file).machine
    assert 'workpiece.mass' not in values
    assert values['tool.damping_ratio'] == 0.03
    assert values['spindle_speed_rpm'] == 900.0
    assert LATHE.complete(values) == values


ERRORS = """
tool:
  modes:
    - {frequency: 300 Hz, damping_ratio: 0.03, mass: 2 kg,
       errors: {frequency: 3 Hz, damping_ratio: 20 %, mass: 5 %}}
material: {cutting_coefficient: 1500 MPa, errors: {cutting_coefficient: 150 MPa}}
"""


def test_errors_are_relative_and_a_mass_becomes_a_stiffness() -> None:
    known = load_machine(ERRORS).uncertainty
    assert known is not None
    assert known.error_of('tool.modes[0].frequency') == pytest.approx(0.01)
    assert known.error_of('tool.modes[0].damping_ratio') == pytest.approx(0.2)
    assert known.error_of('tool.modes[0].stiffness') == pytest.approx(math.hypot(0.05, 0.02))
    assert known.error_of('cutting_coefficient') == pytest.approx(0.1)
    again = load_machine(load_machine(ERRORS).text()).uncertainty
    assert again is not None
    assert again.error_of('tool.modes[0].stiffness') == pytest.approx(math.hypot(0.05, 0.02))


def test_drawn_machines_scatter_as_they_are_told() -> None:
    found = load_machine(ERRORS)
    assert found.uncertainty is not None
    machines, _ = found.uncertainty.draw(found.machine, 4000, seed=3)
    mass = np.log([machine.tool.mass for machine in machines])
    frequency = np.log([machine.tool.natural_frequency for machine in machines])
    assert mass.std() == pytest.approx(0.05, rel=0.05)
    assert frequency.std() == pytest.approx(0.01, rel=0.05)
    assert abs(np.corrcoef(mass, frequency)[0, 1]) < 0.06


def test_uncertainty_in_short() -> None:
    known = uncertainty_from('frequency=2%, damping=20%,C=15%', Machine())
    assert known.error_of('workpiece.modes[0].frequency') == pytest.approx(0.02)
    assert known.error_of('tool.modes[0].damping_ratio') == pytest.approx(0.2)
    assert known.error_of('cutting_coefficient') == pytest.approx(0.15)
    # What a file says else stays, with its covariances.
    told = load_machine(ERRORS)
    both = uncertainty_from('C=3%', told.machine, told.uncertainty)
    assert both.error_of('cutting_coefficient') == pytest.approx(0.03)
    assert both.error_of('tool.modes[0].stiffness') == pytest.approx(math.hypot(0.05, 0.02))
    for wrong in ('speed=2%', 'frequency=two', 'frequency=-1%'):
        with pytest.raises(ParameterError, match=r'^errors .*is '):
            uncertainty_from(wrong, Machine())
        with pytest.raises(ParameterError, match=r'^--uncertain '):
            uncertainty_from(wrong, Machine(), given_as='--uncertain')
    with pytest.raises(ParameterError, match="'nix': it must be of frequency"):
        uncertainty_from('nix', Machine())


TOOL_ALONE = 'tool: {modes: [{frequency: 200 Hz, damping_ratio: 2 %, stiffness: 1e7 N/m}]}\n'
STEEL = 'material: {cutting_coefficient: 1500 MPa}\n'


def test_a_rigid_body_leaves_the_limit_of_the_other_alone(tmp_path: Path) -> None:
    """The lowest limit of one mode is 2 k zeta (1 + zeta) / C."""
    found = load_machine(TOOL_ALONE + 'workpiece: rigid\n' + STEEL)
    assert found.cut.bearing_contact is BearingContact.NONE
    assert not found.assumption()
    speeds = np.linspace(1000.0, 20000.0, 4001)
    lowest = critical_depths(found.machine, speeds, seated=False).min()
    assert lowest == pytest.approx(2.0 * 1e7 * 0.02 * 1.02 / 1.5e9, rel=1e-4)
    found.save(tmp_path / 'a.yaml')
    assert 'workpiece: rigid' in (tmp_path / 'a.yaml').read_text()
    assert load_machine(tmp_path / 'a.yaml') == replace(found, name='a')
    with pytest.raises(MachineFileError, match='line 2: workpiece must have `modes`, or be rigid'):
        load_machine(TOOL_ALONE + 'workpiece: stiff')


def test_what_stands_in_for_what_a_file_lacks_is_said() -> None:
    said = load_machine(TOOL_ALONE).assumption()
    assert 'lacks a workpiece (50 g' in said
    assert 'and a cutting coefficient (3.5 MPa' in said
    assert said.endswith('with a bearing clearance of 5 um.')
    assert 'cutting coefficient' not in load_machine(TOOL_ALONE + STEEL).assumption()
    beside = replace(Machine(), cutting_coefficient=2e9, workpiece=Mode(60.0, 650.0, 0.05))
    assert not load_machine(TOOL_ALONE).assumption(beside)
    assert not load_machine('spindle: {fastest_speed: 3000 rpm}\n').assumption()
    for machine in shipped_machines():
        assert not load_machine(machine).assumption()


def test_a_bearing_of_which_a_file_has_nothing_is_said_to_be_assumed() -> None:
    found = load_machine(TOOL_ALONE + TOOL_ALONE.replace('tool', 'workpiece') + STEEL)
    assert not found.assumption(cut=found.cut)
    said = found.assumption(cut=replace(found.cut, bearing_contact=BearingContact.GAP))
    assert 'has no bearing: 5e+06 N/m is taken as its stiffness' in said
    given = replace(found.machine, bearing_stiffness=2e7)
    assert not found.assumption(given, replace(found.cut, bearing_contact=BearingContact.SEATED))
