"""Data sets of labelled windows: machines, cuts and events are drawn, and the truth is known."""

from __future__ import annotations

from lathe_chatter.dataset.generation import make_dataset, read_windows
from lathe_chatter.dataset.plan import Plan, load_plan

__all__ = ['Plan', 'load_plan', 'make_dataset', 'read_windows']
