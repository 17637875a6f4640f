"""`python -m lathe_chatter.cli` is `lathe-chatter`."""

from __future__ import annotations

import sys

from lathe_chatter.cli.main import main

if __name__ == '__main__':
    sys.exit(main())
