"""The compiled integrator of the virtual lathe: exact propagation between located events.

Read stepper.py first, then quiet.py (steps in which nothing happens) and pieces.py (the
others); propagation.py solves a piece, surface.py holds what the last turn left, spindle.py
turns it, events.py finds what happens inside a step, layout.py names the numbers.
"""
