"""A run in the hands of other programs: every number with its last bit, gaps told."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from scipy.io import loadmat, netcdf_file
from support.recorded import BOOL, NUMBER, STORE

from lathe_chatter.array_types import Array
from lathe_chatter.cli.main import main
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model.lathe_parameter_table import parameters_of
from lathe_chatter.recording import LatheRun, read_run, verify
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.samples.columns import UNITS

BLOCKS, ROWS, MISSING = 60, 20, 30


@pytest.fixture(scope='module')
def samples() -> Array:
    blocks = VirtualLathe().advance(BLOCKS * ROWS).reshape(BLOCKS, ROWS, -1)
    return np.concatenate(np.delete(blocks, MISSING, axis=0))


@pytest.fixture
def folder(tmp_path: Path, samples: Array) -> Path:
    """A run in which one block is missing."""
    with LatheRun(tmp_path / 'run', parameters_of(VirtualLathe())) as run:
        for block in samples.reshape(BLOCKS - 1, ROWS, -1):
            run.write(block)
    return tmp_path / 'run'


def test_csv_is_read_back_to_the_last_bit(
    folder: Path, samples: Array, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['export', str(folder), '--json']) == 0
    told = capsys.readouterr()
    figures = json.loads(told.out)
    assert figures['samples'] == len(samples)
    assert figures['gaps'] == [[0.06, 0.0621]]
    assert 'samples are missing between 0.060000 s and 0.062100 s' in told.err
    with Path(figures['path']).open() as stream:
        names, *rows = csv.reader(stream)
    assert tuple(names) == tuple(f'{name} [{UNITS[name]}]' for name in SAMPLE_COLUMNS)
    assert np.array(rows, float).tobytes() == samples.tobytes()


def test_columns_and_a_range_of_time(folder: Path, samples: Array, tmp_path: Path) -> None:
    out = tmp_path / 'part.csv'
    words = ['--columns', 'cutting_force,chip_thickness', '--start', '0.01', '--end', '0.02']
    assert main(['export', str(folder), '--output', str(out), *words]) == 0
    found = np.genfromtxt(out, delimiter=',', names=True)
    assert found.dtype.names == ('time_s', 'chip_thickness_m', 'cutting_force_N')
    inside = samples[(samples[:, 0] >= 0.01) & (samples[:, 0] <= 0.02)]
    assert found['time_s'].tolist() == inside[:, 0].tolist()
    assert found['cutting_force_N'].tolist() == inside[:, 7].tolist()


def test_unrolled_each_sample_is_a_message_at_its_simulated_time(
    folder: Path, samples: Array, tmp_path: Path
) -> None:
    assert main(['export', str(folder), '--unrolled']) == 0
    out = tmp_path / 'run-unrolled'
    stamps = [round(time * 1e9) for time in samples[:, 0]]
    with Reader(out) as reader:
        signals = [each for each in reader.connections if each.topic.startswith('/lathe/')]
        assert {each.msgtype for each in signals} == {NUMBER}
        found = {each.topic: [] for each in signals}
        for each, stamp, data in reader.messages(signals):
            found[each.topic].append((stamp, STORE.deserialize_cdr(data, NUMBER).data))
    for k, name in enumerate(SAMPLE_COLUMNS[1:], 1):
        pairs = list(zip(stamps, samples[:, k].tolist(), strict=True))
        assert found[f'/lathe/samples/{name}'] == pairs
    with (out / 'run-unrolled_0.mcap').open('rb') as stream:
        count = sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages())
    assert count == 7 * len(samples) + 1  # and the parameters


def test_unrolled_cuts_follow_each_other_with_what_the_monitor_said(tmp_path: Path) -> None:
    with LatheRun(tmp_path / 'run', parameters_of(VirtualLathe())) as run:
        for _ in range(3):
            lathe = VirtualLathe()
            run.write(lathe.advance(3))
            run.publish('/chatter_monitor/chatter', BOOL, data=True)
            run.write(lathe.advance(3))
    chosen = {'whole': [], 'part': ['--start', '0.0001', '--end', '0.0004']}
    for name, range_of_time in chosen.items():
        out = str(tmp_path / name)
        words = ['--unrolled', '--columns', 'cutting_force', '--output', out, *range_of_time]
        assert main(['export', str(tmp_path / 'run'), *words]) == 0
    for name, within in (('whole', 6), ('part', 4)):
        unrolled = read_run(tmp_path / name)
        raw = unrolled.raw_messages('/lathe/samples/cutting_force')
        expected = [6 * cut + k for cut in range(3) for k in range(1, within + 1)]
        assert [each.log_time for each in raw] == [100_000 * k for k in expected]
        flags = [each.log_time for each in unrolled.raw_messages('/chatter_monitor/chatter')]
        assert all(3 <= time / 100_000 - 6 * cut <= 6 for cut, time in enumerate(flags))
        assert len(flags) == 3


def test_nothing_is_overwritten(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'run.csv').write_text('mine')
    assert main(['export', str(folder)]) == 2
    assert 'exists already, and no file is overwritten' in capsys.readouterr().err
    assert (tmp_path / 'run.csv').read_text() == 'mine'


def test_a_column_that_is_not_there_is_one_sentence(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['export', str(folder), '--columns', 'speed']) == 2
    assert (
        'have no column speed, only time, spindle_angle, tool_displacement,'
        in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    'form', [(), ('--format', 'mat'), ('--format', 'hdf5'), ('--unrolled',)], ids=str
)
def test_an_export_that_fails_leaves_nothing_in_the_way_of_the_next(
    folder: Path, form: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    if 'hdf5' in form:
        pytest.importorskip('h5py')
    file = folder / 'run_0.mcap'
    whole = file.read_bytes()
    flipped = bytearray(whole)
    with file.open('rb') as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[-1]
    flipped[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 1  # amid samples
    file.write_bytes(flipped)
    before = sorted(folder.parent.iterdir())
    assert main(['export', str(folder), *form]) == 2
    assert 'is damaged' in capsys.readouterr().err
    assert sorted(folder.parent.iterdir()) == before
    file.write_bytes(whole)
    assert main(['export', str(folder), *form]) == 0


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (('--start', '5', '--end', '3'), 'at most the end, 3 s'),
        (('--start', 'nan'), 'start is nan s'),
        (('--start', '1e6'), 'holds no samples from 1000000'),
        (('--topic', '/x/samples'), 'no samples of the topic /x/samples'),
        (('--columns', ''), 'names with commas between them'),
    ],
)
def test_a_choice_of_nothing_is_one_sentence_and_leaves_no_file(
    folder: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...], words: str
) -> None:
    before = sorted(folder.parent.iterdir())
    assert main(['export', str(folder), *options]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert 'Traceback' not in said
    assert sorted(folder.parent.iterdir()) == before


def test_parquet_holds_every_bit_units_and_gaps(
    folder: Path, samples: Array, tmp_path: Path
) -> None:
    parquet = pytest.importorskip('pyarrow.parquet')
    assert main(['export', str(folder), '--format', 'parquet']) == 0
    table = parquet.read_table(tmp_path / 'run.parquet')
    assert tuple(table.column_names) == SAMPLE_COLUMNS
    columns = [table.column(name).to_numpy() for name in SAMPLE_COLUMNS]
    assert np.column_stack(columns).tobytes() == samples.tobytes()
    assert table.schema.field('cutting_force').metadata == {b'unit': b'N'}
    told = parquet.read_metadata(tmp_path / 'run.parquet').metadata
    assert json.loads(told[b'gaps']) == [[0.06, 0.0621]]


def test_mat_holds_every_bit_units_and_gaps(folder: Path, samples: Array, tmp_path: Path) -> None:
    assert main(['export', str(folder), '--format', 'mat']) == 0
    found = loadmat(tmp_path / 'run.mat', simplify_cells=True)
    for k, name in enumerate(SAMPLE_COLUMNS):
        assert found[name].tobytes() == np.ascontiguousarray(samples[:, k]).tobytes()
    assert found['units'] == {name: UNITS[name] for name in SAMPLE_COLUMNS}
    assert np.reshape(found['gaps'], (-1, 2)).tolist() == [[0.06, 0.0621]]
    assert found['restarts'].size == 0
    assert loadmat(tmp_path / 'run.mat')['time'].shape == (len(samples), 1)


def test_hdf5_holds_every_bit_units_and_gaps(folder: Path, samples: Array, tmp_path: Path) -> None:
    h5py = pytest.importorskip('h5py')
    assert main(['export', str(folder), '--format', 'hdf5']) == 0
    with h5py.File(tmp_path / 'run.h5') as found:
        for k, name in enumerate(SAMPLE_COLUMNS):
            assert found[name][:].tobytes() == np.ascontiguousarray(samples[:, k]).tobytes()
            assert found[name].attrs['units'] == UNITS[name]
        assert found['gaps'][:].tolist() == [[0.06, 0.0621]]
        assert found['restarts'].shape == (0, 2)


def test_unrolled_other_topics_stand_where_they_came(tmp_path: Path) -> None:
    lathe = VirtualLathe()
    with LatheRun(tmp_path / 'run', parameters_of(lathe), simulated=True) as run:
        for k in range(20):
            run.write(lathe.advance(20))
            if k == 9:
                run.publish('/chatter_monitor/chatter', BOOL, data=True)
    assert main(['export', str(tmp_path / 'run'), '--unrolled']) == 0
    (flag,) = read_run(tmp_path / 'run-unrolled').messages('/chatter_monitor/chatter')
    assert flag.message.data
    assert flag.log_time == 20_000_000  # with the block that ends at 0.02 s
    assert verify(tmp_path / 'run-unrolled').complete


def test_pandas_and_xarray_have_the_same_numbers(folder: Path, samples: Array) -> None:
    pytest.importorskip('pandas')
    pytest.importorskip('xarray')
    run = read_run(folder)
    frame = run.to_pandas(columns=['chip_thickness'], start=0.01)
    inside = samples[samples[:, 0] >= 0.01]
    assert frame.index.to_numpy().tobytes() == np.ascontiguousarray(inside[:, 0]).tobytes()
    assert frame['chip_thickness'].to_list() == inside[:, 6].tolist()
    assert frame.attrs['gaps'] == [(0.06, 0.0621)]
    data = run.to_xarray()
    assert data['tool_velocity'].attrs == {'units': 'm/s'}
    assert data['tool_velocity'].sel(time=0.05).item() == samples[499, 3]
    assert data.attrs['gaps'].tolist() == [0.06, 0.0621]


def test_a_data_set_of_xarray_is_a_netcdf_file_with_its_units(
    folder: Path, samples: Array, tmp_path: Path
) -> None:
    xarray = pytest.importorskip('xarray')
    run = read_run(folder)
    for end in (0.05, 1.0):  # without and with a gap
        data = run.to_xarray(end=end)
        data.to_netcdf(tmp_path / 'x.nc', engine='scipy')
        with netcdf_file(tmp_path / 'x.nc', mmap=False) as found:
            assert found.variables['tool_velocity'].units == b'm/s'
            assert found.variables['time'].units == b's'
            assert np.ravel(found.gaps).tolist() == ([] if end < 0.06 else [0.06, 0.0621])
            inside = samples[samples[:, 0] <= end]
            assert found.variables['tool_velocity'][:].tolist() == inside[:, 3].tolist()
        with xarray.open_dataset(tmp_path / 'x.nc') as again:
            assert again.equals(data)


@pytest.mark.parametrize('name', ['pandas', 'xarray'])
def test_without_the_library_it_is_one_sentence(name: str, folder: Path) -> None:
    try:
        __import__(name)
    except ImportError:
        with pytest.raises(Exception, match=f'needs {name}, which is not installed'):
            getattr(read_run(folder), f'to_{name}')()
    else:
        pytest.skip(f'{name} is installed')
