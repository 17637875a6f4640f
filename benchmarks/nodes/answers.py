"""How long a request to a lathe waits, whatever else the lathe has to do."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from ear import Ear, ear
from processes import LATHE, cpu_share, running, script
from rcl_interfaces.srv import GetParameters
from std_srvs.srv import SetBool

PACE = 0.02
"""s from one answer to the next request."""
LATE = 30.0
"""s after which an answer counts as never."""


def measure_requests(seconds: float, knocks: float = 500.0, sets: float = 200.0) -> None:
    """Answers at all loads, with and without a flood of knocks and sets."""
    for flooded in (False, True):
        for tick_rate in (500, 5000):
            for factor in (1, 20, 0):
                _measure(tick_rate, factor, seconds, (knocks, sets) if flooded else None)


def _measure(
    tick_rate: int, factor: int, seconds: float, flood: tuple[float, float] | None
) -> None:
    parameters = [f'tick_rate:={tick_rate}.0', f'real_time_factor:={factor}.0']
    arguments = [word for parameter in parameters for word in ('-p', parameter)]
    with running(LATHE, *arguments) as lathe, ear(by_events=True) as listener:
        ask = _asker(listener)
        with script('flood.py', *map(str, flood)) if flood else contextlib.nullcontext():
            if flood:  # once it is there: a process that starts takes a core for itself
                listener.spin(
                    lambda: listener.node.count_publishers('/lathe/knock') > 0, limit=60.0
                )
            listener.spin(limit=2.0)
            waits: list[float] = []
            until = time.monotonic() + seconds
            while time.monotonic() < until:
                waits.append(ask())
                listener.spin(limit=PACE)
            p50, p99, worst = 1e3 * np.quantile(waits, [0.5, 0.99, 1.0])
            load = 'flooded' if flood else 'alone'
            print(
                f'requests, {tick_rate:4} ticks, factor {factor:2}, {load:7}: answered in '
                f'{p50:6.1f} ms (p50), {p99:7.1f} ms (p99), {worst:7.1f} ms (worst of '
                f'{len(waits)}); lathe {cpu_share(lathe, 1.0):.0f} % of a core',
                flush=True,
            )


def _asker(listener: Ear) -> Callable[[], float]:
    """A function that asks one thing or the other in turn, and says how long the answer took."""
    node = listener.node
    pause = node.create_client(SetBool, '/lathe/pause')
    get = node.create_client(GetParameters, '/lathe/get_parameters')
    listener.spin(lambda: pause.service_is_ready() and get.service_is_ready(), limit=120.0)
    listener.spin(limit=1.0)  # until the lathe, too, has found its client
    requests: list[tuple[Any, Any]] = [
        (get, GetParameters.Request(names=['depth_of_cut'])),
        (pause, SetBool.Request(data=False)),
    ]

    def ask() -> float:
        requests.append(requests.pop(0))
        client, request = requests[-1]
        began = time.monotonic()
        future = client.call_async(request)
        listener.spin(future.done, limit=LATE)
        client.remove_pending_request(future)
        return time.monotonic() - began

    return ask
