"""CRC-32: of all that reading a run costs the most, unless the processor's own way is there.

The package isal takes a quarter of the time of zlib; it is used where it is installed.
"""

from __future__ import annotations

try:
    from isal.isal_zlib import crc32
except ImportError:
    from zlib import crc32

__all__ = ['crc32']
