from __future__ import annotations

import signal

# Under `nohup make test &`, and in many CI systems, SIGINT is ignored, and the programs that the
# tests start would inherit that. With a handler in this process they start with the usual one.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
