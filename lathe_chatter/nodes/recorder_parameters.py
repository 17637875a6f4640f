"""The parameters of the recorder, by themselves: those of others come with what computes them."""

from __future__ import annotations

from lathe_chatter.model.parameter_table import ParameterTable, Row
from lathe_chatter.model.quantity_fields import Quantity
from lathe_chatter.recording.open_chunk import Compression

RECORDED_TOPICS = [
    'lathe/samples',
    *(
        f'chatter_monitor/{name}'
        for name in (
            'chatter',
            'state',
            'growth_rate',
            'frequency',
            'amplitude',
            'recommended_speed_rpm',
            'margin',
        )
    ),
    'chatter_supervisor/action',
    '/parameter_events',
    '/rosout',
    '/diagnostics',
]

RECORDER = ParameterTable(
    (
        Row('output', '', 'folder of the run to make; empty: runs/<date-time>'),
        Row('topics', RECORDED_TOPICS, 'topics to record, whenever they appear'),
        Row('all_topics', default=False, meaning='whether to record every topic that there is'),
        Row('topics_like', '', 'regular expression: topics whose names it matches as well'),
        Row('exclude', '', 'regular expression: topics whose names it matches are left out'),
        Row('attachments', [], 'files to keep in the run as they are, its scenario for instance'),
        Row('autostart', default=True, meaning='whether to record from the start'),
        Row(
            'split_duration',
            300.0,
            'recording in one file before the next is begun',
            Quantity('', 's', low=1.0, high=86400.0),
        ),
        Row(
            'split_size',
            0,
            'size of one file from which on the next is begun; 0: any',
            Quantity('', 'byte', high=2.0**53),
        ),
        Row(
            'repeat_latched',
            default=False,
            meaning='whether each file begins with the latest message of latched topics',
        ),
        Row(
            'compression',
            Compression.LZ4.value,
            'how the files are compressed',
            choices=Compression,
        ),
        Row(
            'snapshot',
            0.0,
            'keep the last so long in memory, and write it when `~/snapshot` is called or chatter '
            'is flagged; 0: write all as it comes',
            Quantity('', 's', high=3600.0),
        ),
        Row(
            'min_free_space',
            50_000_000,
            'bytes that the disk must keep; with less the recording ends, complete',
            Quantity('', 'byte', high=2.0**53),
        ),
    )
)
"""Node `run_recorder`."""
