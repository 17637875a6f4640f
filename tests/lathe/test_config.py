"""Parameters by name, there and back."""

from __future__ import annotations

import pytest

from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe.config import LatheConfig, config_from
from lathe_chatter.model import BearingContact
from lathe_chatter.model.lathe_parameter_table import LATHE


def test_parameters_come_back_as_they_were() -> None:
    given = {
        'depth_of_cut': 0.001,
        'bearing_contact': 'none',
        'tool.mass': 0.06,
        'cutting_coefficient': 2e6,
        'tool_leaves_cut': False,
        'seed': 7,
        'sample_rate': 2e4,
    }
    config = config_from(given)
    assert config.cut.bearing_contact is BearingContact.NONE
    assert config.machine.tool.mass == 0.06
    assert {name: config.parameters()[name] for name in given} == given
    assert config_from(config.parameters()) == config
    assert set(LatheConfig().parameters()) == {row.name for row in LATHE if not row.node_only}


def test_the_lathe_is_the_one_described() -> None:
    lathe = config_from({'spindle_speed_rpm': 4000.0, 'sample_rate': 5e3, 'seed': 3}).lathe()
    assert (lathe.cut.spindle_speed_rpm, lathe.sample_rate, lathe.setup.seed) == (4000.0, 5e3, 3)


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'depth_of_cutt': 1e-3}, 'perhaps depth_of_cut'),
        ({'tool.mass': -1.0}, 'tool.mass is -1.0 kg'),
        ({'tool_leaves_cut': 'yes'}, 'tool_leaves_cut'),
        ({'seed': 1.5}, 'seed'),
        ({'bearing_contact': 'loose'}, 'none, gap, seated, both_sides'),
    ],
)
def test_what_is_wrong_is_named(values: dict[str, object], words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        config_from(values)
