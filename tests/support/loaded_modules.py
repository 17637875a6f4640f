"""What a program loads."""

from __future__ import annotations

import os
import subprocess
import sys

COMPUTING = {'numba', 'scipy', 'matplotlib'}
"""What takes half a second to load, and is wanted only by who computes or draws."""


def loaded_by(*arguments: str, **environment: str) -> set[str]:
    """The modules that a fresh interpreter loads for these arguments."""
    call = [sys.executable, '-X', 'importtime', *arguments]
    whole = {**os.environ, **environment}
    done = subprocess.run(call, check=True, capture_output=True, text=True, env=whole)
    return {line.rpartition('|')[2].strip() for line in done.stderr.splitlines()}
