"""A run on disk: a rosbag2 folder of MCAP files that open whatever happened to their writer."""

from lathe_chatter.errors import RunReadError
from lathe_chatter.recording.lathe_run_writer import LatheRun
from lathe_chatter.recording.recover import Recovery, recover
from lathe_chatter.recording.resimulate import Resimulation, resimulate
from lathe_chatter.recording.resimulated_lathe import Difference
from lathe_chatter.recording.run import Run, Samples, read_run
from lathe_chatter.recording.run_writer import RunWriter, Topic
from lathe_chatter.recording.verify import Finding, Verification, verify

__all__ = [
    'Difference',
    'Finding',
    'LatheRun',
    'Recovery',
    'Resimulation',
    'Run',
    'RunReadError',
    'RunWriter',
    'Samples',
    'Topic',
    'Verification',
    'read_run',
    'recover',
    'resimulate',
    'verify',
]
