"""What is cut: the machine, the cut, and the limits of every quantity of theirs."""

from __future__ import annotations

from lathe_chatter.model.cut import BearingContact, Cut, paper_initial_state
from lathe_chatter.model.machine import Body, Machine, Mode, Structure

__all__ = ['BearingContact', 'Body', 'Cut', 'Machine', 'Mode', 'Structure', 'paper_initial_state']
