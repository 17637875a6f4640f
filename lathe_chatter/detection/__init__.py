"""Chatter detected from the samples of a machine, and of nothing else."""

from lathe_chatter.detection.detector import ChatterDetector
from lathe_chatter.detection.estimate import Estimate
from lathe_chatter.detection.speed_advice import Advice

__all__ = ['Advice', 'ChatterDetector', 'Estimate']
