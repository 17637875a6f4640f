"""Run, pause, step and reset."""

from __future__ import annotations

from lathe_chatter.nodes.simulation_control import RunControl, RunState


def test_it_begins_running() -> None:
    assert RunControl().state is RunState.RUNNING


def test_pause_is_idempotent() -> None:
    control = RunControl()
    assert control.pause(pause=True) == (True, 'Now paused.')
    assert control.pause(pause=True) == (True, 'Already paused.')
    assert control.state is RunState.PAUSED
    assert control.pause(pause=False) == (True, 'Now running.')
    assert control.pause(pause=False) == (True, 'Already running.')
    assert control.state is RunState.RUNNING


def test_a_step_is_refused_while_running_and_leaves_a_pause_as_it_is() -> None:
    control = RunControl()
    assert control.may_step() == (False, 'A step is possible only while paused.')
    control.pause(pause=True)
    assert control.may_step().done
    assert control.state is RunState.PAUSED


def test_after_the_guard_only_a_reset_helps() -> None:
    control = RunControl()
    control.end('It flew away.')
    assert control.state is RunState.ENDED
    for answer in (control.pause(pause=True), control.pause(pause=False), control.may_step()):
        assert answer == (False, 'It flew away. Only a reset helps.')
    assert control.reset().done
    assert control.state is RunState.RUNNING


def test_a_reset_keeps_the_pause_and_is_idempotent() -> None:
    control = RunControl()
    control.pause(pause=True)
    control.reset()
    control.reset()
    assert control.state is RunState.PAUSED
    assert control.resets == 2
