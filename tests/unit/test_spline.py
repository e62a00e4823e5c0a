"""Splines through the points of a boundary: what they keep exactly, and how fast they approach the rest."""

import numpy as np
import pytest

from fenics_forming.physics.remeshing.spline import Spline, half_lengths


def random_knots(count):
    return np.cumsum(np.random.default_rng(count).uniform(0.2, 1.0, count))


@pytest.mark.parametrize(("count", "degree"), [(2, 1), (3, 2), (4, 3), (5, 3), (30, 3)])
def test_an_open_spline_keeps_polynomials_up_to_its_degree(count, degree):
    """Through two points a line, through three a parabola; from four on cubics: no more is told by them."""
    knots, s = random_knots(count), np.linspace(*random_knots(count)[[0, -1]], 57)
    curve = [np.polynomial.Polynomial(c[: degree + 1]) for c in ([1.0, -2.0, 0.5, 0.3], [0.0, 1.0, -0.7, 0.2])]
    points, slopes = Spline(knots, np.stack([c(knots) for c in curve], axis=1), False)(s)
    # round-off of coefficients of order 1 on a way of up to 20
    assert points == pytest.approx(np.stack([c(s) for c in curve], axis=1), abs=1e-9)
    assert slopes == pytest.approx(np.stack([c.deriv()(s) for c in curve], axis=1), abs=1e-9)


def test_a_closed_spline_is_smooth_everywhere_and_of_fourth_order():
    errors = []
    for count in (12, 24):
        knots = np.linspace(0.0, 2 * np.pi, count + 1)
        circle = lambda s: np.stack([np.cos(s), np.sin(s)], axis=1)  # noqa: E731
        points = circle(knots)
        points[-1] = points[0]
        spline, s = Spline(knots, points, True), np.linspace(0.0, 2 * np.pi, 500)
        errors.append(np.abs(spline(s)[0] - circle(s)).max())
        assert spline(knots[[0]])[1] == pytest.approx(spline(knots[[-1]])[1], abs=1e-12)       # no kink where it closes
    assert np.log2(errors[0] / errors[1]) > 3.8


def test_halves_of_a_parabola_add_up_to_its_length():
    """y = x² from 0 to 1: √5/2 + asinh(2)/4. Four Gauss points on each half miss some 1e-5 of it."""
    halves = half_lengths(np.array([[0.0, 0.0], [0.5, 0.25], [1.0, 1.0]]))
    assert halves.sum() == pytest.approx(np.sqrt(5) / 2 + np.arcsinh(2) / 4, rel=1e-5)
    assert halves[0] == pytest.approx(np.sqrt(2) / 4 + np.arcsinh(1) / 4, rel=1e-5)
