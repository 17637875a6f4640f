"""Arrays to messages and back, as the contract has them; pure functions.

A block of samples is a `Float64MultiArray`, row-major: `dim[0]` counts the samples and `dim[1]`
has the names of the columns, joined by commas, as its label. Readers find columns by name.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from struct import pack

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from lathe_chatter.arrays import Array
from lathe_chatter.errors import LayoutError
from lathe_chatter.samples import SAMPLE_COLUMNS

_SECOND = 10**9
_TOOL, _WORKPIECE = 2, 4
_FORCE = SAMPLE_COLUMNS.index('cutting_force')


def samples_to_message(
    samples: Array, columns: Sequence[str] = SAMPLE_COLUMNS
) -> Float64MultiArray:
    """A block of samples as a message.

    Args:
        samples: (n, k), float64.
        columns: The k names.

    Raises:
        LayoutError: If names and columns do not match.
    """
    rows, width = samples.shape
    if width != len(columns):
        raise LayoutError(f'{width} columns of samples have {len(columns)} names.')
    layout = MultiArrayLayout(
        dim=[
            MultiArrayDimension(label='sample', size=rows, stride=rows * width),
            MultiArrayDimension(label=','.join(columns), size=width, stride=width),
        ]
    )
    # An array.array is taken as it is; a NumPy array would be checked value by value.
    return Float64MultiArray(layout=layout, data=array('d', samples.tobytes()))


class Wire:
    """Samples as the bytes that DDS carries, for `publish`.

    The doubles end a serialised block, and nothing before them changes from block to block of
    the same shape. To make a message and have it serialised costs as much as several ticks.
    """

    def __init__(self) -> None:
        """Begin with no shape."""
        self._shape: tuple[int, ...] = ()
        self._head = b''
        self._number_head: bytes = serialize_message(Float64())[:-8]

    def block(self, samples: Array) -> bytes:
        """A block (n, 8), columns as in `model.SAMPLE_COLUMNS`."""
        if samples.shape != self._shape:
            whole: bytes = serialize_message(samples_to_message(samples))
            self._shape, self._head = samples.shape, whole[: len(whole) - samples.nbytes]
        ready: bytes = self._head + samples.tobytes()
        return ready

    def number(self, value: float) -> bytes:
        """A `Float64`."""
        return self._number_head + pack('=d', value)


def samples_from_message(message: Float64MultiArray) -> tuple[Array, tuple[str, ...]]:
    """The block of samples in a message, without a copy, and the names of its columns.

    Returns:
        The samples (n, k), read-only in the sense that they are the message's, and k names.

    Raises:
        LayoutError: If the layout is not that of the contract, or does not fit the data.
    """
    dim = message.layout.dim
    if len(dim) != 2:
        raise LayoutError(f'A block of samples has 2 dimensions, not {len(dim)}.')
    rows, width = dim[0].size, dim[1].size
    columns = tuple(dim[1].label.split(','))
    if len(columns) != width:
        raise LayoutError(f'The label {dim[1].label!r} does not name {width} columns.')
    offset, stored = message.layout.data_offset, len(message.data)
    if offset + rows * width != stored or dim[1].stride != width:
        raise LayoutError(
            f'{rows} samples of {width} columns after an offset of {offset} '
            f'do not make {stored} numbers.'
        )
    return np.frombuffer(message.data, float)[offset:].reshape(rows, width), columns


class BlockReader:
    """Reads blocks of samples from the bytes that DDS carries.

    Nothing before the doubles changes from block to block of one lathe: where it is as it was
    in the block before, it need not be parsed again.
    """

    def __init__(self) -> None:
        """Begin with nothing known."""
        self._head, self._size = b'', 0
        self._shape = (0, 0)
        self._columns: tuple[str, ...] = ()

    def read(self, data: bytes) -> tuple[Array, tuple[str, ...]]:
        """The samples (n, k) of a serialised block, read-only, and the names of its k columns.

        Raises:
            LayoutError: If it is no block of samples.
        """
        head = len(self._head)
        if head and len(data) == self._size and data.startswith(self._head):
            return np.frombuffer(data, float, offset=head).reshape(self._shape), self._columns
        message = deserialize_message(data, Float64MultiArray)
        samples, columns = samples_from_message(message)
        head = len(data) - samples.nbytes
        if samples.size and data[head:] == samples.tobytes():  # in the order of this machine
            self._head, self._size = data[:head], len(data)
            self._shape, self._columns = (samples.shape[0], samples.shape[1]), columns
        return samples, columns


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
        sample: (8,), columns as in `model.SAMPLE_COLUMNS`.
        stamp: Simulated time, ns.

    Returns:
        Position m, velocity m/s, and effort N: the cutting force, which pushes the tool back
        and the workpiece on, equations (8a) and (8b).
    """
    message = JointState(name=['tool', 'workpiece'])
    message.header.stamp = time_message(stamp)
    force = float(sample[_FORCE])
    message.position = [float(sample[_TOOL]), float(sample[_WORKPIECE])]
    message.velocity = [float(sample[_TOOL + 1]), float(sample[_WORKPIECE + 1])]
    message.effort = [-force, force]
    return message
