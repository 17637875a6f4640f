"""`lobes`, `knock-map` and `bench` as a user calls them."""

from __future__ import annotations

import csv
import json
import math
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from lathe_chatter.cli import lobes
from lathe_chatter.cli import main as cli
from lathe_chatter.errors import UnprovenError
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.model.machine_file import load_machine
from lathe_chatter.stability import rightmost_root, safe_limit


def test_lobes_tells_the_limits_as_csv_and_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture, table = tmp_path / 'chart.png', tmp_path / 'chart.csv'
    arguments = ['--output', str(picture), '--csv', str(table), '--bearing-clearance', '1e-5']
    assert cli.main(['lobes', *arguments, '--from', '2500', '--to', '3500', '--json']) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures['parameters']['bearing_clearance'] == 1e-5
    with table.open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert [float(row['safe_depth']) for row in rows] == figures['safe_depth']
    speeds = figures['spindle_speed_rpm']
    expected = safe_limit(Machine(), Cut(bearing_clearance=1e-5), speeds)
    assert figures['safe_depth'] == pytest.approx(expected.depth_of_cut, rel=1e-9)
    assert figures['seating_line'] == pytest.approx(expected.seating_line, rel=1e-9)
    assert picture.read_bytes().startswith(b'\x89PNG')
    assert picture.with_suffix('.svg').is_file()


def test_a_pocket_that_leaves_the_chart_through_its_top_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call = ['lobes', '--output', str(tmp_path / 'a.svg'), '--bearing-contact', 'none', '--force']
    assert cli.main([*call, '--json']) == 0
    depths = json.loads(capsys.readouterr().out)['safe_depth']
    assert cli.main(call) == 0
    (line,) = [each for each in capsys.readouterr().out.splitlines() if 'highest' in each]
    assert line.startswith(f'highest limit, safe: {max(depths) * 1e3:.4g} mm at ')
    assert line.endswith(' rev/min, above the chart (--depth-limit)')
    assert cli.main([*call, '--depth-limit', str(max(depths))]) == 0
    assert 'highest' not in capsys.readouterr().out


def test_a_picture_is_what_its_name_says_and_is_not_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    beginnings = {'.png': b'\x89PNG', '.svg': b'<?xml', '.pdf': b'%PDF'}
    for ending, files in (('.svg', {'a.svg'}), ('.pdf', {'a.pdf'}), ('.png', {'a.png', 'a.svg'})):
        folder = tmp_path / ending
        call = ['lobes', '--output', str(folder / f'a{ending}')]
        assert cli.main(call) == 0
        assert {file.name for file in folder.iterdir()} == files
        said = capsys.readouterr().out
        for file in folder.iterdir():
            assert file.read_bytes().startswith(beginnings[file.suffix])
            assert f'picture  {file}\n' in said
        assert cli.main(call) == 2
        assert f'a{ending} exists already' in capsys.readouterr().err
        assert cli.main([*call, '--force']) == 0


def test_the_peaks_of_the_lobes_are_sharp(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where two lobes meet, against a thousand times as many speeds about the place."""
    call = ['lobes', '--output', str(tmp_path / 'a.png'), '--bearing-contact', 'none', '--json']
    assert cli.main([*call, '--from', '1000', '--to', '4000']) == 0
    figures = json.loads(capsys.readouterr().out)
    speeds, limit = (np.array(figures[name]) for name in ('spindle_speed_rpm', 'open_limit'))
    peaks = np.flatnonzero((limit[1:-1] > limit[:-2]) & (limit[1:-1] > limit[2:])) + 1
    assert len(peaks) >= 5
    for place in speeds[peaks]:
        close = np.linspace(0.995 * place, 1.005 * place, 20_001)
        found = safe_limit(Machine(), Cut(bearing_contact=BearingContact.NONE), close).open_limit
        assert limit[speeds == place].max() == pytest.approx(found.max(), rel=2e-4)


def test_a_map_goes_over_the_whole_chart(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(['lobes', '--output', str(tmp_path / 'a.png'), '--map', '--json']) == 0
    found = json.loads(capsys.readouterr().out)['map']
    rates = np.array(found['growth_rate'])
    assert rates.shape == (len(found['depth_of_cut']), len(found['spindle_speed_rpm']))
    assert found['spindle_speed_rpm'] == sorted(found['spindle_speed_rpm'])
    k, j = 70, 30
    root = rightmost_root(
        Machine(), found['spindle_speed_rpm'][k], found['depth_of_cut'][j],
        seated=found['seated'][j][k],
    )  # fmt: skip
    assert rates[j, k] == pytest.approx(root.real, abs=1e-6)


def test_a_machine_without_a_limit_has_a_chart_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A material that needs no force: every limit is infinite, and null in JSON."""
    arguments = ['--cutting-coefficient', '0', '--bearing-contact', 'none', '--json']
    assert cli.main(['lobes', '--output', str(tmp_path / 'a.png'), *arguments]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert set(figures['open_limit']) == {None}
    assert 'seated_limit' not in figures


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['lobes', '--from', '0'], '--from is 0.0 rev/min: it must be'),
        (['lobes', '--from', '4000', '--to', '3000'], 'above --from'),
        (['lobes', '--depth-of-cut', 'deep'], "depth_of_cut is 'deep': it must be"),
        (['lobes', '--tool.mass', '0'], 'tool.mass is 0 kg'),
        (['lobes', '--output', '/dev/null/all.png'], 'cannot be'),
        (['lobes', '--output', 'chart.xyz'], 'a file that ends in .png, .svg or .pdf'),
        (['lobes', '--output', '{tmp}/a.png', '--csv', '{tmp}/b.svg'], 'another file than a'),
        (
            ['lobes', '--output', '{tmp}/a.png', '--csv', '/dev/full'],
            '/dev/full cannot be written',
        ),
        (['knock-map', '--output', '{tmp}/a.png'], 'no name of a picture'),
        (['knock-map', '--speeds', '3000:2000:5'], 'A:B:N with A below B'),
        (['knock-map', '--speeds', 'fast'], '--speeds is'),
        (['knock-map', '--speeds', '20 Hz:30 mm:2'], "--speeds is '30 mm'"),
        (['lobes', '--to', '3 kg'], "--to is '3 kg': it must be"),
        (
            ['identify', 'tool=x.uff', '--from', '3 m', '--output', '{tmp}/m.yaml'],
            "--from is '3 m': it must be",
        ),
        (['run', '--machine', 'nowhere.yaml'], 'The machine nowhere.yaml cannot be read'),
        (['knock-map', '--depths', '1'], '--depths is 1.0 m'),
        (['knock-map', '--depths', '0.0001:0.001:x'], 'A:B:N'),
        (['bench', 'luck'], "TOPIC is 'luck'"),
        (['bench', '--repeats', '0'], '--repeats is 0'),
    ],
)
def test_a_mistake_is_one_sentence(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([word.format(tmp=tmp_path) for word in arguments]) == 2
    told = capsys.readouterr().err
    assert words in told
    assert told.count('\n') == 1


def test_knock_map_draws_tells_and_continues(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    points = tmp_path / 'points.jsonl'
    call = [
        'knock-map', '--clearances', '8e-6:12e-6:2', '--depths', '0.00065', '--reach', '3',
        '--step', '1.5', '--output', str(points), '--json',
    ]  # fmt: skip
    assert cli.main(call) == 0
    first = json.loads(capsys.readouterr().out)
    assert [point['margin'] for point in first] == ['finite', 'none found']
    assert first[0]['survived'] < abs(first[0]['impulse'])
    assert first[1]['impulse'] is None
    written = points.read_bytes()
    assert points.with_suffix('.png').read_bytes().startswith(b'\x89PNG')
    assert cli.main(call) == 0
    assert json.loads(capsys.readouterr().out) == first
    assert points.read_bytes() == written
    assert cli.main([*call[:-1], '--tolerance', '0.2']) == 2
    assert 'not of the same tolerance' in capsys.readouterr().err


HEAVY = (
    '{tool: {modes: [{frequency: 50 Hz, damping_ratio: 4 %, mass: 3 t}]},'
    ' workpiece: {modes: [{frequency: 22 Hz, damping_ratio: 4 %, mass: 40 t}]},'
    ' material: {cutting_coefficient: 2000 MPa, errors: {cutting_coefficient: 10 %}},'
    ' spindle: {slowest_speed: 2 rpm, fastest_speed: 100 rpm},'
    ' cut: {spindle_speed: 30 rpm, depth_of_cut: 11 mm, feed: 1.5 mm/rev}}'
)
LIGHT = (
    '{tool: {modes: [{frequency: 5 kHz, damping_ratio: 2 %, mass: 4 g}]},'
    ' material: {cutting_coefficient: 800 MPa}, cut: {spindle_speed: 90000 rpm}}'
)


@pytest.mark.parametrize(
    ('machine', 'more', 'low', 'high'),
    [
        (HEAVY, ['--workers', '1'], 2.0, 100.0),
        (HEAVY, ['--from', '0.5 Hz', '--to', '80 rpm', '--uncertain', ''], 30.0, 80.0),
        # 0.161 and 1.933 turns in a period of the workpiece's 103.5 Hz, and about the cut.
        (LIGHT, [], 1000.0, 100_000.0),
    ],
    ids=['heavy', 'with units', 'light'],
)
def test_a_chart_suits_the_machine(
    machine: str, more: list[str], low: float, high: float, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    call = ['lobes', '--machine', machine, '--output', str(tmp_path / 'a.png'), '--json', *more]
    assert cli.main(call) == 0
    told = capsys.readouterr()
    figures = json.loads(told.out)
    speeds = figures['spindle_speed_rpm']
    assert (speeds[0], speeds[-1]) == (low, high)
    assert ('cut' in figures) == (machine == HEAVY)
    if 'cut' in figures:  # the limit of 12.1 mm is inverse to C, which is known to 10 %
        assert 0.6 < figures['cut']['stable_with'] < 0.99
        assert 'At 30 rev/min 11 mm is stable with' in told.err
        sure = 1e3 * min(json.loads(told.out)['safe_with_95_percent']['depth_of_cut'])
        assert f'lowest depth that is safe with 95%: {sure:.4g} mm' in told.err


def test_knock_map_is_of_the_cut_of_its_machine(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    points = tmp_path / 'points.jsonl'
    call = ['knock-map', '--machine', HEAVY, '--depths', '9 mm:13 mm:2', '--reach', '1.5',
            '--step', '1.4', '--output', str(points), '--json']  # fmt: skip
    assert cli.main(call) == 0
    told = json.loads(capsys.readouterr().out)
    assert [point['spindle_speed_rpm'] for point in told] == [30.0, 30.0]
    assert [point['depth_of_cut'] for point in told] == pytest.approx([0.009, 0.013])
    assert [point['margin'] for point in told] == ['none found', 'unstable']
    assert cli.main(call) == 0  # the same map, by the text that is in the file
    assert json.loads(capsys.readouterr().out) == told


def test_bench_prints_figures(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(['bench', 'lathe', '--repeats', '1', '--json']) == 0
    told = json.loads(capsys.readouterr().out)
    assert told['machine']
    values = [figure['value'] for figure in told['figures']['lathe']]
    assert values
    assert all(value > 0.0 and math.isfinite(value) for value in values)


@pytest.mark.parametrize(
    ('module', 'name', 'words', 'end'),
    [
        ('growth_map', '_column', ['--map'], 150),
        ('probability', '_limits_of', ['--uncertain', 'C=10%'], 80),
    ],
)
def test_an_interrupted_chart_goes_on_where_it_was(
    module: str, name: str, words: list[str], end: int, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.setattr(lobes, '_PROBABLE_MACHINES', 100)
    place = import_module(f'lathe_chatter.stability.{module}')
    computed, begun = getattr(place, name), list[object]()

    def stopping(*values: object, **options: object) -> object:
        begun.append(values)
        if len(begun) == end:  # beyond what is out at once: so some is kept
            raise KeyboardInterrupt
        return computed(*values, **options)

    call = ['lobes', *words, '--from', '2000', '--to', '4000', '--json', '--output']
    assert cli.main([*call, str(tmp_path / 'whole.png')]) == 0
    whole = capsys.readouterr().out
    monkeypatch.setattr(place, name, stopping)
    assert cli.main([*call, str(tmp_path / 'a.png')]) == 130
    assert f'the same call goes on from {tmp_path}/a.jsonl.' in capsys.readouterr().err
    kept = (tmp_path / 'a.jsonl').read_text().count('\n') - 1
    assert kept > 0
    begun[:] = [()] * end
    assert cli.main([*call, str(tmp_path / 'a.png')]) == 0
    assert capsys.readouterr().out == whole
    columns = len(json.loads(whole).get('map', {}).get('spindle_speed_rpm', ()))
    # Of the probability one more call is of the cut itself, a thousand machines at its speed.
    assert len(begun) - end == (columns or 1100) - kept
    assert not (tmp_path / 'a.jsonl').exists()


def test_a_map_that_fails_is_a_sentence_and_leaves_nothing_in_the_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def failing(*_values: object, **_options: object) -> object:
        raise UnprovenError('The rightmost root')

    call = [
        'lobes',
        '--map',
        '--from',
        '2000',
        '--to',
        '2100',
        '--output',
        str(tmp_path / 'a.png'),
    ]
    with monkeypatch.context() as patch:
        patch.setattr(import_module('lathe_chatter.stability.growth_map'), '_growth', failing)
        assert cli.main(call) == 2
    assert 'change the frequency of one by' in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
    assert cli.main([*call, '--tool.mass', '0.06']) == 0


def test_a_chart_of_a_machine_marks_no_cut_that_nobody_has_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'mine.yaml'
    file.write_text(
        'tool: {modes: [{frequency: 120 Hz, damping_ratio: 4 %, mass: 2 kg}]}\n'
        'workpiece: rigid\n'
        'material: {cutting_coefficient: 2000 MPa, errors: {cutting_coefficient: 10 %}}\n'
    )
    call = ['lobes', '--machine', str(file), '--output', str(tmp_path / 'a.svg'), '--force']
    for more, known in ([], False), (['--depth-of-cut', '0.02 mm'], True):
        assert cli.main([*call, *more]) == 0
        assert ('the cut' in (tmp_path / 'a.svg').read_text(encoding='utf-8')) is known
        assert ('is stable with' in capsys.readouterr().out) is known


def test_the_legend_says_no_more_of_the_white_than_is_known(tmp_path: Path) -> None:
    """Here a cut on the bearing is stable beyond the open limit, and the area ends below it."""
    file, cut = tmp_path / 'a.svg', Cut(7200.0, 2e-3)
    assert cli.main(['lobes', '--output', str(file), '--from', '6500', '--to', '8000']) == 0
    found = safe_limit(Machine(), cut, 7200.0)
    assert found.depth_of_cut < found.seating_line < cut.depth_of_cut < found.seated_limit
    assert rightmost_root(Machine(), 7200.0, cut.depth_of_cut, seated=True).real < 0.0
    legend = file.read_text(encoding='utf-8')
    assert 'every smaller depth is stable' in legend
    assert 'small disturbances die out' not in legend


def test_the_machine_of_a_chart_is_an_object_in_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call = ['lobes', '--output', str(tmp_path / 'a.png'), '--json', '--force']
    assert cli.main([*call, '--machine', 'chucked_shaft']) == 0
    machine = json.loads(capsys.readouterr().out)['parameters']['machine']
    described = load_machine('chucked_shaft')
    assert load_machine(json.dumps(machine)).machine == described.machine
    assert machine['material']['cutting_coefficient'] == described.machine.cutting_coefficient
    assert cli.main(call) == 0
    assert json.loads(capsys.readouterr().out)['parameters']['machine'] is None


def test_a_chart_of_a_varied_speed_keeps_all_of_its_swing_in_the_range_of_the_spindle(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spindle = 'spindle: {slowest_speed: 2000 rpm, fastest_speed: 4400 rpm}'
    machine = f'{{{spindle}, cut: {{spindle_speed: 3000 rpm}}}}'
    call = [
        'lobes',
        '--machine',
        machine,
        '--output',
        str(tmp_path / 'a.png'),
        '--json',
        '--force',
    ]
    varied = ['--speed-variation-amplitude', '0.1', '--speed-variation-frequency', '20']
    few = ['--depth-limit', '0.1 mm']

    def chart(*more: str) -> tuple[float, float, str]:
        assert cli.main([*call, *few, *more]) == 0
        told = capsys.readouterr()
        speeds = json.loads(told.out)['spindle_speed_rpm']
        return speeds[0], speeds[-1], told.err

    assert chart()[:2] == (2000.0, 4400.0)
    low, high, said = chart(*varied)
    assert (low, high) == pytest.approx((2000.0 / 0.9, 4400.0 / 1.1))
    assert 'WARNING' not in said
    said = chart(*varied, '--to', '4400')[2]
    assert (
        'The chart has speeds at which the spindle with its swing of 10% leaves its range.' in said
    )
    said = chart(*varied, '--spindle-speed-rpm', '4200')[2]
    assert 'The spindle turns outside of what the machine file says it can' in said
    assert cli.main([*call, '--speed-variation-amplitude', '0.45']) == 2
    assert 'a swing that a spindle of 2000 to 4400 rev/min has' in capsys.readouterr().err


def test_a_chart_says_where_the_machine_of_the_paper_stands_in(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'tool.yaml'
    file.write_text('tool: {modes: [{frequency: 200 Hz, damping_ratio: 2 %, mass: 5 kg}]}\n')
    call = ['lobes', '--machine', str(file), '--force', '--output', str(tmp_path / 'a.png')]
    assert cli.main(call) == 0
    said = capsys.readouterr().out
    assert said.startswith('WARNING  The machine file tool lacks a workpiece (50 g'), (
        'before limits'
    )
    assert 'if it is rigid, add the line `workpiece: rigid`' in ' '.join(said.split())
    assert cli.main([*call, '--cutting-coefficient', '2e9', '--workpiece.mass', '60']) == 0
    assert 'WARNING' not in capsys.readouterr().out


@pytest.mark.parametrize('verb', ['lobes', 'knock-map'])
@pytest.mark.parametrize('option', ['unbalance', 'cutting-force-noise', 'acceleration-noise',
                                    'tool-runout', 'accelerometers', 'force-noise'])  # fmt: skip
def test_an_option_that_would_change_nothing_is_refused(
    verb: str, option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main([verb, f'--{option}', *([] if option == 'accelerometers' else ['1'])])
    assert ended.value.code == 2
    assert f'--{option}' in capsys.readouterr().err


def table(path: Path) -> dict[str, np.ndarray]:
    with path.open(encoding='utf-8') as file:
        names, *rows = csv.reader(file)
    return dict(zip(names, np.array(rows, float).T, strict=True))


def test_the_csv_has_what_the_picture_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(lobes, '_PROBABLE_MACHINES', 100)
    words = ['--from', '2000', '--to', '4000', '--json', '--csv']
    place = ['--output', str(tmp_path / 'a.png'), '--force']
    call = ['lobes', *words, str(tmp_path / 'sure.csv'), *place, '--uncertain', 'C=10%']
    assert cli.main(call) == 0
    told = json.loads(capsys.readouterr().out)['safe_with_95_percent']
    found = table(tmp_path / 'sure.csv')
    sure = found['safe_depth_with_95_percent']
    assert np.mean(sure < found['safe_depth']) > 0.9
    places = np.searchsorted(found['spindle_speed_rpm'], told['spindle_speed_rpm'])
    np.testing.assert_allclose(told['depth_of_cut'], sure[places], rtol=1e-12)
    # Where but the coefficient is uncertain, the limit of each machine is as its coefficient says.
    share = sure / found['safe_depth']
    exact = share[places[0]]
    assert 0.8 < exact < 0.9
    np.testing.assert_allclose(share[places], exact, rtol=1e-6)
    assert share.max() < 1.011 * exact
    assert told['depths'][told['probabilities'].index(0.95)] == told['depth_of_cut']
    assert told['depths'][0] >= told['depths'][2]
    assert cli.main(['lobes', *words, str(tmp_path / 'm.csv'), *place, '--map']) == 0
    told = json.loads(capsys.readouterr().out)['map']
    points = table(tmp_path / 'm-map.csv')
    assert points['growth_rate'].tolist() == np.ravel(told['growth_rate']).tolist()
    k = len(told['spindle_speed_rpm']) * 30 + 70
    root = rightmost_root(
        Machine(), points['spindle_speed_rpm'][k], points['depth_of_cut'][k],
        seated=bool(points['seated'][k]),
    )  # fmt: skip
    assert points['growth_rate'][k] == pytest.approx(root.real, abs=1e-6)
    assert cli.main([*call, '--map']) == 2
    assert '--uncertain' in capsys.readouterr().err
    assert cli.main(['lobes', '--csv', str(tmp_path / 'm.csv'), *place[:2], '--map']) == 2


@pytest.mark.parametrize(
    ('coefficient', 'cut', 'said'),
    [
        ('1500', '{feed: 0.2 mm/rev}', ['No cut is as deep as the lowest limit, 1']),
        ('1500 MPa', '{}', ['Where the workpiece seats is drawn for a feed of 2.5 mm/s']),
        ('1500 MPa', '{feed: 0.2 mm/rev}', []),
    ],
)
def test_what_a_machine_file_leads_one_to_doubt_is_said(
    coefficient: str, cut: str, said: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mode = '{modes: [{frequency: 300 Hz, damping_ratio: 3 %, mass: 2 kg}]}'
    (tmp_path / 'own.yaml').write_text(
        f'tool: {mode}\nworkpiece: {mode}\nmaterial: {{cutting_coefficient: {coefficient}}}\n'
        f'bearing: {{stiffness: 20 N/um, clearance: 5 um}}\ncut: {cut}\n'
    )
    words = ['lobes', '--machine', str(tmp_path / 'own.yaml'), '--from', '1000', '--to', '3000']
    assert cli.main([*words, '--output', str(tmp_path / 'own.svg')]) == 0
    warned = [line for line in capsys.readouterr().out.splitlines() if 'WARNING' in line]
    assert len(warned) == len(said)
    assert all(each in line for each, line in zip(said, warned, strict=True))


def test_the_knock_of_one_cut_without_bearing_is_drawn_over_its_depth(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = tmp_path / 'knock.jsonl'
    words = ['--bearing-contact', 'none', '--depths', '0.3 mm', '--step', '2']
    assert cli.main(['knock-map', *words, '--reach', '1', '--output', str(place)]) == 0
    capsys.readouterr()
    drawn = place.with_suffix('.svg').read_text(encoding='utf-8')
    assert 'depth of cut / mm' in drawn
    assert 'clearance / ' not in drawn
