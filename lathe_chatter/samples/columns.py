"""The columns of a block of samples."""

from __future__ import annotations

STATE_FIELDS = (
    'tool_displacement',
    'tool_velocity',
    'workpiece_displacement',
    'workpiece_velocity',
)
SAMPLE_COLUMNS = ('time', 'spindle_angle', *STATE_FIELDS, 'chip_thickness', 'cutting_force')
"""The columns of a block of samples."""
ACCELERATION_COLUMNS = ('tool_acceleration', 'workpiece_acceleration')
"""What accelerometers add."""
UNITS = dict(
    zip(
        SAMPLE_COLUMNS + ACCELERATION_COLUMNS,
        ('s', 'rev', 'm', 'm/s', 'm', 'm/s', 'm', 'N', 'm/s2', 'm/s2'),
        strict=True,
    )
)
"""Their units: SI, and revolutions."""


def sample_columns(*, accelerometers: bool) -> tuple[str, ...]:
    """The columns of the samples of a lathe with or without accelerometers."""
    return SAMPLE_COLUMNS + ACCELERATION_COLUMNS if accelerometers else SAMPLE_COLUMNS
