"""What the nodes can say, what must be true when they do, and the test that shows it.

A sentence that is not in the table fails here, and so does one that nobody says any more.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from support.spoken import TESTS, sentences, unshown

import lathe_chatter.nodes

NODES = Path(lathe_chatter.nodes.__file__).parent
LATHE, CLOCK = 'nodes/test_lathe_node.py', 'nodes/test_followed_clock.py'
CONTROL, STANDARD = 'nodes/test_simulation_control.py', 'nodes/test_simulation_services.py'
ARGUMENTS = 'nodes/test_command_line_parameters.py'
MAIN, MONITOR = 'nodes/test_node_main.py', 'nodes/test_monitor_node.py'
HOSTILE = 'nodes/test_hostile_client.py'
RECORD, LOSSES = 'nodes/test_lathe_log_and_record.py', 'nodes/test_recorder_diagnostics.py'
REQUESTS, RECORDER = 'nodes/test_recorder_sentences.py', 'nodes/test_recorder_node.py'
TOPICS, MACHINE = 'nodes/test_recorded_topics.py', 'nodes/test_machine_of_a_node.py'
RESTART, SUPERVISOR = 'nodes/test_restart.py', 'nodes/test_supervisor.py'
MONITOR_SENTENCES = 'nodes/test_monitor_sentences.py'
OPERATORS = 'nodes/test_operator_sentences.py'
TABLES = 'nodes/test_parameter_tables.py'
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
    'lathe_log_and_record.py': {
        'At {} s: from here on simulated time is to go {}.': (
            'real_time_factor was set; it holds from this simulated time on',
            f'{LATHE}::test_the_pace_can_change_from_free_to_timed_and_back',
        ),
        '{} times as fast as the clock': (
            'that factor was set, and is not 0',
            f'{LATHE}::test_the_pace_can_change_from_free_to_timed_and_back',
        ),
        'as fast as it can': (
            'the factor 0 was set',
            f'{LATHE}::test_the_pace_can_change_from_free_to_timed_and_back',
        ),
        'The lathe goes on without its record. {}': (
            'the disk took no more of its own record, which has ended; the cut goes on',
            f'{RECORD}::test_the_lathe_cuts_on_where_its_record_cannot',
        ),
        '{}: {}.': (
            'the same: its folder, and the reason',
            f'{RECORD}::test_the_lathe_cuts_on_where_its_record_cannot',
        ),
        'record: the run {} cannot be made: {}.': (
            'the folder cannot be made, for that reason; the node does not start',
            f'{RECORD}::test_a_record_that_cannot_be_made_is_refused_with_its_parameter',
        ),
    },
    'lathe_topics.py': {
        'Time 0 of the samples is {} s of /clock.': (
            'under use_sim_time: their offset from the stamps is new',
            f'{CLOCK}::test_where_the_samples_are_on_the_clock_is_told_at_each_jump',
        ),
    },
    'entry_points.py': {
        'ROS 2 is not there ({}): source an installation{}.': (
            'a package of it cannot be imported; the node does not start',
            'test_circumstances.py::test_a_missing_ros_is_said_before_anything_is_compiled',
        ),
        ', or use `make run`, which installs what it needs': (
            'the same, in a checkout',
            'test_circumstances.py::test_a_missing_ros_is_said_before_anything_is_compiled',
        ),
    },
    'log_folder.py': {
        'The logs of ROS 2 go to {}: {} cannot be written ({}).': (
            'the folder that ROS 2 would take cannot be written, for that reason',
            'nodes/test_log_folder.py::test_one_that_cannot_is_replaced_and_named',
        ),
    },
    'polled_subscription.py': {
        '{} and {} publish {}, not one lathe': (
            'the graph has these publishers of the topic',
            f'{LOSSES}::test_two_lathes_on_one_topic_are_named_and_nothing_of_them_counts_as_lost',
        ),
        'a node of unknown name': (
            'the graph has its publisher, and does not have its node yet or any more',
            (
                'nodes/test_polled_subscription.py::'
                'test_a_publisher_has_the_name_of_its_node_or_is_said_to_be_unknown'
            ),
        ),
    },
    'recorder_node.py': {
        'Nothing is being recorded.': (
            'neither a run nor a memory is being written',
            f'{REQUESTS}::test_each_request_is_answered_by_what_is_so',
        ),
        '{} holds {} messages, and {} were lost on the way.': (
            'the run is finished and on disk; their numbers tell of the losses',
            f'{REQUESTS}::test_each_request_is_answered_by_what_is_so',
        ),
        'into {}': (
            'a run is being written from now on',
            f'{REQUESTS}::test_each_request_is_answered_by_what_is_so',
        ),
        'the last {} s in memory': (
            'snapshot is above 0, and it keeps so long from now on',
            f'{REQUESTS}::test_a_black_box_says_what_it_keeps',
        ),
        'Recording {}.': (
            'it has just begun',
            f'{REQUESTS}::test_each_request_is_answered_by_what_is_so',
        ),
        'Nothing is kept in memory: the parameter snapshot says how long to keep it.': (
            'a snapshot was asked for, and snapshot is 0 or it was not started',
            f'{REQUESTS}::test_each_request_is_answered_by_what_is_so',
        ),
        'What comes is left out.': (
            'it was asked to pause, and had not been',
            f'{REQUESTS}::test_each_request_is_answered_by_what_is_so',
        ),
        'Recording goes on.': (
            'it was asked to go on, and had been paused',
            f'{REQUESTS}::test_each_request_is_answered_by_what_is_so',
        ),
        'It is so already.': (
            'a pause or its end was asked for that is in force',
            f'{REQUESTS}::test_each_request_is_answered_by_what_is_so',
        ),
        'Already recording into {}.': (
            'a start was asked for amid that run',
            f'{REQUESTS}::test_each_request_is_answered_by_what_is_so',
        ),
        'Already keeping the last in memory.': (
            'a start was asked for of a black box that was started',
            f'{REQUESTS}::test_a_black_box_says_what_it_keeps',
        ),
        'Going on in a new file.': (
            'the run has a new file from now on',
            f'{REQUESTS}::test_each_request_is_answered_by_what_is_so',
        ),
        '{} holds the last {} messages.': (
            'what was in memory is that run now, on disk',
            f'{REQUESTS}::test_a_black_box_says_what_it_keeps',
        ),
        'What was in memory is dropped.': (
            'a black box was stopped',
            f'{REQUESTS}::test_a_black_box_says_what_it_keeps',
        ),
        'Chatter was flagged.': (
            'a monitor has raised its flag: the reason that its snapshot has',
            (
                f'{TOPICS}::test_a_snapshot_has_the_last_seconds_when_it_is_'
                'asked_for_and_when_chatter_is_flagged'
            ),
        ),
        'Noted: {}': (
            "the system's clock has gone another way than the steady one, by so much",
            f'{REQUESTS}::test_a_step_of_the_clock_is_noted',
        ),
        '{} is not attached to the run: {}.': (
            'the file cannot be read, for that reason',
            f'{REQUESTS}::test_what_cannot_be_kept_or_looked_for_is_named',
        ),
        'The end of {} is not on disk: {}': (
            'the last commit has failed, for that reason; the node ends with 1',
            f'{RECORDER}::test_an_end_that_is_not_on_disk_is_exit_1',
        ),
        '{}: {}.': (
            'the disk took no more, for that reason; the recording has ended',
            f'{RECORDER}::test_a_full_disk_ends_it_with_a_sentence_and_exit_1',
        ),
    },
    'recorder_services.py': {
        'Keeping the last in memory.': (
            'a black box was started',
            f'{REQUESTS}::test_a_black_box_says_what_it_keeps',
        ),
        'Recording into {}.': (
            'a run was begun',
            f'{REQUESTS}::test_each_request_is_answered_by_what_is_so',
        ),
        'It was asked for.': (
            'the reason that a snapshot has of a request',
            (
                f'{TOPICS}::test_a_snapshot_has_the_last_seconds_when_it_is_'
                'asked_for_and_when_chatter_is_flagged'
            ),
        ),
    },
    'recorder_topic_selection.py': {
        '{} must be a regular expression, and {} is none: {}.': (
            'topics_like or exclude is none; nothing is recorded',
            f'{REQUESTS}::test_what_cannot_be_kept_or_looked_for_is_named',
        ),
        'Nobody publishes {} so far: nothing of it is recorded.': (
            'topics names it beside the default ones, and nobody has for some seconds; told once',
            f'{LOSSES}::test_a_topic_that_was_asked_for_and_that_nobody_publishes_is_told',
        ),
        '{} is now of type {}, and recorded as such.': (
            'its publishers are of another type than before',
            f'{TOPICS}::test_a_type_that_changes_goes_on_as_another_channel',
        ),
        '{} is not recorded: {}.': (
            'its type is not installed',
            f'{TOPICS}::test_a_topic_whose_package_is_not_installed_costs_only_itself',
        ),
        '{} is not recorded: {}': (
            'the middleware gives no subscription to it, for that reason',
            f'{TOPICS}::test_a_topic_whose_package_is_not_installed_costs_only_itself',
        ),
    },
    'recorder_diagnostics.py': {
        'keeping the last in memory': (
            'a black box was started, and is not paused or stopped',
            f'{REQUESTS}::test_a_black_box_says_what_it_keeps',
        ),
        'not recording': (
            'nothing is being recorded, on disk or in memory',
            f'{REQUESTS}::test_each_request_is_answered_by_what_is_so',
        ),
        '{}: their samples are mixed, and whether any are missing is not known': (
            'samples went on where they had been left for others',
            f'{LOSSES}::test_two_lathes_on_one_topic_are_named_and_nothing_of_them_counts_as_lost',
        ),
        'several publish {}': (
            'the same, and the graph no longer says who',
            f'{LOSSES}::test_two_lathes_on_one_topic_are_named_and_nothing_of_them_counts_as_lost',
        ),
        'nobody publishes {}': (
            'topics names it beside the default ones, and nobody has so far',
            f'{LOSSES}::test_a_topic_that_was_asked_for_and_that_nobody_publishes_is_told',
        ),
        'is recorded from {} s on': (
            'the first block of samples has that time',
            f'{RESTART}::test_a_killed_recorder_leaves_a_run_and_the_next_says_what_it_missed',
        ),
        '{}, after the lathe started again at {} s': (
            'times went back, and nothing went on where it had been left',
            f'{LOSSES}::test_a_lathe_that_begins_again_without_end_is_a_few_lines',
        ),
        '{}, without the {} samples before': (
            'the first time is so many steps from 0',
            f'{RESTART}::test_a_killed_recorder_leaves_a_run_and_the_next_says_what_it_missed',
        ),
        '{} {}.': (
            'a topic, and where its samples begin',
            f'{LOSSES}::test_a_lathe_that_begins_again_without_end_is_a_few_lines',
        ),
        '{}: {} samples {} did not come.': (
            'times leave so many out since this was told last',
            f'{RECORDER}::test_what_the_recorder_says_last_is_in_the_record',
        ),
        'between {} s and {} s': (
            'these are the simulated times around what is missing',
            f'{RECORDER}::test_what_the_recorder_says_last_is_in_the_record',
        ),
        'messages were lost: {}': (
            'the numbers that a publisher gives its messages leave some out',
            f'{REQUESTS}::test_what_is_lost_or_no_block_of_samples_is_told',
        ),
        '{} of {}': (
            'so many of that topic',
            f'{REQUESTS}::test_what_is_lost_or_no_block_of_samples_is_told',
        ),
        '{} samples of {} are missing': (
            'times leave so many out in this run',
            f'{RECORDER}::test_a_gap_in_the_samples_is_told_by_their_own_times',
        ),
        '{}: {}': (
            'a message of that topic is no block of samples, or its times are no numbers',
            f'{REQUESTS}::test_what_is_lost_or_no_block_of_samples_is_told',
        ),
        'no samples of {} come': (
            'some had, none has for a second, and it is not paused',
            f'{LOSSES}::test_a_silence_shows_while_it_lasts_and_a_loss_is_a_warning',
        ),
    },
    'run_folders.py': {
        'The run {} cannot be made: {}.': (
            'the folder cannot be made, for that reason',
            f'{REQUESTS}::test_what_cannot_be_kept_or_looked_for_is_named',
        ),
    },
    'shared_memory.py': {
        '{} was left {} by a process that was killed': (
            'nobody has it, and it is not ready',
            'nodes/test_shared_memory.py::test_a_half_made_port_is_removed',
        ),
        '{}; it is removed, for a node would have waited on it.': (
            'it is gone',
            'nodes/test_shared_memory.py::test_a_half_made_port_is_removed',
        ),
        '{}, and a node may wait on it for ever; to remove it: {}.': (
            "it is another user's and stays",
            'nodes/test_shared_memory.py::test_what_another_user_left_is_named_and_stays',
        ),
    },
    'topic_types.py': {
        'the package of its type {} is not installed here': (
            'its module cannot be imported',
            f'{TOPICS}::test_a_topic_whose_package_is_not_installed_costs_only_itself',
        ),
        'its type {} is not in the package installed here': (
            'the module has no such type',
            f'{REQUESTS}::test_a_type_of_another_release_is_named',
        ),
    },
    'supervisor_node.py': {
        'From now on: {}.': (
            'these parameters were set',
            f'{SUPERVISOR}::test_what_it_says_of_itself_is_so',
        ),
        'nothing was done yet': (
            'it has said nothing since it was started',
            f'{SUPERVISOR}::test_what_it_says_of_itself_is_so',
        ),
        'The lathe is not known yet.': (
            'something was to be accepted, and the lathe has not told its parameters',
            f'{SUPERVISOR}::test_what_it_says_of_itself_is_so',
        ),
        'nothing can be done: {}': (
            'one of the reasons below holds',
            f'{SUPERVISOR}::test_what_it_says_of_itself_is_so',
        ),
        'the lathe does not answer': (
            'it asked the lathe for a change, and had no answer for 2 s',
            f'{SUPERVISOR}::test_a_lathe_that_does_not_answer_is_told',
        ),
        '{} does not say what it is: {}': (
            'a node of that name has told its parameters, and they make no machine',
            f'{SUPERVISOR}::test_a_lathe_that_is_none_is_told',
        ),
        'nothing comes from the monitor': (
            'no message of it for a second in which the node has listened',
            f'{SUPERVISOR}::test_a_silent_monitor_keeps_it_from_acting',
        ),
        'this node stood still, and does not hear the monitor yet': (
            'it was stopped, or busy, and since then nothing of the monitor has come, or no more',
            f'{SUPERVISOR}::test_a_supervisor_that_stood_still_blames_nobody',
        ),
        'the monitor does not know the state of the cut': (
            'the latest state is unknown',
            f'{SUPERVISOR}::test_what_it_says_of_itself_is_so',
        ),
        'samples were lost': (
            'the monitor has counted more lost ones within the last seconds',
            f'{SUPERVISOR}::test_what_it_says_of_itself_is_so',
        ),
        'it is not known yet who else is there': (
            'the node has begun less than 3.5 s ago, in which DDS says again what got lost',
            f'{SUPERVISOR}::test_what_it_says_of_itself_is_so',
        ),
        'there is another supervisor': (
            'the graph has another publisher of its actions',
            f'{SUPERVISOR}::test_of_two_supervisors_none_acts',
        ),
        'the lathe cannot be reached': (
            'the service that sets its parameters is not in the graph',
            f'{SUPERVISOR}::test_what_it_says_of_itself_is_so',
        ),
        'the spindle has no speed from slowest_speed to fastest_speed': (
            'the range of its machine file and that of the parameters have nothing in common',
            f'{MACHINE}::test_nobody_recommends_or_goes_to_a_speed_that_the_spindle_has_not',
        ),
        'the lathe refused: {}': (
            'it has answered so to a change or a stop',
            f'{SUPERVISOR}::test_a_lathe_that_refuses_is_told',
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
    'bearing clearance, m', 'time 0 on /clock, s', 'own record', 'time zero', 'run recorder',
    'longest stall, s', '{}: samples', '{}: samples before the first', '{}: samples lost',
    '{}: silences', '{}: restarts of the lathe', 'clock step', '{} begins', '{} lost',
    'chatter supervisor', 'moves against the present chatter', 'newest sentence', 'samples lost',
    'restarts of the lathe', 'works with', 'C w, N/m',
}  # fmt: skip

WALKED_ELSEWHERE = {
    'monitor_node.py': MONITOR_SENTENCES,
    'monitor_sentences.py': MONITOR_SENTENCES,
    # What is said to one person, who looks at a page or a terminal.
    'operator_page_cell.py': OPERATORS,
    'operator_page_clients.py': OPERATORS,
    'operator_page_node.py': OPERATORS,
    'operator_node.py': OPERATORS,
    'run_scenario.py': OPERATORS,
    # What stands in tables and helps.
    'composition.py': MAIN,
    'diagnostics.py': STATISTICS,
    'parameter_descriptor.py': TABLES,
    'parameter_tables.py': TABLES,
    'recorder_parameters.py': TABLES,
}
"""Modules whose words are in no table here, and where they are met."""


@pytest.mark.parametrize('module', SAID)
def test_the_table_has_what_a_module_says_and_nothing_else(module: str) -> None:
    assert set(sentences(NODES / module, NO_SENTENCE)) == set(SAID[module])


def test_no_module_speaks_past_the_tables() -> None:
    speak = {module.name for module in NODES.glob('*.py') if [*sentences(module, NO_SENTENCE)]}
    assert speak == {*SAID, *WALKED_ELSEWHERE}
    assert not {*SAID} & {*WALKED_ELSEWHERE}
    assert all((TESTS / file).exists() for file in WALKED_ELSEWHERE.values())


@pytest.mark.parametrize('module', SAID)
def test_every_sentence_has_a_test_that_shows_when_it_is_true(module: str) -> None:
    assert not unshown(SAID, module)
