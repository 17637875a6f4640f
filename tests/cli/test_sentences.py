"""Every sentence that a verb can say, and what must be true when it says it.

Each row names a sentence as it is printed, and in which of the situations below it is true: it is
said in all of these and in no other. A sentence in the code that is not in the table fails.
"""

from __future__ import annotations

import ast
import io
import re
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest
from support.recorded import number, topic

from lathe_chatter.cli.main import main
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.config import config_from
from lathe_chatter.model.lathe_parameter_table import parameters_of
from lathe_chatter.recording import LatheRun, RunWriter

CLI = Path(__file__).resolve().parents[2] / 'lathe_chatter' / 'cli'

SENTENCES: dict[str, tuple[str, ...]] = {
    # simulate
    r'\S+ s simulated in \S+ s, (\d\d+|\d(\.\d+)?) times real time: \d+ samples\.': (
        *(
            'quiet',
            'chatter',
            'fails',
            'peace',
            'unwanted',
            'guarded',
            'report ramp',
            'report unsure',
        ),
    ),
    r' *\d+\.\d\d s  (depth_of_cut|chatter flagged|advice: try)': ('chatter', 'unwanted'),
    r'Chatter was to be flagged, and it is otherwise\.': ('fails',),
    r'Chatter was not to be flagged, and it is otherwise\.': ('unwanted',),
    r'As the scenario expects, chatter was flagged\.': ('chatter',),
    r'As the scenario expects, nothing was flagged\.': ('peace',),
    r'The run ended at \S+ s: a displacement passed 1 m': ('guarded',),
    # report
    r'Pairs: frequency / Hz and growth rate': (
        *('chatter', 'report', 'report gap', 'report late', 'report ramp', 'report unsure'),
    ),
    r'No figure of a monitor is in the record\.': (
        *('report', 'report gap', 'report late', 'report ramp', 'report unsure'),
    ),
    r'With the standard errors of its machine file \(': ('report unsure',),
    r'Samples are missing in 1 place, the longest from 0\.5\d* s to 0\.7\d* s: ': ('report gap',),
    r' *\d\.\d+ +advice: \d+ rev/min': ('chatter',),
    r' *5\.\d+ +record begins: ': ('report late',),
    r' *1\.2\d* +the spindle is at 3600 rev/min': ('report ramp',),
    # verify, recover, export
    r'complete\n': ('verify', 'verify again', 'verify altered'),
    r'complete, and without samples of a lathe\n': ('verify other',),
    r'NOT complete': ('verify gap', 'verify damaged'),
    r'WRONG  ': ('verify gap', 'verify damaged'),
    r'UNSURE  ?': ('verify altered',),
    r'NOT PROVEN: what cannot be computed again': ('verify altered',),
    r'note   .*computed again and are equal, bit for bit\.': ('verify again',),
    r'LOST  ': ('recover damaged',),
    r'saved into ': ('recover', 'recover damaged'),
    r'\d+ samples in .*\.csv': ('export', 'export gap'),
    r'note   .*(missing|gap)': ('export gap',),
    # listen
    r'works with  both displacements and the machine are known': ('listen',),
    r'flagged     0\.0% of the time': ('listen',),
    r'labels      F1 of seconds none: no chatter in them, of events none \(0 of 0\), ': (
        'listen',
    ),
    # dataset
    r'2 windows, 100\.0% of a stable cut\.': ('dataset',),
    r'1 machines x 1 runs x 2 windows of ': ('dataset', 'dataset dry'),
    # charts
    r'lowest limit, open: 0\.596\d* mm (at|in every lobe from) ': (
        'lobes',
        'lobes without bearing',
    ),
    r'lowest limit, on its bearing: ': ('lobes',),
    r'lowest limit, safe: ': ('lobes', 'lobes without bearing'),
    r'highest limit, safe: .* above the chart': ('lobes', 'lobes without bearing'),
    r'no limit, open, at any of these speeds': ('lobes without force',),
    r'A map of 2 points shows no shape: ': ('knocks few',),
    r'Of 1 cuts 1 chatter unknocked, 0 can be knocked': ('knocks chatter',),
    r'Of 1 cuts 0 chatter unknocked, 1 can be knocked': ('knocks finite',),
    r'Of 1 cuts 0 .* 1 survive every knock that was tried\.': ('knocks none',),
    r'Weakest: 3000 rev/min, 0\.65 mm .* lasts, of .* dies out': ('knocks finite',),
    r'CPU time in one thread\.': ('bench',),
}
TOLD_ELSEWHERE = {
    'Interrupted while the nodes were still starting: nothing was recorded.': 'test_run.py',
    'not complete yet: nothing is missing so far': 'recording/test_live_run.py',
    'Interrupted: the run is finished and reported ...': 'test_run.py',
    'It has failed: the run is reported up to then ...': 'test_run.py',
    'Recorded anew meanwhile, and not in this report: ': 'test_run.py',
    'Interrupted: the run above is recorded up to that moment.': 'test_run.py',
    'Interrupted: what was drawn is removed again.': 'test_reproduce.py',
    'Interrupted: the same call goes on from ': 'test_sentences.py',
    ', and the same call goes on from them.': 'dataset/test_generation.py',
    ': the same call begins again.': 'dataset/test_generation.py',
    ' verdicts agree. Growth rates in 1/s': 'test_reproduce.py',
    'The simulated time went back to zero ': 'recording/test_recorded_cuts.py',
    'stable with ': 'test_charts.py',
    'lowest depth that is safe with ': 'test_charts.py',
    'Without a spindle speed any line that holds the power is flagged': 'listening/',
    'uncertain there by: ': 'test_charts.py',
    'No cut is as deep as the lowest limit': 'test_charts.py',
    'Where the workpiece seats is drawn for a feed of ': 'test_charts.py',
    'The chart has speeds at which the spindle': 'test_charts.py',
    'WARNING  ': 'tap_test, test_charts.py, test_identify.py',
    '  (scenario ': 'test_run.py',
}
"""Those that need ROS, an interrupt, or what is another's: where they are walked."""


def simulated(folder: Path, *options: str, scenario: str = '') -> list[str]:
    call = ['simulate', '--output', str(folder), *options]
    if scenario:
        file = folder.with_suffix('.yaml')
        file.write_text(scenario)
        call += ['--scenario', str(file)]
    return call


def record(folder: Path, keep: Callable[[int], bool], **values: float) -> Path:
    """A run of 1.5 s from 5 s on, or from the start, of which some blocks are kept."""
    config = config_from(values)
    lathe = config.lathe()
    with LatheRun(folder, config.parameters(), simulated=True) as run:
        for k in range(15):
            samples = lathe.advance(1000)
            if keep(k):
                run.write(samples)
    return folder


def made(folder: Path) -> dict[str, Path]:
    """Runs to look into."""
    runs = {
        'whole': record(folder / 'whole', lambda _: True),
        'gap': record(folder / 'gap', lambda k: k not in {5, 6}),
        'damaged': record(folder / 'damaged', lambda _: True),
        'altered': folder / 'altered',
        'late': folder / 'late',
        'other': folder / 'other',
        'ramp': folder / 'ramp',
    }
    file = runs['damaged'] / 'run_0.mcap'
    if not file.exists():
        file = next(runs['damaged'].glob('*.mcap'))
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    lathe = VirtualLathe()
    with LatheRun(runs['altered'], parameters_of(lathe)) as run:
        samples = lathe.advance(200)
        samples[4, 6] += 1e-9
        run.write(samples)
    lathe = VirtualLathe()
    with LatheRun(runs['late'], parameters_of(lathe)) as run:
        lathe.advance(50_000)
        run.write(lathe.advance(5000))
    with RunWriter(runs['other']) as writer:
        writer.add_topic(topic('/numbers'))
        writer.write('/numbers', number(1.0), log_time=1, publish_time=1, sequence=1)
    return runs


RAMP = """
duration: 1.5
parameters: {spindle_acceleration: 3000.0}
steps: [{at: 1.0, set: {spindle_speed_rpm: 3600}}]
"""
UNSURE = """
tool: {modes: [{frequency: 125 Hz, damping_ratio: 5 %, mass: 50 g, errors: {frequency: 2 %}}]}
"""
PLAN = """
machines: 1
runs: 1
duration: 1 s
cut: {depth_of_cut: 0.3 mm, bearing_contact: none}
windows: {length: 0.5 s}
"""
STEP = 'steps: [{at: 0.3, set: {depth_of_cut: 0.001}}]\n'


def situations(folder: Path, runs: dict[str, Path]) -> Iterator[tuple[str, list[str]]]:
    """Calls by what is the case."""
    yield 'quiet', simulated(folder / 'a', '--duration', '0.3')
    deep = f'duration: 1.5\nexpect: {{flagged: true}}\n{STEP}'
    yield 'chatter', simulated(folder / 'b', '--monitor', '--report', scenario=deep)
    yield 'fails', simulated(folder / 'c', scenario='duration: 0.3\nexpect: {flagged: true}\n')
    yield 'peace', simulated(folder / 'd', scenario='duration: 0.3\nexpect: {flagged: false}\n')
    unwanted = f'duration: 1.5\nexpect: {{flagged: false}}\n{STEP}'
    yield 'unwanted', simulated(folder / 'e', scenario=unwanted)
    linear = ('--depth-of-cut', '0.002', '--no-tool-leaves-cut', '--duration', '5')
    yield 'guarded', simulated(folder / 'f', *linear)
    yield 'report', ['report', str(runs['whole'])]
    yield 'report gap', ['report', str(runs['gap'])]
    yield 'report late', ['report', str(runs['late'])]
    yield 'report ramp', simulated(folder / 'ramp', '--report', scenario=RAMP)
    unsure = folder / 'unsure.yaml'
    unsure.write_text(UNSURE)
    machine = ('--machine', str(unsure), '--duration', '0.3')
    yield 'report unsure', simulated(folder / 'u', *machine, '--report')
    yield 'verify', ['verify', str(runs['whole'])]
    yield 'verify gap', ['verify', str(runs['gap'])]
    yield 'verify again', ['verify', str(runs['whole']), '--resimulate']
    yield 'verify other', ['verify', str(runs['other'])]
    yield 'verify damaged', ['verify', str(runs['damaged'])]
    yield 'verify altered', ['verify', str(runs['altered']), '--resimulate']
    yield 'recover', ['recover', str(runs['whole']), '--output', str(folder / 'saved')]
    yield 'recover damaged', ['recover', str(runs['damaged']), '--output', str(folder / 'part')]
    yield 'export', ['export', str(runs['whole']), '--output', str(folder / 'whole.csv')]
    yield 'export gap', ['export', str(runs['gap']), '--output', str(folder / 'gap.csv')]
    labels, plan = folder / 'labels.csv', folder / 'plan.yaml'
    labels.write_text('0,2,stable\n')
    machine = ('--machine', 'paper', '--labels', str(labels))
    yield 'listen', ['listen', str(runs['whole']), *machine]
    plan.write_text(PLAN)
    yield 'dataset dry', ['dataset', str(plan), '--output', str(folder / 'dry'), '--dry-run']
    yield 'dataset', ['dataset', str(plan), '--output', str(folder / 'data')]
    for name, options in (
        ('lobes', ()),
        ('lobes without bearing', ('--bearing-contact', 'none')),
        ('lobes without force', ('--cutting-coefficient', '0', '--bearing-contact', 'none')),
    ):
        yield name, ['lobes', '--output', str(folder / f'{name}.svg'), *options]
    for name, options in (
        ('knocks chatter', ('--depths', '0.001')),
        ('knocks few', ('--depths', '0.001:0.0011:2')),
        ('knocks finite', ('--clearances', '8e-6', '--depths', '0.00065', '--reach', '3')),
        ('knocks none', ('--clearances', '12e-6', '--depths', '0.00065', '--reach', '1.2')),
    ):
        call = ['knock-map', '--step', '1.5', '--output', str(folder / f'{name}.jsonl')]
        yield name, [*call, *options]
    yield 'bench', ['bench', 'lathe', '--repeats', '1']


@pytest.fixture(scope='module')
def said(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    pytest.importorskip('pyarrow', reason='the plan of a data set asks for Parquet')
    folder = tmp_path_factory.mktemp('said')
    told = {}
    for name, call in situations(folder, made(tmp_path_factory.mktemp('runs'))):
        with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as errors:
            assert main(call) in {0, 1, 3}, errors.getvalue()
        told[name] = out.getvalue() + errors.getvalue()
        assert not told[name].startswith('\n'), name
        assert 'nan' not in re.split(r'[^a-z]', told[name]), name
    return told


@pytest.mark.parametrize('sentence', SENTENCES)
def test_it_is_said_where_it_is_true_and_nowhere_else(sentence: str, said: dict[str, str]) -> None:
    pattern = re.compile(f'^{sentence}', re.MULTILINE)
    where = {name for name, text in said.items() if pattern.search(text)}
    assert where == set(SENTENCES[sentence])


def literal_parts(node: ast.expr) -> str:
    """The text of a sentence in the code, with a blank where a value stands."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return ''.join(literal_parts(part) for part in node.values)
    return '\0'


def sentences_in_code() -> Iterator[tuple[str, str]]:
    for file in sorted(CLI.glob('*.py')):
        for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
            spoken: ast.expr | None = None
            if isinstance(node, ast.Call) and getattr(node.func, 'attr', '') == 'say':
                spoken = node.args[0]
            elif isinstance(node, ast.Yield) and isinstance(node.value, ast.JoinedStr):
                spoken = node.value
            text = literal_parts(spoken) if spoken is not None else ''
            if len(text.replace('\0', '').split()) > 1:
                yield file.name, text


@pytest.mark.parametrize(('file', 'text'), [*sentences_in_code()])
def test_every_sentence_in_the_code_is_in_the_table(file: str, text: str) -> None:
    parts = [re.sub(r'[^a-zA-Z ]', ' ', part).split() for part in text.split('\0')]
    first = ' '.join(next((part for part in parts if len(part) > 1), max(parts, key=len))[:3])
    told = re.sub(r'\\[a-zA-Z]', ' ', ' '.join([*SENTENCES, *TOLD_ELSEWHERE]))
    assert first in ' '.join(re.sub(r'[^a-zA-Z ]', ' ', told).split()), (file, text)


def test_an_interrupted_map_goes_on_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from lathe_chatter.knocks import knock_map

    computed = knock_map.KnockGrid.limit_at
    begun = []

    def limit_at(grid: knock_map.KnockGrid, point: knock_map.Point) -> object:
        begun.append(point)
        if len(begun) > 3:
            raise KeyboardInterrupt
        return computed(grid, point)

    call = ['knock-map', '--depths', '0.001:0.0015:6', '--output', str(tmp_path / 'a.jsonl')]
    with monkeypatch.context() as patch:
        patch.setattr(knock_map.KnockGrid, 'limit_at', limit_at)
        assert main(call) == 130
    assert f'the same call goes on from {tmp_path}/a.jsonl.' in capsys.readouterr().out
    kept = (tmp_path / 'a.jsonl').read_text().count('\n')
    assert 1 < kept < 7
    assert main(call) == 0
    assert (tmp_path / 'a.jsonl').read_text().count('\n') == 7
