"""References that the solver is measured against, written without its stepper."""
