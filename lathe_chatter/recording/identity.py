"""What a run knows about its making: versions and machine."""

from __future__ import annotations

import os
import platform
import sys
from datetime import datetime, timezone
from importlib.metadata import version

IDENTITY = 'lathe_chatter/made_by'
"""Name of the MCAP metadata record in each file of a run."""
PARAMETERS = 'lathe_chatter/parameters'
"""Name of the records of a node's parameters, followed by its full name; values as JSON."""

RECEPTION = 'lathe_chatter/reception'
"""Name of the record of what came and what was lost on the way, by topic, as JSON."""

RECOVERED = 'lathe_chatter/recovered'
"""Name of the record of a run that was recovered: from which, and what could not be read."""


def identity() -> dict[str, str]:
    """Who records, on what, since when."""
    return {
        'lathe_chatter': version('lathe_chatter'),
        'mcap': version('mcap'),
        'python': platform.python_version(),
        'system': f'{platform.system()} {platform.release()}',
        'processor': f'{os.cpu_count()} x {platform.machine()}',
        'host': platform.node(),
        'command': ' '.join(sys.argv),
        'started': datetime.now(timezone.utc).isoformat(timespec='milliseconds'),
    }
