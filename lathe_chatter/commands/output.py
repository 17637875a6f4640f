"""What the verbs print for machines."""

from __future__ import annotations

import json
import sys
from typing import Any


def print_json(figures: Any) -> None:
    """Print figures as one line of JSON.

    Not by way of rich, which would take `[null]` for a tag and swallow it.

    Raises:
        ValueError: If a number is not finite: JSON has no such thing.
    """
    sys.stdout.write(json.dumps(figures, allow_nan=False) + '\n')
