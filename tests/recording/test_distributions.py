"""Bags of every ROS 2 that is in use give the numbers that were sent, whatever is installed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from support.recorded import ARRAY

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.recording import read_run, recover, verify
from lathe_chatter.samples.codec import encode_block

START = 1_700_000_000_000_000_000
BLOCKS, ROWS = 50, 20
RANGE, STATES = 'sensor_msgs/msg/Range', 'sensor_msgs/msg/JointState'


def described_as_humble(values: dict[str, Any]) -> None:
    """metadata.yaml as Humble has it: version 5, qos as a text, no hashes."""
    values['version'] = 5
    for entry in values['topics_with_message_count']:
        entry['topic_metadata']['offered_qos_profiles'] = ''
        entry['topic_metadata'].pop('type_description_hash', None)
    for name in ('custom_data', 'ros_distro'):
        values.pop(name, None)


@pytest.mark.parametrize(
    ('store', 'version'),
    [(Stores.ROS2_HUMBLE, 5), (Stores.ROS2_JAZZY, 9), (Stores.ROS2_KILTED, 9)],
    ids=lambda each: str(getattr(each, 'value', each)),
)
def test_the_numbers_are_those_that_were_sent(store: Stores, version: int, tmp_path: Path) -> None:
    types = get_typestore(store)
    header = types.types['std_msgs/msg/Header'](
        stamp=types.types['builtin_interfaces/msg/Time'](sec=3, nanosec=4), frame_id='here'
    )
    distance = {'field_of_view': 1.0, 'min_range': 2.0, 'max_range': 3.0, 'range': 4.0}
    if 'variance' in types.types[RANGE].__dataclass_fields__:
        distance['variance'] = 5.0
    joints = types.types[STATES](
        header=header,
        name=['tool', 'workpiece'],
        position=np.array([1.5, -2.5]),
        velocity=np.zeros(0),
        effort=np.array([7.0]),
    )
    samples = VirtualLathe().advance(BLOCKS * ROWS)
    with Writer(tmp_path / 'run', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {
            name: writer.add_connection(name, kind, typestore=types)
            for name, kind in (
                ('/lathe/samples', ARRAY),
                ('/range', RANGE),
                ('/joints', STATES),
            )
        }
        near = types.types[RANGE](header=header, radiation_type=1, **distance)
        writer.write(topics['/range'], START, types.serialize_cdr(near, RANGE))
        writer.write(topics['/joints'], START + 1, types.serialize_cdr(joints, STATES))
        for k in range(BLOCKS):
            data = encode_block(samples[k * ROWS : (k + 1) * ROWS])
            writer.write(topics['/lathe/samples'], START + 2 + k * 2_000_000, data)
    if version == 5:
        file = tmp_path / 'run' / 'metadata.yaml'
        values = yaml.safe_load(file.read_text())
        described_as_humble(values['rosbag2_bagfile_information'])
        file.write_text(yaml.safe_dump(values))
    recover(tmp_path / 'run', tmp_path / 'saved')
    for path in (tmp_path / 'run', tmp_path / 'saved'):
        run = read_run(path)
        found = {each.topic: each.message for each in run.messages('/range', '/joints')}
        assert {name: getattr(found['/range'], name) for name in distance} == distance
        assert found['/range'].header.stamp.nanosec == 4
        assert found['/joints'].name == ['tool', 'workpiece']
        assert found['/joints'].position.tolist() == [1.5, -2.5]
        assert found['/joints'].effort.tolist() == [7.0]
        columns = run.samples().columns
        assert np.column_stack([*columns.values()]).tobytes() == samples.tobytes()
        checked = verify(path)
        assert checked.complete, checked.findings
        assert checked.messages == {'/lathe/samples': BLOCKS, '/range': 1, '/joints': 1}
