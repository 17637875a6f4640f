"""Whether what the nodes of the chaos logged and recorded is true, told once, and all of it."""

from __future__ import annotations

import json
import re
import sys
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from witness import NEVER_TRUE, SILENCE, Done

from lathe_chatter.array_types import Array
from lathe_chatter.recording import Run, read_run, verify
from lathe_chatter.recording.ros_messages import LOG_TYPE, types
from lathe_chatter.recording.run_summary import SUMMARY

_LINE = re.compile(r'\[(?:INFO|WARN|ERROR|FATAL|DEBUG)\] \[([\d.]+)\] \[([\w.]+)\]: (.*)')
_CUT_EVENT = re.compile(r'At [\d.]+ s: (knock|depth_of_cut)')
_HELD = re.compile(r' \(\d+ of this kind in \d+ s\.\)$')
_GAP = re.compile(r'At ([\d.]+) s: the samples up to ([\d.]+) s did not come\.')
_MISSING = re.compile(r'/lathe/samples: (\d+) samples .*did not come\.')
_FLAG = re.compile(r'At ([\d.]+) s: (?:the (chatter has died out)|chatter)')
_MOVE = re.compile(r'.*: I set spindle_speed_rpm from ([\d.]+) to ')
_STEP = re.compile(r'At [\d.]+ s: spindle_speed_rpm ([\d.]+) -> ')
_SENSES = re.compile(r'works with: |the tool, told at|times of the samples jump|best effort only')
"""Of sensors, machine and publishers that were all the time as they ought to be."""
_MOST_LINES = 60.0
"""Lines a minute that a node may log, what happened to the cut aside."""
_RATE = 1e4
_LATE = 3.0
"""s that a busy machine may be late to say what is so, beyond a stop of who says it."""
_WINDOW = 0.1
_DIED = 0.7
"""Of the greatest vibration since the flag: what is left where chatter is said to have died."""


class Said(NamedTuple):
    """A sentence, and when it was logged, s since the epoch."""

    at: float
    text: str


def judge(folder: Path, done: Done, counts: Counter[str], minutes: float) -> None:
    """Print what was done, and every fault.

    Raises:
        SystemExit: If there is one.
    """
    said = _read_logs(folder, done, minutes, sum(counts.values()) + 1)
    for name, sentences in said.items():
        done.faults += [f'{name} said: {each.text}' for each in sentences if _is_false(each)]
    done.faults += _judge_starts(said, done)
    done.faults += _judge_silence_and_clock(said, done)
    done.faults += _judge_supervisor(said)
    done.faults += _judge_losses_of_monitor(said.get('chatter_monitor', []), done)
    missing = sum(_judge_run(run, done, said.get('run_recorder', [])) for run in done.finished)
    for run in done.killed:
        _judge_run(run, done, [])
    did = ', '.join(f'{count} {name}' for name, count in sorted(counts.items()))
    print(
        f'{minutes:.1f} min of chaos: {did}; {len(done.finished)} runs finished and '
        f'{len(done.killed)} cut short; {missing} samples missing in the former, each told once'
    )
    if done.faults:
        sys.exit('\n'.join(f'FAULT {fault}' for fault in done.faults))


def _is_false(each: Said) -> bool:
    return bool(NEVER_TRUE.search(each.text) or _SENSES.search(each.text))


def _read_logs(folder: Path, done: Done, minutes: float, starts: int) -> dict[str, list[Said]]:
    """What each node logged, by its name; what it wrote beside its log is shown."""
    said: dict[str, list[Said]] = {}
    for log in sorted(folder.glob('*.log')):
        text = log.read_text(errors='replace')
        if 'Traceback' in text:
            part = text[text.index('Traceback') :][:3000]
            done.faults.append(f'{log.stem}: a traceback: {part}')
        lines = [line for line in text.splitlines() if not _CUT_EVENT.search(line)]
        beside: Counter[str] = Counter()
        for line in lines:
            if found := _LINE.fullmatch(line):
                said.setdefault(found[2], []).append(Said(float(found[1]), found[3]))
            else:
                beside[line] += 1
        print(f'{log.stem}: {len(lines)} lines')
        for line, count in beside.most_common(5):
            print(f'  beside the log, {count} times: {line:.200}')
        if len(lines) > _MOST_LINES * minutes + 20 * starts:
            done.faults.append(f'{log.stem} logged {len(lines)} lines in {minutes:.0f} min')
    return {name: sorted(sentences) for name, sentences in said.items()}


def _judge_starts(said: dict[str, list[Said]], done: Done) -> Iterator[str]:
    """That a lathe was started for each time that somebody says so."""
    starts = [session.started for session in done.of('lathe')]
    phrases = {
        'chatter_monitor': r'the lathe started again|this is another run',
        'run_recorder': r'after the lathe started again',
    }
    for name, phrase in phrases.items():
        for kind in phrase.split('|'):
            before = starts[0]
            for each in said.get(name, []):
                if kind in each.text and not _HELD.search(each.text):
                    if not any(before < start <= each.at for start in starts):
                        yield f'{name} at {each.at:.1f}, and no lathe was started: {each.text}'
                    before = each.at - (10.0 if name == 'run_recorder' else 0.0)


def _judge_silence_and_clock(said: dict[str, list[Said]], done: Done) -> Iterator[str]:
    """That nothing came, or /clock stood still, when somebody says so."""
    silences = [*done.silences, *((begin, np.inf) for _, begin in done.silences[-1:])]

    def was(spans: list[tuple[float, float]], each: Said, name: str) -> bool:
        stood = [end - begin for who, begin, end in done.stops if who == name and end < each.at]
        late = _LATE + max(stood, default=0.0)
        return any(begin < each.at - SILENCE and each.at < end + late for begin, end in spans)

    for each in said.get('chatter_monitor', []):
        if 'no samples come any more' in each.text and not was(silences, each, 'chatter_monitor'):
            yield f'at {each.at:.1f} the monitor said: {each.text} But they came.'
    for each in said.get('lathe', []):
        if '/clock stands still' in each.text and not was(done.clock_stops, each, 'lathe'):
            yield f'at {each.at:.1f} the lathe said: {each.text} But it did not.'
        jumps = [*done.clock_jumps, *(end for _, _, end in done.stops)]
        jumps += [end for _, end in done.clock_stops]
        jumped = re.search('/clock went back|/clock is .* ahead', each.text)
        if jumped and not any(jump - 0.1 < each.at < jump + 2.0 * _LATE for jump in jumps):
            yield f'at {each.at:.1f} the lathe said: {each.text} But it did not jump.'


def _judge_supervisor(said: dict[str, list[Said]]) -> Iterator[str]:
    """That chatter has ended only after the monitor has found so, and from which cut it moves."""
    died = [e.at for e in said.get('chatter_monitor', []) if 'chatter has died out' in e.text]
    before = 0.0
    for each in said.get('chatter_supervisor', []):
        if each.text.startswith('The chatter has ended'):
            if not any(before - _LATE < at < each.at + _LATE for at in died):
                yield f'at {each.at:.1f} the supervisor said: {each.text} But nobody knows.'
            before = each.at
        if move := _MOVE.match(each.text):
            steps = [
                float(step[1])
                for event in said.get('lathe', [])
                if each.at - 0.1 < event.at < each.at + 1.0 and (step := _STEP.match(event.text))
            ]
            if steps and abs(steps[0] - float(move[1])) > 1.0:
                yield f'at {each.at:.1f} the lathe turned at {steps[0]:g} rev/min: {each.text}'


def _judge_losses_of_monitor(sentences: list[Said], done: Done) -> Iterator[str]:
    """That each sample it counts as lost is told once."""
    causeless = 0
    for session in done.of('chatter_monitor'):
        end = session.ended or np.inf
        mine = [each for each in sentences if session.started <= each.at <= end]
        told, until = 0, -1.0
        for each in mine:
            if 'the lathe started again' in each.text or 'this is another run' in each.text:
                until = -1.0
            if not (gap := _GAP.match(each.text)):
                continue
            before, after = float(gap[1]), float(gap[2])
            if not until <= before < after:
                yield f'the monitor told of lost samples again: {each.text}'
            told, until = told + round((after - before) * _RATE) - 1, after
            causeless += not any(begin < each.at for _, begin, _ in done.stops)
        held = any(_HELD.search(each.text) for each in mine)
        if told < session.lost and not held:
            yield f'the monitor counts {session.lost} samples as lost, and told of {told}'
    print(f'monitor: {causeless} losses before anybody was stopped')


def _judge_run(run: Path, done: Done, recorder: list[Said]) -> int:
    """How many samples a run lacks; that they were told, once, and that its sentences are so."""
    if not run.exists() or not any(run.iterdir()):
        return 0
    found = verify(run)
    if '/lathe/samples' not in found.last:  # it ended before the first came
        return 0
    opened = read_run(run)
    samples = opened.samples(columns=['time', 'tool_displacement']).columns
    times = samples['time']
    steps = np.rint(np.diff(times) * _RATE).astype(int)
    missing = int(np.sum(steps[steps > 1] - 1))
    faults = [*_judge_flags(opened, times, samples['tool_displacement'])]
    losses = [each.text for each in found.findings if each.loss and 'samples are' in each.text]
    if bool(missing) != bool(losses):
        faults.append(f'{missing} samples are missing, and verify says: {losses}')
    notes = {note.name: note.values for note in opened.notes()}
    if SUMMARY in notes:
        counted = json.loads(notes[SUMMARY]['samples'])['/lathe/samples']['lost']
        if counted != missing:
            faults.append(f'{missing} samples are missing, {counted} were counted')
        mine = _of_run(recorder, run)
        told = sum(int(lost[1]) for each in mine if (lost := _MISSING.match(each.text)))
        if told != missing and not any(_HELD.search(each.text) for each in mine):
            faults.append(f'{missing} samples are missing, {told} were told in the log')
    elif run in done.finished:
        faults.append('finished, and says nothing at its end')
    done.faults += [f'{run.name}: {fault}' for fault in faults]
    return missing


def _of_run(recorder: list[Said], run: Path) -> list[Said]:
    """What the recorder said while it recorded a run."""
    begins = [k for k, each in enumerate(recorder) if each.text.startswith('Recording into ')]
    for begin, end in pairwise([*begins, len(recorder)]):
        if recorder[begin].text == f'Recording into {run}.':
            return recorder[begin:end]
    return []


def _judge_flags(run: Run, times: Array, motion: Array) -> Iterator[str]:
    """That the vibration was less where chatter is said to have died out."""
    parts = np.split(np.arange(times.size), np.flatnonzero(np.diff(times) < 0.0) + 1)
    onset = np.inf
    for raw in run.raw_messages('/rosout'):
        message = types().deserialize_cdr(raw.data, LOG_TYPE)
        if message.name != 'chatter_monitor' or not (flag := _FLAG.match(message.msg)):
            continue
        at = float(flag[1])
        if not flag[2]:
            onset = at
        elif at > onset:
            ratios = [_left(times[part], motion[part], onset, at) for part in parts]
            known = [ratio for ratio in ratios if np.isfinite(ratio)]
            if known and min(known) > _DIED:
                yield f'{message.msg} But {min(known):.2f} of the vibration is left.'
            onset = np.inf


def _left(times: Array, motion: Array, onset: float, at: float) -> float:
    """The vibration at a time, of the greatest since another; nan if not all is there."""
    inside = (times >= onset - _WINDOW) & (times <= at)
    if np.count_nonzero(inside) < 0.9 * _RATE * (at - onset):
        return float('nan')
    size = int(_WINDOW * _RATE)
    pieces = motion[inside][-(np.count_nonzero(inside) // size) * size :].reshape(-1, size)
    rms = np.std(pieces, axis=1)
    return float(rms[-1] / rms.max()) if rms.any() else 0.0
