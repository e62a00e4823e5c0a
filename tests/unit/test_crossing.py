"""Sides of a new boundary that cross: as straight ones, and only as the parabolas that they are."""

import numpy as np
import pytest

from fenics_forming.physics.remeshing.boundary_kernels import meetings
from fenics_forming.physics.remeshing.crossing import crossing, curved_crossing


def lens(sag):
    """A thin plate 4 x 1 whose long sides bend inwards by ``sag`` at their middles: points, sides, middles."""
    points = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [0.0, 1.0]])
    sides = np.array([[0, 1], [1, 2], [2, 3], [3, 0]])
    middles = points[sides].mean(axis=1)
    middles[0, 1] += sag
    middles[2, 1] -= sag
    return points, sides, middles


@pytest.mark.parametrize(("sag", "cross"), [(0.0, False), (0.45, False), (0.55, True)])
def test_parabolas_cross_where_their_chords_do_not(sag, cross):
    points, sides, middles = lens(sag)
    assert not crossing(points, sides).any()
    assert curved_crossing(points, sides, middles).tolist() == [cross, False, cross, False]


def test_a_parabola_bent_back_over_its_neighbour_is_found():
    """The first side leaves along the x axis and bows down through the second, which starts at its end."""
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, -0.3], [-1.0, 1.0]])
    sides = np.array([[0, 1], [1, 2], [2, 3], [3, 0]])
    middles = points[sides].mean(axis=1)
    assert not curved_crossing(points, sides, middles).any()
    middles[0] = [0.5, -0.4]
    assert curved_crossing(points, sides, middles)[:2].all()
    assert not crossing(points, sides).any()


def test_segments_that_meet_are_those_of_all_pairs():
    """A sweep leaves out only pairs whose circles are apart."""
    rng = np.random.default_rng(3)
    start = rng.uniform(0, 4, (60, 2))
    end = start + rng.normal(0, 0.7, (60, 2))
    found = {tuple(pair) for pair in meetings(start, end, 1e-9).tolist()}

    def side(a, b, p):
        return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])

    wanted = {(i, j) for i in range(60) for j in range(i + 1, 60)
              if side(start[i], end[i], start[j]) * side(start[i], end[i], end[j]) < 0
              and side(start[j], end[j], start[i]) * side(start[j], end[j], end[i]) < 0}
    assert found == wanted and len(wanted) > 20
