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
UNITS = dict(zip(SAMPLE_COLUMNS, ('s', 'rev', 'm', 'm/s', 'm', 'm/s', 'm', 'N'), strict=True))
"""Their units: SI, and revolutions."""
