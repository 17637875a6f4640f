"""What computes: this package to its last byte, the libraries below it, and the processor."""

from __future__ import annotations

import hashlib
import platform
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path


@lru_cache
def code_identity() -> str:
    """The versions of this package and of what it computes with, and a digest of its files."""
    digest, package = hashlib.sha256(), Path(__file__).resolve().parent
    for file in sorted(package.rglob('*.py')):
        digest.update(file.read_bytes())
    names = ('lathe_chatter', 'numpy', 'scipy', 'numba')
    versions = ', '.join(f'{name} {version(name)}' for name in names)
    return f'{versions}, files {digest.hexdigest()[:12]}'


@lru_cache
def processor_name() -> str:
    """The kind of processor, on which the last bits of some functions depend."""
    try:
        lines = Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines()
        model = next(line.partition(':')[2].strip() for line in lines if 'model name' in line)
    except (OSError, StopIteration):
        model = platform.processor()
    return f'{platform.machine()} {model}'.strip()
