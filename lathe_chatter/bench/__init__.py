"""The performance figures of the package that need nothing but the package.

`lathe-chatter bench` prints them wherever it is installed. What needs more than that (other
solvers to compare with, a graph of nodes, a disk to fill) is in the scripts of benchmarks/ in
the source tree, which use these too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from lathe_chatter.bench.cutting import detector_figures, lathe_figures
from lathe_chatter.bench.figures import Figure, median_time, this_machine
from lathe_chatter.bench.stability import stability_figures

__all__ = ['TOPICS', 'Figure', 'median_time', 'this_machine']

TOPICS: Mapping[str, Callable[[int], list[Figure]]] = {
    'lathe': lathe_figures,
    'detector': detector_figures,
    'stability': stability_figures,
}
"""By name, what measures with a number of repeats."""
