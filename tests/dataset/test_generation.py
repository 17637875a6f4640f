"""The same data set from everybody, whatever interrupts; and nothing is mixed or lost."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from lathe_chatter.cli import main as cli
from lathe_chatter.cli.worker_options import open_executor
from lathe_chatter.dataset import generation, load_plan, make_dataset, read_windows
from lathe_chatter.dataset.plan import Plan
from lathe_chatter.errors import DatasetError, ResultFileError
from lathe_chatter.recording import read_run

pytest.importorskip('pyarrow')

TEXT = """
machines: 12
runs: 2
duration: 0.4 s
cut:
  depth_of_cut: {of_limit: {uniform: [0.5, 1.5]}}
  bearing_contact: {choice: [none, seated]}
  force_noise: 0.001
events: [{at: 0.2 s, set: {spindle_speed_rpm: {uniform: [2800, 3200]}}}]
windows: {length: 0.05 s}
"""


@pytest.fixture(autouse=True)
def many_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """A part has one machine."""
    monkeypatch.setattr(generation, '_PART_SIZE', 1.0)


def plan_of(folder: Path, more: str = '') -> Plan:
    path = folder / 'plan.yaml'
    path.write_text(TEXT + more, encoding='utf-8')
    return load_plan(path)


def digests(folder: Path) -> dict[str, str]:
    files = sorted(file for file in folder.rglob('*') if file.is_file())
    return {
        file.relative_to(folder).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in files
    }


def test_the_same_bytes_from_threads_processes_and_dask(tmp_path: Path) -> None:
    plan = plan_of(tmp_path)
    with ThreadPoolExecutor(1) as pool:
        make_dataset(plan, tmp_path / 'one', executor=pool)
    expected = digests(tmp_path / 'one')
    assert len(expected) == 14
    with open_executor(2) as processes:
        make_dataset(plan, tmp_path / 'two', executor=processes)
    assert digests(tmp_path / 'two') == expected
    pytest.importorskip('distributed')
    with open_executor(2, 'local') as dask:
        make_dataset(plan, tmp_path / 'dask', executor=dask)
    assert digests(tmp_path / 'dask') == expected


def test_what_was_interrupted_goes_on_to_the_same_bytes(tmp_path: Path) -> None:
    plan, folder = plan_of(tmp_path), tmp_path / 'parts'
    make_dataset(plan, tmp_path / 'whole')
    told: list[int] = []

    def interrupt(done: int, total: int) -> None:
        assert total == plan.windows
        told.append(done)
        if done >= total // 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make_dataset(plan, folder, progress=interrupt)
    assert told == sorted(told)
    there = {path: path.stat().st_mtime_ns for path in folder.glob('*/part-*')}
    assert 0 < len(there) < 12
    card = (folder / generation.CARD).read_text(encoding='utf-8')
    assert '**Not finished.**' in card
    assert '192 windows of simulated turning' in card
    assert TEXT.strip() in card
    assert '| split |' not in card
    # As a power cut may leave it: a part without its line, a line without its part, one cut
    # short, the beginnings of another, and a line that was cut off.
    manifest = folder / generation.MANIFEST
    lines = manifest.read_text(encoding='utf-8').splitlines()
    manifest.write_text('\n'.join([*lines[:-1], lines[-1][:40]]), encoding='utf-8')
    (folder / json.loads(lines[1])['part']).unlink()
    short = folder / json.loads(lines[2])['part']
    short.write_bytes(short.read_bytes()[:100])
    for place in (manifest, folder / json.loads(lines[1])['part']):
        beside = place.with_name(f'.{place.name}.partial')
        beside.mkdir()
        (beside / 'part').write_bytes(b'x')
    make_dataset(plan, folder)
    assert digests(folder) == digests(tmp_path / 'whole')
    kept = [path for path, time in there.items() if path.stat().st_mtime_ns == time]
    assert len(kept) == len(there) - 3
    before = {path: path.stat().st_mtime_ns for path in folder.glob('*/part-*')}
    make_dataset(plan, folder)  # once more: there is nothing to do
    assert before == {path: path.stat().st_mtime_ns for path in folder.glob('*/part-*')}


def test_killed_and_called_again(tmp_path: Path) -> None:
    """The command itself, by SIGKILL in the middle."""
    text = TEXT.replace('machines: 12', 'machines: 250')
    (tmp_path / 'plan.yaml').write_text(text, encoding='utf-8')
    folder = tmp_path / 'data'
    call = [sys.executable, '-m', 'lathe_chatter.cli', 'dataset', 'plan.yaml', '--workers', '1']
    process = subprocess.Popen(
        [*call, '--output', 'data'], cwd=tmp_path, start_new_session=True,
        stdout=subprocess.DEVNULL,
    )  # fmt: skip
    while process.poll() is None and not any(folder.glob('*/part-*')):
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    whole = load_plan(tmp_path / 'plan.yaml')
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(generation, '_PART_SIZE', 8e6)  # as the command has it
        assert 0 < len([*folder.glob('*/part-*')]) <= len(generation.parts_of(whole)) == 3
        make_dataset(whole, folder)
        make_dataset(whole, tmp_path / 'other')
    assert digests(folder) == digests(tmp_path / 'other')


def test_machines_of_one_split_are_in_no_other_and_the_card_says_so(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, 'splits: {train: 50 %, check: 25 %, test: 25 %}')
    make_dataset(plan, tmp_path / 'data')
    seen = [set(read_windows(tmp_path / 'data', split)['machine']) for split in plan.splits]
    assert [len(machines) for machines in seen] == [6, 3, 3]
    assert len(set.union(*seen)) == 12
    every = read_windows(tmp_path / 'data')
    card = (tmp_path / 'data' / generation.CARD).read_text(encoding='utf-8')
    assert f'{len(every["stable"])} windows of simulated turning' in card
    own = read_windows(tmp_path / 'data', 'train')['stable']
    assert f'| train | 6 | {len(own)} | {100.0 * own.mean():.1f} % |' in card
    for name in every:
        assert f'| `{name}` |' in card
    assert 'Not finished' not in card
    assert re.search(r'`spindle_speed_rpm` \| rev/min \| .*; at the end of the window \|', card)


def test_the_card_holds_the_machine_file_and_says_what_the_samples_do_not_show(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    slow = 'machine: {machine: chucked_shaft}\nsensors: {sample_rate: 500 Hz}\n'
    plan = plan_of(tmp_path, slow)
    assert not cli.main(['dataset', str(tmp_path / 'plan.yaml'), '--dry-run'])
    assert 'WARNING  The machine vibrates at up to' in capsys.readouterr().out
    make_dataset(plan, tmp_path / 'd')
    card = (tmp_path / 'd' / generation.CARD).read_text(encoding='utf-8')
    assert '12 of the machines can vibrate at more than a third of the sample rate' in card
    (text,) = plan.machine['machine'].values
    assert text.rstrip() in card
    enough = TEXT + slow.replace('500', '20000')
    (tmp_path / 'plan.yaml').write_text(enough, encoding='utf-8')
    make_dataset(load_plan(tmp_path / 'plan.yaml'), tmp_path / 'e')
    assert 'third of the sample rate' not in (tmp_path / 'e' / generation.CARD).read_text()


@pytest.mark.parametrize('form', ['hdf5', 'zarr'])
def test_the_same_windows_in_every_form(form: str, tmp_path: Path) -> None:
    pytest.importorskip({'hdf5': 'h5py'}.get(form, form))
    one, other = plan_of(tmp_path), plan_of(tmp_path, f'form: {form}')
    make_dataset(one, tmp_path / 'parquet')
    entries = make_dataset(other, tmp_path / form)
    found, expected = read_windows(tmp_path / form), read_windows(tmp_path / 'parquet')
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        assert np.array_equal(values, found[name], equal_nan=values.dtype.kind == 'f'), name
    again = make_dataset(other, tmp_path / 'again')
    assert digests(tmp_path / 'again') == digests(tmp_path / form)
    assert [e['windows_sha256'] for e in entries] == [e['windows_sha256'] for e in again]


@pytest.mark.parametrize('form', ['parquet', 'hdf5', 'zarr'])
def test_every_column_of_a_part_has_the_unit_that_the_card_says(form: str, tmp_path: Path) -> None:
    """As the libraries of the formats read it."""
    library = pytest.importorskip({'hdf5': 'h5py', 'parquet': 'pyarrow.parquet'}.get(form, form))
    make_dataset(plan_of(tmp_path, f'form: {form}\n'), tmp_path / form)
    part = next((tmp_path / form).glob('train/part-*'))
    if form == 'parquet':
        schema = library.read_schema(part)
        found = {name: schema.field(name).metadata[b'unit'].decode() for name in schema.names}
    else:
        file = library.File(part) if form == 'hdf5' else library.open_group(str(part), mode='r')
        found = {name: file[name].attrs['units'] for name in file}
    card = (tmp_path / form / generation.CARD).read_text(encoding='utf-8')
    rows = [line.split('|') for line in card.splitlines() if line.startswith('| `')]
    assert {row[1].strip(' `'): row[2].strip() for row in rows} == {
        name: unit or '1' for name, unit in found.items()
    }
    assert found['tool_displacement'] == found['depth_of_cut'] == 'm'
    assert found['growth_rate'] == '1/s'


def test_whole_runs_hold_the_samples_of_the_windows(tmp_path: Path) -> None:
    windows, runs = plan_of(tmp_path), plan_of(tmp_path, 'form: mcap')
    make_dataset(windows, tmp_path / 'windows')
    entries = make_dataset(runs, tmp_path / 'runs')
    table = read_windows(tmp_path / 'windows', 'test')
    for folder in sorted((tmp_path / 'runs' / 'test').glob('*/machine_*')):
        machine, number = (int(word) for word in folder.name.split('_')[1::2])
        samples = read_run(folder).samples().columns['tool_displacement']
        own = (table['machine'] == machine) & (table['run'] == number)
        for signal_, start in zip(
            table['tool_displacement'][own], table['start'][own], strict=True
        ):
            first = round(start * 1e4)
            assert samples[first : first + 500].astype('f4').tobytes() == signal_.tobytes()
    truth = [
        json.loads(line)
        for file in sorted((tmp_path / 'runs' / 'test').glob('*/truth.jsonl'))
        for line in file.read_text(encoding='utf-8').splitlines()
    ]
    assert [row['growth_rate'] for row in truth] == table['growth_rate'].tolist()
    assert sum(entry['windows'] for entry in entries) == windows.windows


def test_a_folder_of_something_else_is_left_as_it_is(tmp_path: Path) -> None:
    plan, folder = plan_of(tmp_path), tmp_path / 'data'
    folder.mkdir()
    (folder / 'thesis.txt').write_text('mine', encoding='utf-8')
    with pytest.raises(DatasetError, match='holds other files'):
        make_dataset(plan, folder)
    (folder / 'thesis.txt').unlink()
    make_dataset(plan, folder)
    before = digests(folder)
    with pytest.raises(ResultFileError, match='holds other results, not of the same plan'):
        make_dataset(plan_of(tmp_path, 'seed: 2'), folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(generation, 'code_identity', lambda: 'lathe_chatter 9.9.9')
        with pytest.raises(ResultFileError, match=r'begun with .* and this is lathe_chatter 9'):
            make_dataset(plan, folder)
    assert digests(folder) == before
    make_dataset(plan_of(tmp_path, '# a comment, or a title, makes no other data'), folder)


def test_a_disk_that_is_full_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, folder = plan_of(tmp_path), tmp_path / 'data'
    usual, written = Path.write_bytes, list[Path]()

    def full(path: Path, content: bytes) -> int:
        written.append(path)
        if len(written) == 6:
            usual(path, content[:100])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        return usual(path, content)

    monkeypatch.setattr(Path, 'write_bytes', full)
    with pytest.raises(DatasetError, match='No space left on device; what is there is whole'):
        make_dataset(plan, folder)
    monkeypatch.undo()
    monkeypatch.setattr(generation, '_PART_SIZE', 1.0)
    assert len([*folder.glob('*/*')]) == 4
    make_dataset(plan, folder)
    make_dataset(plan, tmp_path / 'other')
    assert digests(folder) == digests(tmp_path / 'other')


def test_the_command_estimates_makes_and_tells(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan_of(tmp_path)
    plan, folder = str(tmp_path / 'plan.yaml'), tmp_path / 'data'
    assert cli.main(['dataset', plan, '--output', str(folder), '--dry-run']) == 0
    said = capsys.readouterr().out
    assert '12 machines x 2 runs x 8 windows of 2 x 500 samples in 12 parts: about' in said
    assert not folder.exists()
    assert cli.main(['dataset', plan, '--output', str(folder), '--workers', '1', '--json']) == 0
    told = json.loads(capsys.readouterr().out)
    assert told['windows'] == 192
    assert told['stable'] == int(read_windows(folder)['stable'].sum())
    assert cli.main(['dataset', plan, '--output', str(folder), '--workers', '1']) == 0
    said = capsys.readouterr().out
    assert '192 windows' in said
    assert 'in 12 parts: about' not in said, 'nothing is missing'
    assert cli.main(['dataset', plan, '--output', str(folder), '--workers', '0']) == 2
    assert '--workers is 0' in capsys.readouterr().err
    assert cli.main(['dataset', str(tmp_path / 'no.yaml')]) == 2
    assert 'cannot be read: No such file' in capsys.readouterr().err


@pytest.mark.parametrize('whole', [0, 3])
def test_an_interrupted_command_says_how_many_parts_are_there(
    whole: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plan_of(tmp_path)
    folder, written = tmp_path / 'data', list[Path]()
    usual = generation._write

    def stopping(path: Path, files: generation.Files) -> None:
        if len(written) == 1 + whole:  # the card is there from the beginning
            raise KeyboardInterrupt
        usual(path, files)
        written.append(path)

    call = ['dataset', str(tmp_path / 'plan.yaml'), '--output', str(folder), '--workers', '1']
    with monkeypatch.context() as patch:
        patch.setattr(generation, '_write', stopping)
        assert cli.main(call) == 130
    said = ' '.join(capsys.readouterr().out.split())
    kept = f': 3 of 12 parts are in {folder}, and the same call goes on from them.'
    none = ' before the first part was whole, so nothing is kept: the same call begins again.'
    assert f'Interrupted{kept if whole else none}' in said
    assert all(path.exists() for path in written)
    assert cli.main(call) == 0
    assert len([*folder.glob('*/part-*')]) == 12
