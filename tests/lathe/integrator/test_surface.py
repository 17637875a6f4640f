"""The surface of the last turn: quintics over spindle angle, rebased once a turn."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from support.python_entry import with_entry

from lathe_chatter.array_types import Array
from lathe_chatter.lathe.integrator import surface

surface_at, forget = with_entry(surface.surface_at), with_entry(surface.forget)

_QUINTIC = Polynomial([0.3, -1.0, 2.0, 0.7, -1.3, 0.4])


def _nodes(angles: list[float]) -> Array:
    nodes = np.zeros((surface.NODE_SIZE, len(angles) + 3))
    slope, curvature = _QUINTIC.deriv(), _QUINTIC.deriv(2)
    for k, angle in enumerate(angles):
        nodes[surface.PLACE, k] = angle
        nodes[surface.HEIGHT, k] = _QUINTIC(angle)
        nodes[[surface.SLOPE_BEFORE, surface.SLOPE_AFTER], k] = slope(angle)
        nodes[[surface.CURVATURE_BEFORE, surface.CURVATURE_AFTER], k] = curvature(angle)
        nodes[surface.ORDER, k] = surface.SMOOTH
    return nodes


@pytest.mark.parametrize('angle', [0.1, 0.13, 0.37, 0.4])
def test_a_quintic_is_held_exactly(angle: float) -> None:
    height, slope, curvature = surface_at(_nodes([-0.2, 0.1, 0.4]), 1, angle)
    assert height == pytest.approx(_QUINTIC(angle), rel=1e-14)
    assert slope == pytest.approx(_QUINTIC.deriv()(angle), rel=1e-13)
    assert curvature == pytest.approx(_QUINTIC.deriv(2)(angle), rel=1e-12)


def test_a_corner_has_two_sides() -> None:
    nodes = _nodes([-0.2, 0.1, 0.4])
    nodes[surface.SLOPE_AFTER, 1] += 5.0
    nodes[surface.CURVATURE_AFTER, 1] -= 3.0
    before = surface_at(nodes, 0, 0.1)
    after = surface_at(nodes, 1, 0.1)
    assert after[0] == pytest.approx(before[0], rel=1e-14)
    assert after[1] - before[1] == pytest.approx(5.0, rel=1e-12)
    assert after[2] - before[2] == pytest.approx(-3.0, rel=1e-12)


def test_the_error_of_the_hold_falls_with_the_sixth_power_of_the_step() -> None:
    errors = []
    for width in (0.2, 0.1):
        nodes = np.zeros((surface.NODE_SIZE, 2))
        for k, angle in enumerate((0.5, 0.5 + width)):
            nodes[surface.PLACE, k], nodes[surface.HEIGHT, k] = angle, np.sin(7.0 * angle)
            nodes[[surface.SLOPE_BEFORE, surface.SLOPE_AFTER], k] = 7.0 * np.cos(7.0 * angle)
            nodes[[surface.CURVATURE_BEFORE, surface.CURVATURE_AFTER], k] = -49.0 * np.sin(
                7.0 * angle
            )
        places = 0.5 + width * np.linspace(0.0, 1.0, 101)
        held = np.array([surface_at(nodes, 0, place)[0] for place in places])
        errors.append(np.abs(held - np.sin(7.0 * places)).max())
    assert errors[0] > 2.0**5.5 * errors[1]


def test_before_the_first_turn_the_surface_is_smooth() -> None:
    nodes = surface.fresh_surface(3e-6, 200.0, 16)
    assert nodes.shape == (surface.NODE_SIZE, 16)
    for place in (-200.0, -60.3, 0.0):
        height, slope, curvature = surface_at(nodes, 0, place)
        assert height == pytest.approx(3e-6, rel=1e-14)
        assert (slope, curvature) == (0.0, 0.0)


def test_a_later_origin_moves_places_and_nothing_else() -> None:
    nodes = _nodes([-0.2, 0.1, 0.4, 0.9])
    before = [surface_at(nodes, left, 0.05 + 0.3 * left) for left in (1, 2)]
    forget(nodes, 1, 3, 1.0)
    after = [surface_at(nodes, left - 1, 0.05 + 0.3 * left - 1.0) for left in (1, 2)]
    for old, new in zip(before, after, strict=True):
        assert new == pytest.approx(old, rel=1e-9)


def test_a_surface_counted_otherwise_is_the_same_surface() -> None:
    """Of a steady feed of its own, the height over a common origin is one at every angle."""
    nodes, start, ahead = _nodes([-0.2, 0.1, 0.4]), 0.3, 0.05
    old, new, ratio = 0.7, 0.2, 2.5
    other = surface.recounted(nodes[:, :3], start, ratio, ahead, np.array([old, new]))
    for place in (0.15, 0.2, 0.39):
        height, slope, _ = surface_at(nodes, 1, place)
        again, slope_again, _ = surface_at(other, 1, (place - start) * ratio)
        absolute = height + old * (place - start) - ahead
        assert again + new * (place - start) * ratio == pytest.approx(absolute, rel=1e-12)
        assert (slope_again + new) * ratio == pytest.approx(slope + old, rel=1e-12)


def test_room_for_more_nodes_keeps_every_bit() -> None:
    nodes = _nodes([-0.2, 0.1, 0.4])
    more = surface.with_room(nodes, 100)
    assert more.shape == (surface.NODE_SIZE, 100)
    assert np.array_equal(more[:, : nodes.shape[1]], nodes)
    assert not more[:, nodes.shape[1] :].any()


def test_rows_begin_where_a_line_of_the_cache_does() -> None:
    assert all(surface.empty_nodes(n).ctypes.data % 64 == 0 for n in range(1, 20))
