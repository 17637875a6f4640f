"""What `verify` finds in a run."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

from lathe_chatter.recording.run import Run


class Finding(NamedTuple):
    """Something that is to be known about a run.

    Attributes:
        loss: Whether something is missing or damaged; else it is a remark.
        text: One sentence that names topic or file, and the interval.
        unproven: Whether it says that something could not be judged, either way.
    """

    loss: bool
    text: str
    unproven: bool = False


class SampleCount(NamedTuple):
    """The samples of a topic: how many, and the simulated times of the first and last, s."""

    samples: int
    first: float
    last: float


@dataclass
class Verification:
    """What was found in a run.

    Attributes:
        run: Which.
        messages: By name of topic.
        samples: By name of topic.
        findings: Losses and remarks.
        finished: Whether its recorder came to an end, or is not ours to tell.
        last: When the last message was received, by name of topic, ns since the epoch.
    """

    run: Run
    messages: Counter[str] = field(default_factory=Counter)
    samples: dict[str, SampleCount] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    finished: bool = True
    last: dict[str, int] = field(default_factory=dict)

    @property
    def missing(self) -> set[str]:
        """Names of files that are not there."""
        return {damage.file.name for damage in self.run.damage if not damage.end}

    @property
    def complete(self) -> bool:
        """Whether the run came to its end, and nothing is missing or damaged."""
        return self.finished and not self.lossy

    @property
    def lossy(self) -> bool:
        """Whether something is missing or damaged."""
        return any(finding.loss for finding in self.findings)

    def add_loss(self, text: str) -> None:
        """Something is missing or damaged."""
        self.findings.append(Finding(loss=True, text=text))

    def remark(self, text: str) -> None:
        """Something is worth knowing."""
        self.findings.append(Finding(loss=False, text=text))
