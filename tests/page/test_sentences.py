"""What the server of a page and a recorded run say, when it is true, and what test shows it."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.spoken import sentences, unshown

import lathe_chatter.page

HERE = Path(lathe_chatter.page.__file__).parent
SERVER, RECORDED = 'page/test_server.py', 'page/test_recorded_run.py'
REFUSED = f'{SERVER}::test_a_page_that_cannot_be_served_says_why'
ONE = f'{SERVER}::test_one_at_a_time_operates'
SENSE = f'{SERVER}::test_what_makes_no_sense_is_answered_and_so_is_too_much'
AWAY = f'{SERVER}::test_who_floods_or_talks_nonsense_is_sent_away_with_the_reason'
TOKEN = f'{SERVER}::test_whoever_has_the_token_acts_in_whatever_letters'
READ = f'{RECORDED}::test_how_far_it_is_read_is_said_as_it_is'
UNREAD = f'{RECORDED}::test_what_cannot_be_read_is_said'

SAID = {
    'server.py': {
        'token has {} characters: it must have {} or more.': (
            'one was given, and it has fewer; nothing is served',
            REFUSED,
        ),
        (
            'host {} may let other machines in: give a token of {} characters or more, '
            'which those who act will need.'
        ): (
            'it is not this machine by its number or as localhost, and no token is given',
            REFUSED,
        ),
        'port {} of {} cannot be had: {}.': ('the system refuses it, for that reason', REFUSED),
        '{} viewers are here already.': (
            'so many are connected, and no more are let in',
            f'{SERVER}::test_more_viewers_than_there_is_room_for_are_told',
        ),
        '{} (viewer {})': ('the address, and the how manieth has come to this page', ONE),
        'Too many bad messages.': ('ten of the viewer made no sense; it is sent away', AWAY),
        'Too many messages.': ('more came than a page sends; the viewer is sent away', AWAY),
        'A message made no sense.': ('it is no JSON, or names nothing to do', SENSE),
        'Too much at once: wait for the answers.': (
            'eight requests of the viewer are open; this one is not done',
            SENSE,
        ),
        'The request {} makes no sense.': (
            'there is none of that name, or it lacks a value, or one is of another kind',
            SENSE,
        ),
        'That is not the token.': ('there is one, and another was sent', TOKEN),
        '{} operates already.': ('that viewer does, and it was not to be taken over', ONE),
        '{} has taken over: you are looking on.': ('the same, and it was to be taken over', ONE),
        'You operate the machine now.': ('nobody else does', ONE),
        'You are looking on.': ('the viewer operates no more, or did not', ONE),
        'You are looking on: press Operate first.': (
            'it is not the viewer who operates; nothing is done',
            ONE,
        ),
        'Without the token you may look, and not act.': (
            'there is one, and the viewer has not sent it; nothing is done',
            TOKEN,
        ),
        'There is nothing for {} here.\n': (
            'the host of the request is no name of this machine, or it is a socket of no page',
            f'{SERVER}::test_the_page_is_there_under_the_name_that_it_was_given_and_no_foreign_one',
        ),
    },
    'recorded_run.py': {
        'The first picture is of some places only.': ('not all was read so far', READ),
        'Reading: {} of {} MB.': ('that part of the samples has passed by', READ),
        'What happened is sought in all {} MB.': ('all samples have passed by', READ),
        'What happened cannot be read: {}': (
            'the run cannot be read as a whole, for that reason',
            UNREAD,
        ),
        '{}: {}': ('a file, and what of it cannot be read', UNREAD),
        '{} cannot be read: {}.': (
            'the system refuses what is to be shown closely, for that reason',
            'page/test_recorded_page.py::test_it_claims_nothing_of_what_is_not_in_the_record',
        ),
        'Not all can be read: {}.': (
            'these parts are damaged or missing; all others are shown',
            UNREAD,
        ),
        'A recorded run is only looked at: {} cannot be.': (
            'a viewer wishes to do something to it',
            READ,
        ),
        'the record ends': (
            'at that time of the run there is no later sample',
            f'{RECORDED}::test_the_list_of_what_happened_goes_to_the_end_of_the_record',
        ),
    },
}
NO_SENTENCE = [
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "  # noqa: ISC004
    "img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
]
"""A header of HTTP."""


@pytest.mark.parametrize('module', sorted(module.name for module in HERE.glob('*.py')))
def test_the_table_has_what_a_module_says_and_nothing_else(module: str) -> None:
    assert set(sentences(HERE / module, NO_SENTENCE)) == set(SAID.get(module, {}))


@pytest.mark.parametrize('module', SAID)
def test_every_sentence_has_a_test_that_shows_when_it_is_true(module: str) -> None:
    assert not unshown(SAID, module)
