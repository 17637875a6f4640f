"""The inner loop for several lathes abreast: in step by spindle angle, each with its own cut.

Quiet steps are taken for all lanes at once (lanes.py). A lathe to which something may happen in
a step (contact, leaving the cut) goes on alone from before that step, through stepper.py, and
comes back when the whole last turn was regular again. One with a ramp, speed variation or noise
stays alone.
"""

from __future__ import annotations

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import lanes
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.berth import (
    ABREAST,
    ALONE,
    ENDED,
    ODD,
    SAMPLES,
    SLOT,
    STEPS,
    UNTIL,
    Group,
    is_regular,
    load,
    store,
)
from lathe_chatter.lathe.integrator.lanes import LANES
from lathe_chatter.lathe.integrator.stepper import advance


@compiled(borrows=True)
def _are_together(g: Group) -> bool:
    """Whether all lanes are abreast, and stand at neighbouring places of the output."""
    for lane in range(LANES):
        if g.modes[lane] != ABREAST or g.places[lane] != g.places[0] + lane:
            return False
    return True


@compiled(borrows=True)
def _hand_out(g: Group, columns: Integers, out: Array, row: int) -> None:
    """Write a row of samples lane by lane."""
    for k in range(columns.shape[0]):
        figure = lanes.SAMPLE + columns[k]
        for lane in range(LANES):
            if g.modes[lane] == ABREAST:
                out[row, k, g.places[lane]] = g.figures[figure * LANES + lane]


@compiled(borrows=True)
def _attend(g: Group, index: int, row: int) -> None:
    """After a step with flags: lanes to which something may have happened part before it."""
    then = g.other if g.counters[ODD] == 0 else g.one
    slot, turned = g.counters[SLOT], False
    for lane in range(LANES):
        flag = g.figures[lanes.FLAG * LANES + lane]
        if flag % lanes.TURNED != 0.0 and g.modes[lane] == ABREAST:
            for figure in range(lanes.NODE_FIGURES):  # the node met is there no more
                met = then[(lanes.MET_ANGLE + figure) * LANES + lane]
                g.ring[slot, figure * LANES + lane] = met
            store(g, lane, index)
            g.rows[lane] = row
        elif flag >= lanes.TURNED:
            turned = True
    if turned:
        lanes.next_turn(then, g.figures, g.ring)


@compiled(borrows=True, apart=True)
def _advance_together(
    g: Group, steps: int, first: int, until: int, columns: Integers, out: Array
) -> None:
    """Cut rows `first` to `until` with the lanes that are abreast."""
    one, other, figures, ring = g.one, g.other, g.figures, g.ring
    slot, per_turn, place = g.counters[SLOT], ring.shape[0], g.places[0]
    odd, together = g.counters[ODD] != 0, _are_together(g)
    for row in range(first, until):
        for index in range(steps):
            if odd:
                attention = lanes.take_step(other, one, figures, ring, slot)
            else:
                attention = lanes.take_step(one, other, figures, ring, slot)
            if attention:
                g.counters[SLOT], g.counters[ODD] = slot, odd
                _attend(g, index, row)
                together = together and _are_together(g)
            odd = not odd
            g.counters[STEPS] += 1
            slot = slot + 1 if slot + 1 < per_turn else 0
        g.counters[SAMPLES] += 1
        lanes.take_sample(one if odd == 0 else other, figures, g.counters[SAMPLES])
        if together:
            for k in range(columns.shape[0]):
                source = (lanes.SAMPLE + columns[k]) * LANES
                for lane in range(LANES):
                    out[row, k, place + lane] = figures[source + lane]
        else:
            _hand_out(g, columns, out, row)
    g.counters[SLOT], g.counters[ODD] = slot, odd


@compiled(borrows=True)
def _stand_still(g: Group, lane: int, columns: Integers, out: Array) -> None:
    """Repeat the last sample of a lathe that has ended, to the end of `out`."""
    for row in range(g.rows[lane], out.shape[0]):
        for k in range(columns.shape[0]):
            out[row, k, g.places[lane]] = g.last[lane, columns[k]]


@compiled()
def _advance_alone(
    g: Group, lane: int, columns: Integers, samples: Array, events: Array, out: Array
) -> int:
    """Finish the block with one lathe; how that ended, as `stepper.advance` says it."""
    status = layout.EVENTS_FULL
    while status == layout.EVENTS_FULL:
        done, _, status = advance(
            g.numbers[lane], g.counts[lane], g.nodes[lane], g.settings[lane], g.mechanics[lane],
            g.matrices[lane], g.seeds[lane], samples[: g.counters[UNTIL] - g.rows[lane]], events,
        )  # fmt: skip
        for row in range(done):
            for k in range(columns.shape[0]):
                out[g.rows[lane] + row, k, g.places[lane]] = samples[row, columns[k]]
        if done > 0:
            g.last[lane] = samples[done - 1]
        g.rows[lane] += done
    return status


@compiled(nogil=True)
def advance_abreast(g: Group, columns: Integers, samples: Array, events: Array, out: Array) -> int:
    """Cut on with a group of lathes until `out` is full, or until the memory of a surface is.

    Args:
        g: The group. When `out` is new, its counter UNTIL and its rows are 0.
        columns: Which columns of a sample are wanted (n,).
        samples: Room for the samples of a block, a turn or so, of one lathe (m, 8).
        events: Room for events; they are not handed out (k, 3).
        out: Written (rows, n, lathes).

    Returns:
        FINISHED, or SURFACE_FULL: to be called again as it is, with more room for the nodes.
    """
    steps, per_turn, block = g.counts[0, layout.STEPS], g.ring.shape[0], samples.shape[0]
    while True:
        until, abreast = g.counters[UNTIL], 0
        for lane in range(LANES):
            if g.modes[lane] == ALONE and g.rows[lane] < until:
                status = _advance_alone(g, lane, columns, samples, events, out)
                if status == layout.SURFACE_FULL:
                    return status
                if status == layout.GUARD:
                    g.modes[lane] = ENDED
            if g.modes[lane] == ALONE and is_regular(
                g.numbers[lane], g.counts[lane], g.nodes[lane], g.settings[lane], per_turn
            ):
                load(g, lane)
            if g.modes[lane] == ENDED and g.places[lane] >= 0:
                _stand_still(g, lane, columns, out)
                g.rows[lane] = out.shape[0]
            abreast += g.modes[lane] == ABREAST
        if until == out.shape[0]:
            return layout.FINISHED
        g.counters[UNTIL] = min(until + block, out.shape[0])
        for lane in range(LANES):
            g.rows[lane] = max(g.rows[lane], until)
        if abreast > 0:
            _advance_together(g, steps, until, g.counters[UNTIL], columns, out)


@compiled()
def store_lanes(g: Group) -> None:
    """Put all lanes back into their lathes' memories; they are alone then."""
    for lane in range(LANES):
        if g.modes[lane] == ABREAST:
            store(g, lane, 0)
