"""What is typed into the page, and what it says of cuts that others begin, in a real browser."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from support.browser import Browser, chromium
from support.page_cell import LAMP, PATIENCE, Page, operate, recorded_cell

if chromium() is None:
    pytest.skip('no Chromium is here', allow_module_level=True)

REFUSAL = 'document.querySelector(".refusal:not(:empty)")?.textContent'
CLOCK = 'document.querySelector("#clock").textContent'


@pytest.fixture(scope='module')
def page(domain: int, compiled: None, tmp_path_factory: Any) -> Iterator[Page]:  # noqa: ARG001
    with recorded_cell(tmp_path_factory.mktemp('cell'), 'force_noise:=0.001') as page:
        yield page


@pytest.mark.parametrize('text', ['0,4', '0.4', ' .4 '])
def test_a_decimal_comma_is_one(browser: Browser, text: str) -> None:
    operate(browser)
    browser.run('ask({do: "set", node: "lathe", values: {depth_of_cut: 0.0005}})')
    browser.until('cell.lathe_values.depth_of_cut === 0.0005', 'the cut before')
    browser.enter('#p-depth_of_cut', text)
    browser.until('cell.lathe_values.depth_of_cut !== 0.0005', 'the change')
    assert browser.run('cell.lathe_values.depth_of_cut') == 0.0004


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('abc', '"abc" is not a number: nothing was changed.'),
        ('0.4.1', '"0.4.1" is not a number: nothing was changed.'),
        ('', 'The field was empty: nothing was changed.'),
        ('1,500', '1,500 may be 1500 or 1.500: write one of them. Nothing was changed.'),
    ],
)
def test_what_is_no_number_changes_nothing_and_is_said(
    browser: Browser, text: str, said: str
) -> None:
    operate(browser)
    before = browser.run('cell.lathe_values.depth_of_cut')
    browser.enter('#p-depth_of_cut', text or ' ')
    assert browser.until(REFUSAL, 'the refusal') == said
    assert float(browser.run('document.querySelector("#p-depth_of_cut").value')) == before * 1e3
    assert browser.run('cell.lathe_values.depth_of_cut') == before


def test_a_refusal_goes_with_the_next_entering(browser: Browser) -> None:
    operate(browser)
    for text in ('0.45', '0.45', '0.46'):  # a good value, the present one, another
        browser.enter('#p-depth_of_cut', '4,000')
        browser.until(REFUSAL, 'the refusal')
        browser.enter('#p-depth_of_cut', text)
        browser.until(f'!{REFUSAL}', 'no refusal')
        browser.until(f'cell.lathe_values.depth_of_cut === {text} / 1e3', 'the change')


@pytest.mark.parametrize('entered', [True, False])
def test_enter_sets_what_stands_there_whatever_others_have_set(
    browser: Browser, entered: bool
) -> None:
    operate(browser)
    other = 'ask({do: "set", node: "lathe", values: {depth_of_cut: %s}})'
    field = 'document.querySelector("#p-depth_of_cut").value'
    browser.run(other % '0.0005')
    browser.until(f'{field} === "0.5"', 'the cut before')
    browser.enter('#p-depth_of_cut', '0.5')
    if not entered:
        browser.run('document.activeElement.select()')
        browser.command('Input.insertText', text='0.5')
    browser.run(other % '0.00055')
    browser.until('cell.lathe_values.depth_of_cut === 0.00055', 'the cut of another')
    assert browser.run('document.activeElement.id') == 'p-depth_of_cut'
    if entered:  # nothing has been typed since
        browser.until(f'{field} === "0.55"', 'the value of another')
        browser.enter('#p-depth_of_cut', '0.5')
    else:
        assert browser.run(field) == '0.5'
        browser.key('Enter', 13, '\r')
    browser.until('cell.lathe_values.depth_of_cut === 0.0005', 'what stands in the field')


def test_an_answer_that_comes_late_wipes_no_later_refusal(browser: Browser) -> None:
    operate(browser)
    browser.run(
        '(field => { for (const text of ["0.45", "abc"]) {'
        ' field.value = text; for (const kind of ["input", "change"])'
        ' field.dispatchEvent(new Event(kind)); } })'
        '(document.querySelector("#p-depth_of_cut"))'
    )
    browser.until('!controls.get("depth_of_cut").busy', 'the answer')
    assert browser.run(REFUSAL) == '"abc" is not a number: nothing was changed.'


def test_a_knock_of_one_and_a_half(browser: Browser) -> None:
    operate(browser)
    browser.enter('#impulse', '1,5')
    browser.click('#knock')
    said = 'document.querySelector("#log").innerText'
    browser.until(f'{said}.includes("knock of 0.0015 N s")', 'the knock')


def test_keys_reach_round_speeds_which_are_told_with_their_unit(browser: Browser) -> None:
    operate(browser)
    browser.enter('#p-spindle_speed_rpm', '2990')
    browser.until('cell.lathe_values.spindle_speed_rpm === 2990', 'a speed')
    slider = 'document.querySelector("[aria-label^=\\"spindle speed\\"]")'
    browser.run(f'{slider}.focus()')
    browser.key('ArrowRight', 39)
    browser.until('cell.lathe_values.spindle_speed_rpm === 3000', 'the next')
    assert browser.run(f'{slider}.getAttribute("aria-valuetext")') == '3000 rev/min'


@pytest.mark.parametrize('width', [390, 1280])
def test_each_axis_has_two_numbers(browser: Browser, width: int) -> None:
    browser.resize(width)
    try:
        browser.until('plots.get("chart") && plots.get("spectrum")', 'the plots', PATIENCE)
        poor = (
            '[...plots].flatMap(([id, u]) => u.axes.map((a, k) => [id, k, a._values])).filter('
            '([, , values]) => !(values?.filter(v => v != null && v !== "").length > 1))'
        )
        browser.until(f'!{poor}.length', 'two numbers on each')
    finally:
        browser.resize(1280)


def test_what_was_set_before_a_scenario_can_be_had_back(browser: Browser) -> None:
    operate(browser)
    browser.run('document.querySelector("#scenario").value = "no_clearance"')
    browser.run('document.querySelector("#scenario").onchange()')
    said = 'document.querySelector("#scenario-text").textContent'
    assert 'the lathe begins anew, with its cut' in browser.run(said)
    depth = browser.run('cell.lathe_values.depth_of_cut')
    browser.click('#play')
    browser.until('cell.lathe_values.force_noise === 0', 'the cut of the scenario', PATIENCE)
    browser.until(f'{said}.includes("; next, at 3 s: ")', 'what it waits for')
    browser.click('[data-call=reset]')
    browser.until(f'{said}.includes("is stopped, for the lathe has begun anew")', 'its end')
    assert browser.run('cell.lathe_values.force_noise') == 0
    browser.click('#back')
    browser.until('cell.lathe_values.force_noise === 0.001', 'the noise of before')
    assert browser.run('cell.lathe_values.depth_of_cut') == depth
    browser.until('document.querySelector("#back").hidden', 'that there is no other')


def test_a_reset_while_paused_leaves_nothing_of_the_cut_before(browser: Browser) -> None:
    operate(browser)
    # Also on its bearing, on which 0.5 mm goes on to chatter where it was hit.
    browser.enter('#p-depth_of_cut', '0.3')
    browser.until(f'{LAMP} === "stable"', 'a stable cut', PATIENCE)
    browser.click('[data-call=pause]')
    browser.until(f'{CLOCK}.includes("paused")', 'the pause')
    assert browser.run('document.querySelector("#gone").hidden')
    browser.click('[data-call=reset]')
    browser.until(f'{CLOCK} === "0.0 s, paused"', 'the new time')
    browser.until('document.querySelector("#growth_rate").textContent === "\\u2013"', 'none')
    assert browser.run('plots.get("displacement-0").data[0].length') == 0
    assert browser.run(LAMP) == 'unknown'
    browser.click('[data-call=resume]')
    browser.until(f'{LAMP} === "stable"', 'a stable cut', PATIENCE)
    browser.enter('#p-depth_of_cut', '0.5')
    browser.until('cell.lathe_values.depth_of_cut === 0.0005', 'the cut before')
    assert browser.complaints == []


def test_a_flag_of_a_run_before_lights_no_lamp(browser: Browser) -> None:
    told = '{flag: "True", "flag since, s": "1e6"}'
    lamp = browser.run(
        f'(() => {{ const flag = cell.flag; cell.flag = {{up: true}};'
        f' cell.statuses.monitor.cut.values = {told}; showLamp();'
        f' const seen = {LAMP}; cell.flag = flag; showLamp(); return seen; }})()'
    )
    assert lamp == 'unknown'


def test_no_margin_is_shown_amid_chatter_and_rest_has_no_digits(browser: Browser) -> None:
    shown = browser.run(
        '(() => { const {flag, figures} = cell; const seen = [false, true].map(up => {'
        ' Object.assign(cell, {flag: {up}, figures: {margin: 0.37, amplitude: 3e-15}});'
        ' showFigures(); return ["margin", "amplitude"].map(id => $(id).textContent); });'
        ' Object.assign(cell, {flag, figures}); showFigures(); return seen; })()'
    )
    (margin, amplitude), (amid, _) = shown
    assert margin.startswith('37')
    assert margin.endswith(' %')
    assert amid == '\u2013'
    assert amplitude == '< 0.001 \u00b5m'


def test_signals_are_bands_between_smallest_and_largest(browser: Browser) -> None:
    browser.until('plots.get("displacement-1")?.data[0].length > 9', 'the last minute', PATIENCE)
    times, *values = browser.run('plots.get("displacement-1").data.map(list => [...list])')
    assert times == sorted(set(times))
    low, high = values[:2], values[2:]
    pairs = [
        pair for a, b in zip(low, high, strict=True)
        for pair in zip(a, b, strict=True) if None not in pair
    ]  # fmt: skip
    assert pairs
    assert all(least <= most for least, most in pairs)
    assert any(least < most for least, most in pairs)


def test_a_killed_recorder_records_nothing(page: Page, browser: Browser) -> None:
    said = 'document.querySelector("#recording").textContent'
    browser.until(f'{said}.startsWith("recording")', 'the recording', PATIENCE)
    page.kill('run_recorder')
    browser.until(f'{said} === "No recorder speaks."', 'that it is gone', PATIENCE)


def test_a_field_that_has_the_focus_follows_a_lathe_that_begins_anew(
    page: Page, browser: Browser
) -> None:
    operate(browser)
    browser.enter('#p-depth_of_cut', '0.3')
    browser.until('cell.lathe_values.depth_of_cut === 0.0003', 'the change')
    page.kill('lathe')
    browser.until('document.querySelector("#gone").textContent.includes("silent")', 'its end')
    page.start('lathe', 'force_noise:=0.001')
    browser.until('cell.lathe_values.depth_of_cut === 0.0005', 'its parameters', PATIENCE)
    # What it is told of parameters comes before the first samples.
    own = 'trail.length === 1 && trail[0].depth === 0.0005'
    browser.until(own, 'its way, and nothing of the one before', PATIENCE)
    assert browser.run('document.activeElement.id') == 'p-depth_of_cut'
    assert browser.run('document.activeElement.value') == '0.5'
