"""Several lathes side by side, a lane each: one step of all of them at once.

What a quiet step (quiet.py) needs of each lathe lies next to the same figure of the other lanes,
so that the processor works on several lanes with each operation. Each lane takes the same number
of steps a turn: the place that the tool meets is then the node left just so many steps ago,
whatever the lathe's speed, and the surface is a ring of nodes of which all lanes read, and then
write, the same. The operations are those of the single lathe in the same order: the bits are the
same.
"""

from __future__ import annotations

from lathe_chatter.arrays import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator.events import may_turn_back
from lathe_chatter.lathe.integrator.plan import add
from lathe_chatter.lathe.integrator.propagation import bend, response

LANES = 8
"""As many as are worked on together: two of the processor's registers, or one of the widest."""

# What a step changes: LANES numbers for each, in one array before the step, in another after it.
(
    XT, VT, XW, VW, ANGLE, ANGLE_LOW, FED, FED_LOW,
    MET_ANGLE, MET, MET_SLOPE, MET_CURVATURE,  # the node met, by angle
    U, DU, DDU,  # the surface there, by time
    CHIP,
) = range(16)  # fmt: skip
STATE_FIGURES = 16

# What it does not change, and what became of it.
(
    TURNS, RATE, STEP, RISE, SPEED, PER_SPEED, SQUARE, PER_SQUARE, FEED, FEED_SPEED,
    NOMINAL, LEAST,  # chip thickness: what is added to h, and what it is at least
    LIMIT, STIFFNESS, MAY_LEAVE, HAS_CLEARANCE, GAMMA, BEARING_SIDE,
    FLAG,  # see `take_step`
    SAMPLE,  # the eight columns of the last sample
) = range(20)  # fmt: skip
COLUMNS = 8
MATRIX = SAMPLE + COLUMNS  # rows 0-10 of the regime, component by component
BEND = MATRIX + 44  # and its relative acceleration
FIGURES = BEND + 7

# A node of the ring: LANES numbers for each of these.
NODE_ANGLE, NODE_HEIGHT, NODE_SLOPE, NODE_CURVATURE = range(4)
NODE_FIGURES = 4

SLOW, TURNED = 1.0, 16.0
"""Flags of a lane: something may happen in the step; a turn ends with it."""


@compiled(inline=True, borrows=True)
def _turn_and_meet(now: Array, then: Array, c: Array, ring: Array, slot: int) -> None:
    """Spindle angle and feed at the end of the step, and the node that the tool meets there."""
    for i in range(LANES):
        angle, angle_low = add(
            now[ANGLE * LANES + i], now[ANGLE_LOW * LANES + i], c[RISE * LANES + i]
        )
        fed, fed_low = add(now[FED * LANES + i], now[FED_LOW * LANES + i], c[FEED * LANES + i])
        then[ANGLE * LANES + i], then[ANGLE_LOW * LANES + i] = angle, angle_low
        then[FED * LANES + i], then[FED_LOW * LANES + i] = fed, fed_low
        met, slope = ring[slot, NODE_HEIGHT * LANES + i], ring[slot, NODE_SLOPE * LANES + i]
        curvature = ring[slot, NODE_CURVATURE * LANES + i]
        then[MET_ANGLE * LANES + i] = ring[slot, NODE_ANGLE * LANES + i]
        then[MET * LANES + i], then[MET_SLOPE * LANES + i] = met, slope
        then[MET_CURVATURE * LANES + i] = curvature
        then[U * LANES + i] = met - fed
        then[DU * LANES + i] = slope * c[SPEED * LANES + i] - c[FEED_SPEED * LANES + i]
        then[DDU * LANES + i] = curvature * c[SQUARE * LANES + i]


@compiled(inline=True, borrows=True)
def _component(now: Array, then: Array, c: Array, i: int, component: int) -> float:
    """One component of a lane's state after the step."""
    m = (MATRIX + 11 * component) * LANES + i
    return response(
        c[m], c[m + LANES], c[m + 2 * LANES], c[m + 3 * LANES], c[m + 4 * LANES],
        c[m + 5 * LANES], c[m + 6 * LANES], c[m + 7 * LANES], c[m + 8 * LANES],
        c[m + 9 * LANES], c[m + 10 * LANES],
        now[XT * LANES + i], now[VT * LANES + i], now[XW * LANES + i], now[VW * LANES + i],
        now[U * LANES + i], now[DU * LANES + i], now[DDU * LANES + i],
        then[U * LANES + i], then[DU * LANES + i], then[DDU * LANES + i],
    )  # fmt: skip


@compiled(inline=True, borrows=True)
def _respond(now: Array, then: Array, c: Array) -> None:
    """The state at the end of the step."""
    for i in range(LANES):
        then[XT * LANES + i] = _component(now, then, c, i, 0)
        then[VT * LANES + i] = _component(now, then, c, i, 1)
        then[XW * LANES + i] = _component(now, then, c, i, 2)
        then[VW * LANES + i] = _component(now, then, c, i, 3)


@compiled(inline=True, borrows=True)
def _judge(now: Array, then: Array, c: Array) -> None:
    """The flags of the step."""
    for i in range(LANES):
        side, gamma = c[BEARING_SIDE * LANES + i], c[GAMMA * LANES + i]
        touches = may_turn_back(
            side * (now[XW * LANES + i] - gamma), side * now[VW * LANES + i],
            side * (then[XW * LANES + i] - gamma), side * then[VW * LANES + i],
            c[STEP * LANES + i],
        )  # fmt: skip
        c[FLAG * LANES + i] = c[HAS_CLEARANCE * LANES + i] * touches
    for i in range(LANES):
        chip = then[XT * LANES + i] - then[XW * LANES + i] - then[U * LANES + i]
        then[CHIP * LANES + i] = chip
        leaves = may_turn_back(
            now[XT * LANES + i] - now[XW * LANES + i] - now[U * LANES + i],
            now[VT * LANES + i] - now[VW * LANES + i] - now[DU * LANES + i],
            chip, then[VT * LANES + i] - then[VW * LANES + i] - then[DU * LANES + i],
            c[STEP * LANES + i],
        )  # fmt: skip
        c[FLAG * LANES + i] += c[MAY_LEAVE * LANES + i] * leaves
    for i in range(LANES):
        limit = c[LIMIT * LANES + i]
        inside = (abs(then[XT * LANES + i]) <= limit) & (abs(then[XW * LANES + i]) <= limit)
        c[FLAG * LANES + i] += SLOW * (not inside)
    for i in range(LANES):
        c[FLAG * LANES + i] += TURNED * (then[ANGLE * LANES + i] >= 1.0)


@compiled(inline=True, borrows=True)
def _leave(then: Array, c: Array, ring: Array, slot: int) -> None:
    """The surface that the step leaves in place of the one met."""
    for i in range(LANES):
        xt1, vt1 = then[XT * LANES + i], then[VT * LANES + i]
        xw1, vw1 = then[XW * LANES + i], then[VW * LANES + i]
        b = BEND * LANES + i
        curvature = c[PER_SQUARE * LANES + i] * bend(
            c[b], c[b + LANES], c[b + 2 * LANES], c[b + 3 * LANES], c[b + 4 * LANES],
            c[b + 5 * LANES], c[b + 6 * LANES], xt1, vt1, xw1, vw1, then[U * LANES + i], 0.0,
        )  # fmt: skip
        slope = (c[FEED_SPEED * LANES + i] + vt1 - vw1) * c[PER_SPEED * LANES + i]
        ring[slot, NODE_ANGLE * LANES + i] = then[ANGLE * LANES + i]
        ring[slot, NODE_HEIGHT * LANES + i] = then[FED * LANES + i] + xt1 - xw1
        ring[slot, NODE_SLOPE * LANES + i] = slope
        ring[slot, NODE_CURVATURE * LANES + i] = curvature


@compiled(inline=True, borrows=True)
def take_step(now: Array, then: Array, c: Array, ring: Array, slot: int) -> bool:
    """Take a step with all lanes.

    Args:
        now: The lanes before the step (STATE_FIGURES * LANES,).
        then: Written: the lanes after it.
        c: What the step does not change (FIGURES * LANES,); written: the flags of each lane.
        ring: The surface (steps a turn, NODE_FIGURES * LANES).
        slot: The node that is met, and then left anew.

    Returns:
        Whether a lane has a flag.
    """
    _turn_and_meet(now, then, c, ring, slot)
    _respond(now, then, c)
    _judge(now, then, c)
    _leave(then, c, ring, slot)
    f = FLAG * LANES
    flags: float = ((c[f] + c[f + 1]) + (c[f + 2] + c[f + 3])) + (
        (c[f + 4] + c[f + 5]) + (c[f + 6] + c[f + 7])
    )
    return flags != 0.0


@compiled(borrows=True)
def next_turn(state: Array, c: Array, ring: Array) -> None:
    """Count angle and feed from the new turn on where one has begun, see `surface.next_turn`."""
    for i in range(LANES):
        turned = c[FLAG * LANES + i] >= TURNED
        c[FLAG * LANES + i] = 1.0 if turned else 0.0
    for slot in range(ring.shape[0]):
        for i in range(LANES):
            turn = c[FLAG * LANES + i]
            ring[slot, NODE_ANGLE * LANES + i] -= turn
            ring[slot, NODE_HEIGHT * LANES + i] -= turn * state[FED * LANES + i]
    for i in range(LANES):
        turn = c[FLAG * LANES + i]
        c[TURNS * LANES + i] += turn
        state[ANGLE * LANES + i] -= turn
        state[MET_ANGLE * LANES + i] -= turn
        state[MET * LANES + i] -= turn * state[FED * LANES + i]
        state[FED * LANES + i] = 0.0 if turn != 0.0 else state[FED * LANES + i]


@compiled(inline=True, borrows=True)
def take_sample(state: Array, c: Array, samples: int) -> None:
    """Put the present sample, columns as in `model.SAMPLE_COLUMNS`, into its figures."""
    for i in range(LANES):
        c[SAMPLE * LANES + i] = samples / c[RATE * LANES + i]
        c[(SAMPLE + 1) * LANES + i] = c[TURNS * LANES + i] + state[ANGLE * LANES + i]
    for i in range(LANES):
        c[(SAMPLE + 2) * LANES + i] = state[XT * LANES + i]
        c[(SAMPLE + 3) * LANES + i] = state[VT * LANES + i]
        c[(SAMPLE + 4) * LANES + i] = state[XW * LANES + i]
        c[(SAMPLE + 5) * LANES + i] = state[VW * LANES + i]
    for i in range(LANES):
        chip = state[CHIP * LANES + i]
        c[(SAMPLE + 6) * LANES + i] = max(chip + c[NOMINAL * LANES + i], c[LEAST * LANES + i])
        c[(SAMPLE + 7) * LANES + i] = c[STIFFNESS * LANES + i] * chip
