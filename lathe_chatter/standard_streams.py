"""Standard streams that whoever started the process has closed."""

from __future__ import annotations

import os
import sys


def hold_standard_streams() -> list[str]:
    """Have closed standard streams lead nowhere.

    Else the next file that is opened would get the number of one, and with it all that is printed.

    Returns:
        Which were closed, of stdin, stdout and stderr.
    """
    modes = {'stdin': 'r', 'stdout': 'w', 'stderr': 'w'}
    closed = [name for name in modes if getattr(sys, name) is None]
    for name in closed:  # the lowest number that is free, which is its own
        setattr(sys, name, open(os.devnull, modes[name], encoding='utf-8'))  # noqa: SIM115, PTH123
    return closed
