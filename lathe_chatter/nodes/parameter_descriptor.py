"""What `ros2 param describe` shows of a parameter."""

from __future__ import annotations

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

from lathe_chatter.model.parameter_table import Row


def descriptor_of(row: Row) -> ParameterDescriptor:
    """The descriptor of a row; a range makes rclpy itself refuse nan and inf."""
    descriptor = ParameterDescriptor(
        name=row.name,
        description=f'{row.meaning}{row.unit and f" [{row.unit}]"}',
        additional_constraints=f'must be {row.allowed}',
        read_only=not row.run_time,
    )
    if row.limits is not None and isinstance(row.default, float):
        low = 0.0 if row.limits.or_zero else row.limits.low
        ends = FloatingPointRange(from_value=low, to_value=row.limits.high)
        descriptor.floating_point_range = [ends]
    elif row.limits is not None and isinstance(row.default, int):
        low, high = int(row.limits.low), int(row.limits.high)
        descriptor.integer_range = [IntegerRange(from_value=low, to_value=high)]
    return descriptor
