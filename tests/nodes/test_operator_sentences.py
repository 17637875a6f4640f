"""What is said to one person, at a page or a terminal, when it is true, and what test shows it.

As `test_sentences.py` has it for the sentences that all can hear.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from support.spoken import sentences, unshown

import lathe_chatter.nodes

NODES = Path(lathe_chatter.nodes.__file__).parent
CELL, CLIENTS = 'nodes/test_operator_page_cell.py', 'nodes/test_operator_page_clients.py'
PAGE, RUN = 'nodes/test_operator_page_node.py', 'nodes/test_run_scenario.py'
OPERATOR, VERB = 'nodes/test_operator_node.py', 'cli/test_run.py'
DID = f'{CELL}::test_a_scenario_says_what_it_did_and_what_it_waits_for'
WAITS = f'{CELL}::test_a_scenario_waits_for_monitor_and_supervisor'
ANEW = f'{CELL}::test_a_lathe_that_begins_anew_ends_a_scenario'
BACK = f'{CELL}::test_the_cut_of_before_is_set_once_and_only_where_there_is_one'
ANOTHER = f'{CELL}::test_a_scenario_after_another_begins_at_its_own_time'
KNOCK = f'{CELL}::test_a_knock_is_said_to_be_sent_and_refused_where_nothing_can_be_hit'
KNOWN = f'{CLIENTS}::test_parameters_are_set_where_they_are_known_and_of_those_that_have_some'
LATHES = f'{PAGE}::test_it_shows_the_lathes_there_are_and_their_changes_in_words'
NAMED = f'{RUN}::test_a_parameter_that_nobody_has_is_named_with_its_scenario'
SERVED = f'{RUN}::test_a_page_is_said_to_be_there_once_it_is_and_comes_back'
TOLD = f'{OPERATOR}::test_what_it_asks_and_hears_is_told_with_its_time'

SAID = {
    'operator_page_cell.py': {
        'when chatter is flagged': ('the next step waits for the flag to rise', WAITS),
        'when the flag is cleared': ('the next step waits for the flag to fall', WAITS),
        'when the supervisor asks': ('the next step waits for an offer', WAITS),
        'The cut has ended: nothing was hit.': (
            'the lathe has said that its guard has ended the cut, and of no reset since',
            KNOCK,
        ),
        'A knock of {} mN s was sent.': (
            'the lathe has spoken of late and listens to knocks; its log says whether it was hit',
            KNOCK,
        ),
        'is stopped': ('somebody at a page has stopped it', ANOTHER),
        'is stopped, for the lathe has begun anew': (
            'the lathe was reset, or another has come, amid the scenario',
            ANEW,
        ),
        'is stopped, for another is to begin': (
            'the cut of another scenario is set, and the lathe is about to be reset for it',
            ANOTHER,
        ),
        'is stopped: {}': (
            'lathe or supervisor has refused a step, for that reason, or not answered',
            f'{CELL}::test_a_step_that_is_refused_was_not_made',
        ),
        'is over': ('every step was made, and its time has passed', DID),
        '{} {}. Its cut and its noise were left so.': (
            'it has ended, and nothing was set for that',
            DID,
        ),
        'The scenario {} is for a lathe that was started with {} {}; this one has {}.': (
            'that parameter can be given at the start only, and the lathe has another value',
            f'{CELL}::test_a_scenario_for_another_machine_is_refused',
        ),
        (
            'The scenario {} needs a chatter_supervisor, and none is here: '
            'lathe-chatter run --page --supervise ask starts one.'
        ): ('none has spoken for some seconds; nothing was set', WAITS),
        'has begun': ('its cut is set, and the lathe was reset and goes on', DID),
        '{} has begun.': ('the same', DID),
        '{} is being played: stop it first.': (
            'the cut of before was wanted amid a scenario',
            ANOTHER,
        ),
        'There is no cut of before a scenario to go back to.': (
            'none was played from this page, or the cut was set back since',
            BACK,
        ),
        'The cut was set as before the scenario.': ('the lathe has taken it', BACK),
        'a step was made': ('lathe or supervisor has taken it, and it has no reason', WAITS),
        'it ends at {} s': ('no step is left, and that is its duration', DID),
        'at {} s': ('the next step has that simulated time', DID),
        ', {} s later': ('the next step waits so long after that', WAITS),
        'next, {}{}: {}': ('a step is left', DID),
        '{}: {}; {}.': ('the scenario is being played: what was done last, what comes next', DID),
    },
    'operator_page_clients.py': {
        'Nothing of {} can be set from here.': ('it is neither lathe nor supervisor', KNOWN),
        'The parameters of {} are not known yet.': (
            'it is there, and has not told them since it came or began anew',
            KNOWN,
        ),
        '{} is not there.': (
            'the graph has no such service of it; or no listener to knocks, or it is silent',
            f'{CLIENTS}::test_who_is_not_there_is_named',
        ),
        '{} did not answer within {} s.': (
            'it was asked so long ago; what it does with it later is not known',
            f'{CLIENTS}::test_who_does_not_answer_is_named',
        ),
    },
    'operator_page_node.py': {
        'The page is at {}': (
            'its socket listens there',
            f'{PAGE}::test_the_page_is_where_it_says',
        ),
        'The page is at {}\n': ('the same', f'{PAGE}::test_the_page_is_where_it_says'),
        'not shown': (
            'a token was given: it stands for it in the parameters',
            f'{PAGE}::test_the_token_is_told_to_nobody',
        ),
        '{} → {}': ('a parameter before and after a change of the lathe', LATHES),
        'At {} s: {}.': ('the lathe has logged that change, with that simulated time', LATHES),
        'There is no lathe {}.': (
            'the graph had no topic of its samples a second ago, and nobody looks at it',
            LATHES,
        ),
        'Choose a lathe first.': ('the viewer looks at none', LATHES),
        '{}. It takes {} s: the lathe begins anew, with its cut.': (
            'its title and its duration; where a step waits for longer, it takes longer',
            f'{PAGE}::test_a_scenario_is_described_as_it_is',
        ),
    },
    'operator_node.py': {
        '{} s  supervisor: {}': ('a supervisor has said that at this simulated time', TOLD),
        '{} s  {}': (
            'the monitor has flagged or cleared; or the step is due, and is asked for',
            TOLD,
        ),
        'The supervisor refused: {}': (
            'it has answered so to an acceptance',
            f'{OPERATOR}::test_a_supervisor_that_refuses_is_quoted',
        ),
        'The lathe refused {}: {}': (
            'it has answered so to that step, which it has not made',
            f'{OPERATOR}::test_who_refuses_a_step_is_named_with_the_reason',
        ),
    },
    'run_scenario.py': {
        'The scenario {}: {}': ('no lathe or no supervisor has a parameter of that name', NAMED),
        'Another program may have the ROS domain 0: this one takes {}.': (
            'the port is taken by which programs on one machine share out domains',
            f'{VERB}::test_two_runs_at_once_get_along_even_with_sigint_ignored',
        ),
        'Starting the monitor and the recorder ...': (
            'they are being started, and the lathe is not yet',
            f'{RUN}::test_it_says_what_it_waits_for_and_then_what_the_monitor_says',
        ),
        ('Another {} is in this ROS domain: end it, or set ROS_DOMAIN_ID to another number.'): (
            'the graph has more nodes of that name than this run has started',
            f'{VERB}::test_a_lathe_that_is_there_already_is_left_alone',
        ),
        '{} did not appear within {} s.': (
            'these were started, and the graph has not had them at the last look',
            f'{RUN}::test_who_does_not_come_is_named',
        ),
        'waiting for the lathe': (
            'no sample has come yet',
            f'{RUN}::test_it_says_what_it_waits_for_and_then_what_the_monitor_says',
        ),
        'No sample of the lathe came within {} s.': (
            'it was started so long ago, and the operator has heard none',
            f'{RUN}::test_who_does_not_come_is_named',
        ),
        'Starting the page ...': ('nobody answers on its port yet', SERVED),
        'The page is at {} until Ctrl-C ...': ('it has answered, and its process runs', SERVED),
        'The page is at {} until Ctrl-C.': ('it has just answered', SERVED),
        '{} It is started again.': ('its process had served it, and has ended so', SERVED),
    },
}
NO_SENTENCE = {'must be one of '}
"""What descriptors of parameters begin with, where they name what is allowed."""


@pytest.mark.parametrize('module', SAID)
def test_the_table_has_what_a_module_says_and_nothing_else(module: str) -> None:
    assert set(sentences(NODES / module, NO_SENTENCE)) == set(SAID[module])


@pytest.mark.parametrize('module', SAID)
def test_every_sentence_has_a_test_that_shows_when_it_is_true(module: str) -> None:
    assert not unshown(SAID, module)
