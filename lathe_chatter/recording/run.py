"""`read_run`: a recorded run as arrays and messages."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from mcap.writer import MCAP0_MAGIC

from lathe_chatter.errors import RunReadError
from lathe_chatter.html_table import html_table
from lathe_chatter.recording.bag_folder import RunFolder, refuse_other_format, run_folder
from lathe_chatter.recording.dataframes import to_pandas, to_xarray
from lathe_chatter.recording.decoding import Recorded, decoded
from lathe_chatter.recording.mcap_chunk_walk import Damage
from lathe_chatter.recording.recorded_file import Contents, Note, Raw, RecordedFile
from lathe_chatter.recording.ros_messages import namespace_of
from lathe_chatter.recording.sample_blocks import TIME, SampleBlocks, one_cut
from lathe_chatter.recording.sample_order import sample_blocks
from lathe_chatter.recording.sample_series import Samples, joined, selection
from lathe_chatter.samples.codec import SAMPLES_TYPE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ['Raw', 'Recorded', 'Run', 'RunReadError', 'Samples', 'read_run']

MONITOR = 'chatter_monitor/'
"""In the names of the topics of a monitor."""
_REST = 'What is left of it can be saved by `lathe-chatter recover`.'


@dataclass(frozen=True)
class Run:
    """A recorded run; nothing is read before it is asked for, and everything read has its CRC.

    Attributes:
        path: As it was given.
        files: The MCAP files in order.
        damaged: Whether what is left of damaged files is wanted; else they raise.
        damage: What could not be read so far, where `damaged`.
        folder: What its folder holds; None where it is one file.
    """

    path: Path
    files: tuple[Path, ...]
    damaged: bool = False
    damage: list[Damage] = field(default_factory=list)
    folder: RunFolder | None = None

    @cached_property
    def topics(self) -> dict[str, str]:
        """The type of each topic by name; empty for one whose messages have no schema.

        Raises:
            RunReadError: If a file is damaged.
        """
        found: dict[str, str] = {}
        for file in self.opened:
            if not file.has_end:
                end = file.path.stat().st_size
                self._on_damage(Damage(file.path, end, end, 'it has no sound end'))
            found |= file.topics()
        return found

    def notes(self) -> list[Note]:
        """What was noted beside the messages, in every file, in order."""
        return [note for file in self.opened for note in file.notes()]

    def attachments(self) -> list[Any]:
        """Files that were kept in the run, as mcap has them: name, media_type, data."""
        return [each for file in self.opened for each in file.attachments()]

    def contents(self) -> Iterator[tuple[RecordedFile, Contents]]:
        """The messages of each chunk of each file, as arrays, in the order of the files.

        Raises:
            RunReadError: If a file is damaged.
        """
        for file in self.opened:
            for contents in file.contents():
                yield file, contents

    def count_of_messages(self) -> int:
        """How many messages the files say that they have; 0 where they do not say."""
        known = [file.known.statistics for file in self.opened]
        return sum(statistics.message_count for statistics in known if statistics is not None)

    def raw_messages(self, *topics: str) -> Iterator[Raw]:
        """The messages of some topics, or of all if none is named, as they are in the file.

        In order of reception, whatever their order in a file.

        Raises:
            RunReadError: If a file is damaged.
        """
        for file in self.opened:
            yield from file.raw_messages(topics)

    def messages(self, *topics: str, skip: bool = False) -> Iterator[Recorded]:
        """The messages of some topics in order of reception, decoded.

        They are decoded by the definitions of their types in the file, whatever is installed.

        Args:
            topics: Names; all where none is named.
            skip: Whether those that cannot be decoded are left out, instead of raising.

        Raises:
            RunReadError: If a file is damaged, or a message cannot be decoded.
        """
        for raw in self.raw_messages(*topics):
            found = decoded(raw)
            if isinstance(found, Recorded):
                yield found
            elif not skip:
                raise RunReadError(f'{self.path}: {found}')

    def sample_blocks(
        self,
        topic: str | None = None,
        columns: Iterable[str] | None = None,
        received: Sequence[tuple[int, int]] = (),
    ) -> Iterator[SampleBlocks]:
        """The samples of a lathe as they were recorded, some 4 s at a time.

        Args:
            topic: Of the samples; may be left out where the run has one lathe.
            columns: Which signals besides the time; all by default.
            received: If given, what was received outside of these spans, ns since the epoch, may
                be left out: a few seconds of a long run are there at once.

        Raises:
            RunReadError: If a file is damaged, or there are several lathes and no topic is named.
            LayoutError: If a message is no block of samples.
        """
        name = topic or self.samples_topic()
        wanted = None if columns is None else tuple(columns)
        for file in self.opened:
            yield from sample_blocks(file, name, wanted, received)

    def samples(
        self,
        topic: str | None = None,
        *,
        columns: Iterable[str] | None = None,
        start: float = -np.inf,
        end: float = np.inf,
        cut: int | None = None,
    ) -> Samples:
        """The samples of a lathe, joined; `gaps` and `restarts` say where.

        Args:
            topic: Of the samples; may be left out where the run has one lathe.
            columns: Which signals; all by default.
            start: Simulated time of the first wanted, s.
            end: Simulated time of the last wanted, s.
            cut: Those of one cut alone, the first being 0; a reset or a new lathe begins another.

        Raises:
            ParameterError: If columns, times or cut are no such thing.
            RunReadError: If a file is damaged, there are no samples, no such columns, or several
                lathes and no topic is named.
            LayoutError: If a message is no block of samples.
        """
        name = topic or self.samples_topic()
        wanted = selection(name, columns, start, end)
        expected = sum(file.count(name) for file in self.opened)
        blocks = self.sample_blocks(name, wanted.columns)
        found = joined(blocks if cut is None else one_cut(blocks, cut), expected, wanted)
        if found is None:
            raise self.without_samples(name)
        missing = sorted(set(wanted.columns or ()) - set(found.columns))
        if missing:
            names = ', '.join(missing)
            raise RunReadError(f'The samples of {name} in {self.path} have no column {names}.')
        return found

    def plot(self, *columns: str, axes: Axes | None = None, topic: str | None = None) -> Axes:
        """Plot samples over simulated time, with the times of flagged chatter shaded.

        Args:
            columns: Their names, of one unit; by default the displacements.
            axes: To draw into; by default those of a new figure.
            topic: Of the samples; may be left out where the run has one lathe.

        Returns:
            The axes.

        Raises:
            ParameterError: If there is no such column, or they have several units.
            RunReadError: If a file is damaged, or there are several lathes and no topic is named.
        """
        from lathe_chatter.recording.plot_samples import plot_run

        return plot_run(self, columns, axes, topic)

    def __repr__(self) -> str:
        """Where it is, and of how many files."""
        return f'<Run {self.path}: {len(self.files)} file{"s" * (len(self.files) != 1)}>'

    def _repr_html_(self) -> str:
        """As a notebook shows it: what its files hold, by what they say themselves."""
        rows: list[tuple[str, object, str]] = [
            ('path', self.path, ''),
            ('files', len(self.files), ''),
            ('messages', self.count_of_messages(), ''),
        ]
        rows += [(topic, kind, '') for topic, kind in sorted(self.topics.items())]
        return html_table('Run', rows)

    def without_samples(self, topic: str) -> RunReadError:
        """The error of a topic that has no samples: it says which have."""
        kinds = self.topics.items()
        others = sorted(name for name, kind in kinds if kind == SAMPLES_TYPE and name != topic)
        hint = f': those that it has are of {", ".join(others)}.' if others else '.'
        return RunReadError(f'{self.path} holds no samples of the topic {topic}{hint}')

    def count_of_samples(self, topic: str | None = None) -> int | None:
        """About how many samples a lathe has here; None where the files do not say."""
        name = topic or self.samples_topic()
        blocks = sum(file.count(name) for file in self.opened)
        first = next(iter(self.sample_blocks(name)), None) if blocks else None
        return None if first is None else blocks * int(first.rows[0])

    def to_pandas(self, **chosen: Any) -> Any:
        """The samples as a pandas DataFrame by simulated time; see `dataframes.to_pandas`.

        Args:
            chosen: Topic, columns, start, end and cut, as for `samples`.

        Raises:
            MissingPackageError: If pandas is not installed.
            RunReadError: As `samples`.
        """
        return to_pandas(self._with_time(chosen))

    def to_xarray(self, **chosen: Any) -> Any:
        """The samples as an xarray Dataset over simulated time; see `dataframes.to_xarray`.

        Args:
            chosen: Topic, columns, start, end and cut, as for `samples`.

        Raises:
            MissingPackageError: If xarray is not installed.
            RunReadError: As `samples`.
        """
        return to_xarray(self._with_time(chosen))

    def _with_time(self, chosen: Mapping[str, Any]) -> Samples:
        columns: Iterable[str] | None = chosen.get('columns')
        return self.samples(**{**chosen, 'columns': columns and [TIME, *columns]})

    def samples_topic(self, named: str | None = None) -> str:
        """The topic of the samples: the one that is named, or that of the one lathe of the run.

        Raises:
            RunReadError: If there is none, or several and none is named.
        """
        names = self.samples_topics()
        if named is not None:
            if named not in names:
                raise self.without_samples(named)
            return named
        if not names:
            raise RunReadError(f'{self.path} holds no samples of a lathe.')
        if len(names) > 1:
            listed = ', '.join(names)
            raise RunReadError(
                f'{self.path} holds several lathes: name one by its topic, {listed}.'
            )
        return names[0]

    def monitor_topics(self, samples: str) -> list[str]:
        """What a monitor said of a lathe: the one beside it, or else the only one of the run.

        Args:
            samples: The topic of the samples.
        """
        names = sorted(name for name in self.topics if MONITOR in name)
        beside = [name for name in names if namespace_of(name) == namespace_of(samples)]
        return beside or (names if len(self.samples_topics()) == 1 else [])

    def samples_topics(self) -> list[str]:
        """The topics of the samples of all its lathes, by name."""
        return sorted(
            name
            for name, kind in self.topics.items()
            if name.endswith('/samples') and kind == SAMPLES_TYPE
        )

    @cached_property
    def opened(self) -> tuple[RecordedFile, ...]:
        """Its files, each to be walked when it is asked."""
        return tuple(RecordedFile(path, self._on_damage) for path in self.files)

    def _on_damage(self, damage: Damage) -> None:
        if not self.damaged:
            raise RunReadError(
                f'{damage.file} is damaged at byte {damage.start}: {damage.reason}. {_REST}'
            )
        if damage not in self.damage:
            self.damage.append(damage)


def _begins_as_mcap(path: Path) -> bool:
    with path.open('rb') as stream:
        return stream.read(len(MCAP0_MAGIC)) == bytes(MCAP0_MAGIC)


def read_run(path: Path | str, *, damaged: bool = False) -> Run:
    """Open a recorded run.

    Args:
        path: A rosbag2 folder with MCAP files, or one MCAP file.
        damaged: Whether to hand out what is left of damaged files, instead of raising; what is
            missing is then in `Run.damage`, and among the gaps of the samples.

    Raises:
        RunReadError: If there is no such run, or a file of it is missing.
    """
    path = Path(path)
    if path.is_file():
        refuse_other_format(path)
        if path.suffix != '.mcap' and not _begins_as_mcap(path):
            raise RunReadError(f'{path} is no MCAP file.')
        return Run(path, (path,), damaged)
    found = run_folder(path)
    absent = [Damage(path / name, 0, 0, 'the file is missing') for name in found.missing]
    if absent and not damaged:
        names = ', '.join(found.missing)
        raise RunReadError(f'{path} lacks {names}. {_REST}')
    return Run(path, found.files, damaged, absent, found)
