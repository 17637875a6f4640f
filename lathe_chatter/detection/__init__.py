"""Chatter detected from the samples of a machine, and of nothing else."""

from lathe_chatter.detection.detector import ChatterDetector
from lathe_chatter.detection.speed_advice import Advice
from lathe_chatter.detection.states import Estimate

__all__ = ['Advice', 'ChatterDetector', 'Estimate']
