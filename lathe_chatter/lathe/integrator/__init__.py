"""The compiled integrator of the virtual lathe: exact propagation between located events.

Read stepper.py first, then plain_steps.py (blocks of steps in which nothing happens,
simd_vectors.py) and event_step.py (the others); propagation.py solves a piece, surface.py holds
what the last turn left, spindle.py turns it, event_in_piece.py finds what happens inside a step,
state_layout.py names the numbers.
"""
