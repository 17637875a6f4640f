"""What a block of samples is: its columns, its bytes in a message, and what follows on what."""

from __future__ import annotations

from lathe_chatter.samples.columns import SAMPLE_COLUMNS, STATE_FIELDS, sample_columns

__all__ = ['SAMPLE_COLUMNS', 'STATE_FIELDS', 'sample_columns']
