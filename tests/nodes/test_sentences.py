"""What the nodes can say, what must be true when they do, and the test that shows it.

A sentence that is not in the table fails here, and so does one that nobody says any more.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import lathe_chatter.nodes

NODES = Path(lathe_chatter.nodes.__file__).parent
TESTS = Path(__file__).parents[1]
LATHE, CLOCK = 'nodes/test_lathe_node.py', 'nodes/test_followed_clock.py'
CONTROL, STANDARD = 'nodes/test_simulation_control.py', 'nodes/test_simulation_services.py'
ARGUMENTS = 'nodes/test_command_line_parameters.py'
MAIN, MONITOR = 'nodes/test_node_main.py', 'nodes/test_monitor_node.py'
HOSTILE = 'nodes/test_hostile_client.py'
STATISTICS, GROUP = 'nodes/test_lathe_diagnostics.py', 'nodes/test_node_processes.py'

SAID = {
    'lathe_node.py': {
        '/clock went back to {} s, {} s before the next tick: the cut goes on from there.': (
            'it shows a time before that of the next tick, by more than one',
            f'{CLOCK}::test_a_clock_that_goes_back_or_stands_still_is_told',
        ),
        (
            '/clock is {} s ahead of the cut at {} s, more than the {} s of clock_catch_up: '
            'that time is not cut.'
        ): (
            'so much time was given up, and is counted as lag',
            f'{CLOCK}::test_a_jump_of_the_clock_is_told_and_not_cut',
        ),
        'Waiting for {} readers of my samples.': (
            'await_readers is above 0 and nothing was cut yet',
            f'{LATHE}::test_it_can_wait_for_its_readers',
        ),
        'Behind: {} s of simulated time given up so far.': (
            'the pacer has given up so much since the start, part of it just now',
            'nodes/test_pacing.py::test_behind_by_more_than_it_may_catch_up_the_excess_is_counted',
        ),
        'Requests take {} of the time: {} in the last second.': (
            'their callbacks took that part of the second, and over a quarter of the one before',
            f'{LATHE}::test_a_flood_of_requests_is_told',
        ),
        'More than {} knocks between two ticks: the others are dropped.': (
            'so many were kept for the next tick, and another came',
            f'{LATHE}::test_a_flood_of_knocks_is_bounded_and_told',
        ),
        'Now at {} s.': (
            'the ticks of the step were made, and the lathe is at that time',
            f'{CLOCK}::test_how_far_the_clock_is_caught_up_with_can_be_chosen',
        ),
        'false under use_sim_time, for /clock has one owner': (
            'publish_clock and use_sim_time were both asked for; the node does not start',
            f'{LATHE}::test_it_cannot_drive_the_clock_that_it_follows',
        ),
    },
    'lathe_graph_watch.py': {
        'waiting for /clock': (
            'under use_sim_time: nobody publishes /clock, or no time has come yet',
            f'{CLOCK}::test_without_a_clock_it_waits_and_says_so',
        ),
        '{} nodes publish /clock: it must have one owner': (
            'the node drives or follows /clock, and the graph has so many publishers of it',
            f'{LATHE}::test_a_second_owner_of_the_clock_is_told',
        ),
        'use_sim_time is set, and /clock has shown no time yet: nothing is cut before.': (
            'under use_sim_time, 2 s after the start; told once',
            f'{CLOCK}::test_without_a_clock_it_waits_and_says_so',
        ),
        '/clock stands still': (
            'the /clock that is followed has shown the same time for 2 s',
            f'{CLOCK}::test_a_clock_that_goes_back_or_stands_still_is_told',
        ),
        '/clock stands still at {} s, and the cut with it.': (
            'the same; told once each time that it stops',
            f'{CLOCK}::test_a_clock_that_goes_back_or_stands_still_is_told',
        ),
        '/clock goes on at {} s.': (
            'it was told that it stands still, and it has shown another time since',
            f'{CLOCK}::test_a_clock_that_goes_back_or_stands_still_is_told',
        ),
        'not the only lathe on the topic': (
            'the graph has another publisher of ~/samples',
            f'{LATHE}::test_a_second_lathe_on_the_topic_is_named',
        ),
        'I am not the only one that publishes {}: {} do, and readers cannot tell them apart.': (
            'the same; told once for each that comes',
            f'{LATHE}::test_a_second_lathe_on_the_topic_is_named',
        ),
    },
    'lathe_diagnostics.py': {
        'behind: simulated time was given up': (
            'something was given up since the last report',
            f'{CLOCK}::test_a_jump_of_the_clock_is_told_and_not_cut',
        ),
        'flooded: requests take much of the time': (
            'more than a quarter of it since the last report, and in the second before',
            f'{LATHE}::test_a_flood_of_requests_is_told',
        ),
        'catching up': (
            'it runs, nothing was given up, and it is more than 0.1 s late',
            f'{STATISTICS}::test_the_verdict_on_the_pace_says_what_is_wrong_first',
        ),
        'keeping up': (
            'it runs at a factor, nothing was given up, and it is at most 0.1 s late',
            f'{STATISTICS}::test_the_verdict_on_the_pace_says_what_is_wrong_first',
        ),
        'as fast as possible': (
            'it runs, and the factor is 0',
            f'{STATISTICS}::test_the_verdict_on_the_pace_says_what_is_wrong_first',
        ),
        'at rest': (
            'no tick was made since the last report',
            f'{STATISTICS}::test_the_status_of_the_cut_claims_no_more_than_the_ticks_showed',
        ),
        'no depth of cut': (
            'depth_of_cut is 0',
            f'{STATISTICS}::test_the_status_of_the_cut_claims_no_more_than_the_ticks_showed',
        ),
        'out of the cut': (
            'ticks were made since the last report, and the tool was in the cut in none of them',
            f'{STATISTICS}::test_the_status_of_the_cut_claims_no_more_than_the_ticks_showed',
        ),
        'not tripped': (
            'the guard has not ended this run',
            f'{LATHE}::test_the_guard_ends_the_run_and_a_reset_begins_another',
        ),
    },
    'simulation_control.py': {
        'One tick.': (
            'it is paused',
            f'{CONTROL}::test_a_step_is_refused_while_running_and_leaves_a_pause_as_it_is',
        ),
        'At time zero again, {}.': (
            'the lathe is new, and as paused as it was',
            f'{CONTROL}::test_a_reset_keeps_the_pause_and_is_idempotent',
        ),
        '{} Only a reset helps.': (
            'the guard has ended the run',
            f'{CONTROL}::test_after_the_guard_only_a_reset_helps',
        ),
        'Already {}.': ('it was so before', f'{CONTROL}::test_pause_is_idempotent'),
        'Now {}.': ('it was not so before', f'{LATHE}::test_a_step_is_refused_while_it_runs'),
        'A step is possible only while paused.': (
            'it runs',
            f'{LATHE}::test_a_step_is_refused_while_it_runs',
        ),
    },
    'simulation_services.py': {
        'A lathe that is stopped cannot be paused, only played.': (
            'it is paused at time zero',
            f'{STANDARD}::test_states',
        ),
        'At most {} ticks in one request.': (
            'more were asked for; none is made',
            f'{STANDARD}::test_steps_only_while_paused_and_the_same_run_after_a_reset',
        ),
        'Time and state of a lathe are reset together.': (
            'one of them alone was to be reset',
            f'{STANDARD}::test_time_and_state_are_reset_together',
        ),
        'A lathe can be playing, paused or stopped.': (
            'another state was asked for',
            f'{STANDARD}::test_states',
        ),
    },
    'node_main.py': {
        (
            'There is no argument {}: a parameter is given as in `--ros-args -p name:=value`, '
            'and --help lists them.'
        ): (
            'the word is no ROS argument; the node does not start',
            f'{MAIN}::test_a_node_explains_itself_and_takes_no_word_that_it_does_not_know',
        ),
    },
    'command_line_parameters.py': {
        '-p {} reaches nobody: {} here.': (
            'no node of the process has that name; it does not start',
            f'{ARGUMENTS}::test_a_parameter_that_reaches_nobody_keeps_from_starting',
        ),
        'The file {} has parameters for {} and for nobody here: {}.': (
            'none of its sections matches the full name of a node of the process',
            f'{ARGUMENTS}::test_a_file_that_reaches_nobody_is_told_and_one_that_reaches_is_not',
        ),
        '{} and {} are': (
            'the nodes of the process, where they are several',
            f'{ARGUMENTS}::test_a_parameter_that_reaches_nobody_keeps_from_starting',
        ),
        '{} is': (
            'the node of the process, where it is one',
            f'{ARGUMENTS}::test_a_parameter_that_reaches_nobody_keeps_from_starting',
        ),
    },
    'parameter_node.py': {
        'Refused: {}': (
            'a set was not accepted, for the reason that its answer has; bounded in a flood',
            f'{LATHE}::test_a_refused_set_is_in_the_log',
        ),
        'At most {} parameters fit in one request, and these are {}.': (
            'a request names more; nothing of it is done',
            f'{HOSTILE}::test_a_request_of_absurd_size_is_refused_at_once',
        ),
        '{} can be given at the start only.': (
            'the parameter exists, and is no run-time one',
            f'{LATHE}::test_a_refused_set_has_a_reason_and_changes_nothing',
        ),
        '{} cannot be without a value.': (
            'the parameter was to be deleted, or its type is none that ROS knows',
            f'{LATHE}::test_a_parameter_cannot_be_deleted',
        ),
        'true or false': (
            'use_sim_time was given another value',
            f'{MAIN}::test_a_wrong_parameter_at_the_start_is_one_sentence_that_names_it',
        ),
    },
    'node_processes.py': {
        '{} ended with exit code {}: {}': (
            'the process has ended so, and this was its last line',
            f'{GROUP}::test_a_node_that_fails_is_named_with_its_last_words',
        ),
        '{} was ended by the signal {}.': (
            'the process has ended by that signal',
            f'{GROUP}::test_a_node_that_is_killed_is_named_with_the_signal',
        ),
        'it said nothing': (
            'the process has written no line',
            f'{GROUP}::test_a_node_that_fails_is_named_with_its_last_words',
        ),
        '{} did not end within {} s and was killed.': (
            'it was asked with SIGTERM so long ago',
            f'{GROUP}::test_a_node_that_does_not_end_is_killed_and_named',
        ),
    },
    'remote_parameters.py': {
        'The lathe does not say what machine it is: {}': (
            'a node answered as the lathe, and its parameters make no machine',
            f'{MONITOR}::test_the_machine_is_asked_from_the_lathe',
        ),
        'it has no parameter {}.': (
            'the answer lacks it',
            f'{MONITOR}::test_the_machine_is_asked_from_the_lathe',
        ),
    },
    'log_rate_limit.py': {
        ' ({} of this kind in {} s.)': (
            'so many sentences of the kind came in that time and were held back',
            (
                'nodes/test_log_rate_limit.py::'
                'test_a_flood_is_a_burst_and_then_one_line_a_period_that_counts_the_rest'
            ),
        ),
    },
    'real_time_loop.py': {
        'real time, priority {}': (
            'the thread is scheduled so',
            'nodes/test_scheduling.py::test_real_time_is_held_while_wanted_and_never_inherited',
        ),
    },
    'supervisor_limits.py': {
        'No move passes {}, {} {}, though the lathe has {} {}.': (
            'its cut, or the spindle of its machine file, is beyond that limit; told once',
            'nodes/test_supervisor.py::test_limits_that_do_not_suit_the_machine_are_told_once',
        ),
    },
    'qos_overrides.py': {
        'keep_last, for a node does not wait for its readers': (
            'a history that keeps all was asked for; the node does not start',
            f'{MAIN}::test_a_wrong_parameter_at_the_start_is_one_sentence_that_names_it',
        ),
    },
}
NO_SENTENCE = {
    # Kinds of the bounded log.
    'clock back', 'clock stands', 'clock awaited', 'clock ahead', 'clock goes on',
    'too many knocks',
    # Names of hardware and of the values in /diagnostics.
    'virtual lathe', 'real-time factor', 'real-time factor asked for', 'lag given up, s',
    'lag given up in the last second, s', 'step time p50, us', 'step time p99, us',
    'step time max, us', 'lateness p99, us', 'lateness max, us', 'behind the clock, s',
    'requests in the last second', 'time taken by requests, fraction', 'simulated time, s',
    'bearing contact', 'bearing engaged, fraction of ticks', 'tool in cut, fraction of ticks',
    'spindle speed, rev/min', 'spindle speed asked for, rev/min', 'depth of cut, m',
    'bearing clearance, m', 'time 0 on /clock, s',
}  # fmt: skip


def sentences(module: Path) -> Iterator[str]:
    """The texts with a space in a module, its docstrings aside; `{}` for what is filled in."""
    tree = ast.parse(module.read_text())
    aside: set[ast.AST] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            aside.add(node.value)
        if isinstance(node, ast.JoinedStr):
            aside.update(part for part in ast.walk(node) if part is not node)
    for node in ast.walk(tree):
        text = ''
        if isinstance(node, ast.JoinedStr):
            parts = node.values
            text = ''.join(str(p.value) if isinstance(p, ast.Constant) else '{}' for p in parts)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            text = node.value
        if node not in aside and ' ' in text.strip() and text not in NO_SENTENCE:
            yield text


@pytest.mark.parametrize('module', SAID)
def test_the_table_has_what_a_module_says_and_nothing_else(module: str) -> None:
    assert set(sentences(NODES / module)) == set(SAID[module])


@pytest.mark.parametrize('module', SAID)
def test_every_sentence_has_a_test_that_shows_when_it_is_true(module: str) -> None:
    for sentence, (holds, test) in SAID[module].items():
        assert holds, sentence
        file, _, name = test.partition('::')
        tree = ast.parse((TESTS / file).read_text())
        names = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        assert name in names, f'{sentence}: no {test}'
