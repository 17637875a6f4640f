"""A run of two lathes, each with what a monitor beside it said, as one recorder has it."""

from __future__ import annotations

from operator import attrgetter
from pathlib import Path

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut
from lathe_chatter.model.lathe_parameter_table import parameters_of
from lathe_chatter.recording import LatheRun, Run, RunWriter, read_run
from lathe_chatter.recording.provenance import PARAMETERS
from lathe_chatter.recording.ros_messages import topic_of_type

BLOCKS = 50
FLAGS = {'left': 10, 'right': 30}
"""Block of 0.02 s after which the monitor of each cell flags chatter."""
DEPTHS = {'left': 0.0005, 'right': 0.00062}


def record_two_lathes(folder: Path) -> Path:
    """Record 1 s of `/left/lathe` and `/right/lathe` into `folder / 'both'`."""
    runs = [_one(folder, cell) for cell in FLAGS]
    raws = [raw for run in runs for raw in run.raw_messages()]
    with RunWriter(folder / 'both') as writer:
        for note in (note for run in runs for note in run.notes()):
            if note.name.startswith(PARAMETERS):
                writer.note(note.name, note.values)
        for raw in sorted(raws, key=attrgetter('log_time')):
            writer.add_topic(topic_of_type(raw.topic, raw.type))
            times = {'log_time': raw.log_time, 'publish_time': raw.publish_time}
            writer.write(raw.topic, raw.data, **times)
    return folder / 'both'


def _one(folder: Path, cell: str) -> Run:
    lathe = VirtualLathe(cut=Cut(depth_of_cut=DEPTHS[cell]))
    name = f'/{cell}/lathe'
    with LatheRun(folder / cell, parameters_of(lathe), name=name, simulated=True) as run:
        for k in range(BLOCKS):
            run.write(lathe.advance(200))
            if k == FLAGS[cell]:
                run.publish(f'/{cell}/chatter_monitor/chatter', 'std_msgs/msg/Bool', data=True)
    return read_run(folder / cell)
