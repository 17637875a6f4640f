"""Times and samples as messages, as the contract has them; pure functions."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from sensor_msgs.msg import JointState

from lathe_chatter.array_types import Array
from lathe_chatter.samples import SAMPLE_COLUMNS

_SECOND = 10**9
BED_FRAME = 'lathe_bed'
_TOOL, _WORKPIECE = 2, 4
_FORCE = SAMPLE_COLUMNS.index('cutting_force')


def nanoseconds(samples_taken: int, sample_rate: float) -> int:
    """Simulated time after a number of samples in whole nanoseconds, rounded once, exactly."""
    rate, per = sample_rate.as_integer_ratio()
    return (2 * samples_taken * per * _SECOND + rate) // (2 * rate)


def time_message(stamp: int) -> Time:
    """A time given in nanoseconds."""
    seconds, rest = divmod(stamp, _SECOND)
    return Time(sec=seconds, nanosec=rest)


def joint_states(sample: Array, stamp: int) -> JointState:
    """One sample as two prismatic joints.

    Args:
        sample: (8,), columns as in `samples.SAMPLE_COLUMNS`.
        stamp: When, ns.

    Returns:
        Both along the x axis of the frame `lathe_bed` (config/urdf/lathe.urdf): position m,
        velocity m/s, and effort N: the cutting force, which pushes the tool back and the
        workpiece on, equations (8a) and (8b).
    """
    message = JointState(name=['tool', 'workpiece'])
    message.header.stamp = time_message(stamp)
    message.header.frame_id = BED_FRAME
    force = float(sample[_FORCE])
    message.position = [float(sample[_TOOL]), float(sample[_WORKPIECE])]
    message.velocity = [float(sample[_TOOL + 1]), float(sample[_WORKPIECE + 1])]
    message.effort = [-force, force]
    return message
