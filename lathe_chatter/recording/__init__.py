"""A run on disk: a rosbag2 folder of MCAP files that open whatever happened to their writer."""

from lathe_chatter.recording.reader import Run, read_run
from lathe_chatter.recording.writer import RunWriter, Topic

__all__ = ['Run', 'RunWriter', 'Topic', 'read_run']
