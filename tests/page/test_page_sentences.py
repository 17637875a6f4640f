"""What the page says by itself in a browser, when it is true, and what test shows it.

What it passes on from nodes and from its server stands in their tables.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from support.page_texts import texts
from support.spoken import unshown

import lathe_chatter.page

STATIC = Path(lathe_chatter.page.__file__).parent / 'static'
PAGE, FIELDS = 'nodes/test_operator_page.py', 'nodes/test_page_fields_and_scenarios.py'
OTHERS, SILENT = 'nodes/test_page_and_others.py', 'nodes/test_page_when_nodes_are_silent.py'
READ, RECORDED = 'page/test_recorded_run.py', 'page/test_recorded_page.py'
CUTS = f'{PAGE}::test_it_shows_the_cut_and_asks_nothing_of_other_places'
CURED = f'{PAGE}::test_a_slider_provokes_chatter_and_the_recommended_speed_cures_it'
ENDED = f'{PAGE}::test_a_cut_that_has_ended_says_so_and_begins_anew'
CONTROLS = f'{PAGE}::test_pause_step_knock_and_recording'
TAKEN = f'{PAGE}::test_one_operates_and_another_may_take_over'
KILLED = f'{PAGE}::test_a_killed_lathe_is_told_and_is_back_by_itself'
BACK = f'{PAGE}::test_a_killed_page_is_told_and_is_back_by_itself'
STILL = f'{SILENT}::test_a_page_that_stands_still_is_told_and_then_blames_nobody'
BEGUN = f'{SILENT}::test_a_page_that_has_just_begun_calls_nobody_silent_and_plays_nothing'
ALONE = f'{SILENT}::test_a_page_without_a_lathe_waits_for_one'
UNHEARD = f'{SILENT}::test_without_a_monitor_no_figure_holds_though_the_cut_stands_still'
TYPED = f'{FIELDS}::test_what_is_no_number_changes_nothing_and_is_said'
PAUSED = f'{FIELDS}::test_a_reset_while_paused_leaves_nothing_of_the_cut_before'
GAP = f'{RECORDED}::test_it_claims_nothing_of_what_is_not_in_the_record'
UNREAD = f'{READ}::test_what_is_not_read_yet_is_said_to_be_so'
SCRUB = f'{READ}::test_a_browser_scrubs_through_the_run'
ASKED = f'{OTHERS}::test_the_supervisor_asks_in_the_page_and_is_answered_there'
SCENARIO = f'{OTHERS}::test_a_scenario_is_played_from_the_page_and_stopped'
ANOTHER = f'{OTHERS}::test_another_page_is_told_of'
MINE = 'of viewers of this address, by the newest word of a server that answers'

SAID = {
    'page.js': {
        'The server of this page does not answer.': (
            'the socket is not open, or a frame that was asked for is 3 s late',
            STILL,
        ),
        '{} What you see is old.': ('the latter, and nothing has come since', STILL),
        '{} What you see is old. Trying again ({}) ...': (
            'the socket was closed, for that reason if the server gave one; the next trial is due',
            BACK,
        ),
        'Not known while the server of this page does not answer.': (
            'that is so; of what is recorded',
            STILL,
        ),
        'The connection was lost before an answer came.': (
            'a new socket is opened, and what was asked in the one before had no answer',
            BEGUN,
        ),
        'The connection was lost: you are looking on.': (
            'the viewer operated in the socket before, and does not in this new one',
            BEGUN,
        ),
        'What you see is old.': (
            'the server does not answer, or no samples come of a lathe that goes on',
            KILLED,
        ),
        'No lathe has been found. The page waits for one.': ('its server finds none', ALONE),
        '{} is silent. What you see is old; the page goes on when it is back.': (
            'for 2.5 s no diagnostics of it came, nor samples, to a page that listened',
            KILLED,
        ),
        'No samples come from {}{}.': (
            'it speaks, is neither paused nor ended, and for 1 s and 2 ticks none came',
            f'{SILENT}::test_a_lathe_that_waits_for_a_clock_says_why_nothing_comes',
        ),
        'The monitor is silent: nothing is known of chatter.': (
            'for 2.5 s no diagnostics of it came to a page that listened',
            UNHEARD,
        ),
        'No recorder speaks.': (
            'the same of the recorder',
            f'{FIELDS}::test_a_killed_recorder_records_nothing',
        ),
        'No recorder has spoken.': (
            'none has, to a page that has listened for 2.5 s or less',
            ALONE,
        ),
        '{} Reset begins anew.': ('the lathe tells that its cut has ended, and why', ENDED),
        'The cut has ended.': ('the same, and the lathe speaks', ENDED),
        'CHATTER': (
            'the flag is up, of this run or time, in which a monitor speaks, and nothing is old',
            CURED,
        ),
        'no chatter': ('the same, the flag is down, and its state is not told', UNREAD),
        'since {} s': ('the same as of CHATTER, and this was told', CURED),
        'No speed is recommended': ('the monitor, if it speaks, has told none of late', KILLED),
        'Set {} rev/min': ('the monitor speaks and has told that of late', CURED),
        ', paused': ('the lathe tells that, and speaks', PAUSED),
        'Go on': ('the newest word of the lathe is that it is paused', UNHEARD),
        'Pause': ('it is not', CONTROLS),
        'Play': ('no scenario is played here, by the newest word of the server', BEGUN),
        'Stop': ('one is', SCENARIO),
        'Operate': (f'nobody operates: {MINE}', TAKEN),
        'Take over': (f'another operates: {MINE}', TAKEN),
        'Look on': (f'the viewer operates: {MINE}', TAKEN),
        'nobody operates': (MINE, TAKEN),
        'you operate': (MINE, STILL),
        '{} operates': (MINE, TAKEN),
        '{} {}, {}. You are {}{}.{}': (f'how many {MINE}', STILL),
        ', without the token: you may look, and not act': (
            'the server has one, and the viewer has not sent it',
            f'{OTHERS}::test_the_page_says_who_has_no_token',
        ),
        ' Another operator page serves this ROS domain too, or did so until just now: who '
        'operates there is not known here.': (
            'the graph has another node of that name, perhaps one that was killed of late',
            ANOTHER,
        ),
        'The supervisor asks. {}': ('its newest word is an offer that still stands', ASKED),
        'press Accept': ('the same', ASKED),
        'This page began at {} and lists the newest: what is older is in the record, where one '
        'was kept.': ('what was said is there, 80 sentences of this lathe at most', BACK),
        '{}: {} \u00d7 real time, late by {} ms (p99), {} s given up. Lost: {}.': (
            'the lathe told that of its last second; samples come, or the cut is paused',
            CUTS,
        ),
        ' Lost: {}.': ('these told so, and nothing is known of the pace', KILLED),
        '{} by {}': ('so many samples did not come to it, as it told', KILLED),
        '. {} messages went into {}.': ('the recorder speaks, and told that', CONTROLS),
        'The chart is being computed ...': ('it is, and none was before', CUTS),
        ' The chart is being computed anew ...': ('it is, of another cut or machine', CURED),
        'The cut: {} rev/min, {} mm. Limits there: {}, below which every depth is stable to '
        'small disturbances; open {}{}.{}': (
            'the spindle turned so fast in the last 0.1 s, of a cut that deep; the chart says so',
            CUTS,
        ),
        ', on its bearing {}': ('the same, of a lathe whose workpiece can touch it', CUTS),
        'Stability chart. {}': ('the same', CUTS),
        '"{}" is not a number': ('that was typed; nothing is sent', TYPED),
        'The field was empty': ('the same', TYPED),
        '{}: nothing was changed.': ('the same', TYPED),
        '{} may be {} or {}: write one of them. Nothing was changed.': ('the same', TYPED),
        '. Nothing was changed.': (
            'the value is outside what the lathe takes, and it was not set',
            f'{PAGE}::test_a_refusal_is_read_and_the_control_goes_back',
        ),
        '{} mN s: from here -1000 to 1000 mN s are allowed. Nothing was hit.': (
            'more was typed; nothing is sent',
            CONTROLS,
        ),
        'Knock: {}': ('of a knock that was not sent', CONTROLS),
    },
    'draw.js': {
        'Nothing has come to be shown here.': ('the plot is empty', GAP),
        'Phase portrait of the {}: {} to {} µm{}': ('what is drawn', GAP),
        ', {} turns': ('the same, and a point is drawn for each', CUTS),
        'Spectrum of the tool: largest {} µm at {} Hz{}': ('what is drawn', GAP),
        ', chatter at {} Hz': ('as CHATTER, with the frequency told of late', CURED),
        '{} {}: tool {}, workpiece {} {}': ('what is drawn, or was 2 s ago', SCRUB),
        'every smaller depth is stable': ('of the chart: the depth, in any contact', CUTS),
        'limit, open': ('of the chart', CUTS),
        'limit, on its bearing': ('of the chart', CUTS),
        'here the force closes the clearance': ('of the chart', CUTS),
        'stable with 95 %': ('of the chart of a machine that is known with errors', CUTS),
    },
    'recorded.js': {
        'Chart, lamp and what happened come when all is read.': ('not all is read', UNREAD),
        'Recorded run {}': ('it is that which the server reads', SCRUB),
    },
    'index.html': {
        'Back to the cut before the scenario': (
            'a scenario has set another, and that of before is known',
            f'{FIELDS}::test_what_was_set_before_a_scenario_can_be_had_back',
        ),
        'no word yet': ('nothing has come', CUTS),
        'No speed is recommended': ('the same', CUTS),
        'Dotted: the turns of the spindle and their multiples. Line: chatter, while it is '
        'flagged.': ('what is drawn; no line where the lamp is not lit', UNHEARD),
        'A snapshot is of a recorder that keeps the last seconds in memory (its parameter': (
            'it refuses of another',
            CONTROLS,
        ),
        '), not of one that writes all.': ('the same', CONTROLS),
    },
}
STATES = {
    'page.js': {
        'unknown': 'the lamp where neither CHATTER nor a state holds',
        'reading': 'the same, of a record that is not read to its end',
        'none': 'the chart has no limit at that speed',
        'nothing': 'nobody told of a loss',
    },
    'recorded.js': {'about ': 'before all is read a time is not exact', 'all': 'the whole run'},
    'draw.js': {'unknown': 'there is no value in what is drawn'},
}
"""Words that are read like an id in the source."""
NO_SENTENCE = {
    # Keys, selectors, styles.
    'Enter', 'False', 'True', 'use strict', '[data-call=pause], [data-call=resume]', 'lamp {}',
    'flag since, s', 'lag given up, s', 'lateness p99, us', 'real-time factor', 'samples lost',
    'standard error of the growth rate, 1/s', 'standard error of the margin', '~/accept does it',
    ': press Accept', '{} content-box', '(prefers-color-scheme: dark)', '12px system-ui',
    '{}px system-ui', 'gap both_sides', 'none gap both_sides', 'none seated gap both_sides',
    'seated gap both_sides',
    # Numbers, their units, and names of axes.
    'Hz', 'N/√Hz', 'g mm', '{} Hz', '{} mm', '{} rev/min', '{} s', '{} s{}', '{} s: {}', '{}{} s',
    '{}{} /s', '{} µm', '{} / µm', 'frequency / Hz', 'amplitude / µm', 'depth of cut / mm',
    'simulated time / s', 'spindle speed / (rev/min)', 'velocity / (mm/s)', 'from {} to {} s',
    '{} to {}', '{} from {} to {} {}', '{} {}: it {} {}', '{}, slider',
    'the monitor', 'the recorder', 'this page',
}  # fmt: skip
HEADINGS = {
    'Accept', 'Controls', 'Cut', 'Displacement', 'Given at the start', 'Knock', 'Knock / (mN s)',
    'Lathe', 'Mode', 'More parameters', 'Operate', 'Pause', 'Phase portraits and spectrum',
    'Phase portraits, with once-per-turn points', 'Play', 'Recorded run', 'Recording', 'Reset',
    'Run', 'Scenario', 'Shown', 'Signals', 'Skip to the controls', 'Snapshot', 'Split',
    'Spectrum of the tool', 'Stability chart', 'Start', 'Step', 'Stop', 'Supervisor', 'Time / s',
    'Velocity', 'What happened', 'What the monitor says', 'growth rate', 'margin in this contact',
}  # fmt: skip
"""Names of parts and of what buttons do, which claim nothing."""


def reads_as_said(text: str) -> bool:
    return bool(re.search('[A-Za-z]', text)) and (' ' in text.strip() or text[:1].isupper())


@pytest.mark.parametrize('file', SAID)
def test_the_table_has_what_a_file_says_and_nothing_else(file: str) -> None:
    found = texts(STATIC / file)
    assert set(STATES.get(file, ())) <= found
    aside = HEADINGS if file == 'index.html' else NO_SENTENCE
    assert {text for text in found if reads_as_said(text)} - aside == set(SAID[file])


@pytest.mark.parametrize('file', SAID)
def test_every_sentence_has_a_test_that_shows_when_it_is_true(file: str) -> None:
    assert not unshown(SAID, file)


def test_no_file_speaks_past_the_table() -> None:
    ours = {file.name for file in STATIC.iterdir() if file.suffix in {'.js', '.html'}}
    assert ours - {'uPlot.iife.min.js'} == set(SAID)
