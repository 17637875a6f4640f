"""What the lesson has a class do on the page happens, as the lathe and its monitor have it."""

from __future__ import annotations

import numpy as np

from lathe_chatter import ChatterDetector, Cut, VirtualLathe


class Lesson:
    """A lathe that is watched, as the page begins it."""

    def __init__(self) -> None:
        """With its noise."""
        cut = Cut(3000.0, 0.0005, 5e-6, bearing_contact='gap', force_noise=0.001)
        self.lathe, self.detector = VirtualLathe(cut=cut), ChatterDetector()

    def watch(self, seconds: float) -> tuple[list[bool], float]:
        """Whether chatter is flagged, each 20 ms; and the tool's last turn, um peak to peak."""
        flags = []
        for _ in range(round(seconds / 0.02)):
            samples = self.lathe.advance(200)
            flags.append(self.detector.update(samples, self.lathe.columns).chatter)
        return flags, float(np.ptp(samples[:, 2])) * 1e6

    def set(self, **changes: float) -> tuple[list[bool], float]:
        self.lathe.retune(self.lathe.cut.with_changes(**changes))
        return self.watch(3.0)


def test_of_two_knocks_one_dies_out_and_one_lasts() -> None:
    lesson = Lesson()
    lesson.watch(2.0)
    for changes in ({'force_noise': 0.0}, {'bearing_clearance': 1e-5}, {'depth_of_cut': 0.00065}):
        flags, left = lesson.set(**changes)
        assert not any(flags)
    assert left < 1.0
    lesson.lathe.knock(-1.2e-3)
    flags, left = lesson.watch(6.0)
    assert any(flags[:50])
    assert 2.0 < np.flatnonzero(flags)[-1] * 0.02 < 4.0
    assert left < 1.0
    lesson.lathe.knock(-1.4e-3)
    flags, left = lesson.watch(6.0)
    assert all(flags[50:])
    assert 41.0 < left < 43.0


def test_with_the_depth_before_the_clearance_it_chatters_before_any_knock() -> None:
    lesson = Lesson()
    lesson.set(force_noise=0.0)
    flags, left = lesson.set(depth_of_cut=0.00065)
    assert any(flags)
    assert left > 40.0
    assert any(lesson.set(bearing_clearance=1e-5)[0][-50:])
