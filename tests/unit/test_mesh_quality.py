"""Measures of cells, against their closed forms, and the facets around a body."""

import numpy as np
import pytest

from fenics_forming.physics import meshing
from fenics_forming.physics.nodes import EDGES, Nodes
from fenics_forming.physics.remeshing import BodyArrays
from fenics_forming.physics.remeshing.quality import Quality, neighbour_ratio, radius_ratio, scaled_jacobian

EQUILATERAL = {2: np.array([[0, 0], [1, 0], [0.5, np.sqrt(0.75)]]),
               3: np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)}
RIGHT = {dim: np.vstack([np.zeros(dim), np.eye(dim)]) for dim in (2, 3)}
REGULAR = [lambda: meshing.rectangle((0, 0), (2, 1), (4, 3)), lambda: meshing.box((0, 0, 0), (2, 1, 3), (2, 1, 2))]


def order_two(vertices):
    """One cell of order 2 with its mid-nodes half-way."""
    dim = vertices.shape[1]
    x = np.vstack([vertices, [vertices[list(e)].mean(axis=0) for e in EDGES[dim]]])
    return x, np.arange(len(x))[None]


def body_of(mesh):
    nodes = Nodes(mesh)
    return BodyArrays(nodes.x.copy(), nodes.cells.copy())


# ---------------------------------------------------------------------- shape
@pytest.mark.parametrize(("cell", "ratio"), [
    (EQUILATERAL[2], 1.0), (EQUILATERAL[3], 1.0),
    (RIGHT[2], 2 * (np.sqrt(2) - 1)),                            # r = 1 - √2/2, R = √2/2
    (RIGHT[3], 3 * (1 / (3 + np.sqrt(3))) / (np.sqrt(3) / 2)),   # r = 3 V / S, R = √3/2
])
def test_radius_ratio_of_known_cells(cell, ratio):
    cells = np.arange(len(cell))[None]
    turned = np.linalg.qr(np.random.default_rng(3).normal(size=(cell.shape[1],) * 2))[0]
    for x in (cell, 1e-3 * cell @ turned + 7, cell[::-1]):
        # a body 1e-3 large at a distance of 7 keeps 12 digits
        assert radius_ratio(x, cells)[0] == pytest.approx(ratio, rel=1e-10)


@pytest.mark.parametrize("dim", [2, 3])
def test_flat_and_shrunken_cells_have_the_ratio_nought(dim):
    cells = np.arange(dim + 1)[None]
    flat = EQUILATERAL[dim].copy()
    flat[:, -1] = 0.0
    assert radius_ratio(flat, cells)[0] == 0.0 and radius_ratio(np.ones((dim + 1, dim)), cells)[0] == 0.0
    # both the flat cell's height and its radius ratio vanish together
    thin = [radius_ratio(EQUILATERAL[dim] * np.r_[np.ones(dim - 1), t], cells)[0] for t in (1e-1, 1e-2, 1e-3)]
    assert thin[0] > 5 * thin[1] > 25 * thin[2] > 0


def test_quality_is_least_percentile_and_mean():
    x = np.concatenate([EQUILATERAL[2], RIGHT[2]])
    cells = np.array([[0, 1, 2]] * 199 + [[3, 4, 5]])
    q = Quality.of(x, cells)
    right = 2 * (np.sqrt(2) - 1)
    assert q.smallest == pytest.approx(right) and q.low == pytest.approx(1.0)
    assert q.mean == pytest.approx((199 + right) / 200)


# ---------------------------------------------------------------------- neighbours
@pytest.mark.parametrize("dim", [2, 3])
def test_cell_that_is_twice_as_large_in_every_direction_gives_the_ratio_two(dim):
    apex = np.full((1, dim), 0.3)
    apex[0, 0] = -(2.0**dim)          # height over the common facet x = 0 against that of the unit cell
    x = np.concatenate([RIGHT[dim], apex])
    cells = np.array([np.arange(dim + 1), [dim + 1 if v == 1 else v for v in range(dim + 1)]])
    assert neighbour_ratio(x, cells) == pytest.approx(2.0, rel=1e-12)
    assert neighbour_ratio(x, cells[:1]) == 1.0, "alone"
    x[-1, 0] = 0.0
    assert neighbour_ratio(x, cells) == np.inf, "a flat neighbour"


@pytest.mark.parametrize("make", REGULAR)
def test_cells_of_a_regular_mesh_are_of_one_size(make):
    body = body_of(make())
    assert neighbour_ratio(body.x, body.cells) == pytest.approx(1.0, rel=1e-12)


# ---------------------------------------------------------------------- order 2
@pytest.mark.parametrize("dim", [2, 3])
def test_straight_cell_has_all_its_room_and_a_quarter_point_none(dim):
    for vertices in (EQUILATERAL[dim], EQUILATERAL[dim][::-1], 5 * RIGHT[dim]):
        x, cells = order_two(vertices)
        assert scaled_jacobian(x, cells)[0] == pytest.approx(1.0, rel=1e-13)
        a, b = EDGES[dim][0]
        x[dim + 1] = 0.75 * x[a] + 0.25 * x[b]      # the speed along that edge vanishes at its end
        assert scaled_jacobian(x, cells)[0] == pytest.approx(0.0, abs=1e-13)


@pytest.mark.parametrize("bow", [0.125, 0.25, 0.3])
def test_side_that_bows_into_its_cell_takes_the_room_at_its_ends(bow):
    """x + 4 λ0 λ1 (0, bow) on the right cell: the Jacobian at the second vertex is 1 - 4 bow, elsewhere it is larger."""
    x, cells = order_two(RIGHT[2])
    x[3 + EDGES[2].index((0, 1)), 1] = bow
    assert scaled_jacobian(x, cells)[0] == pytest.approx(1 - 4 * bow, abs=1e-14)


# ---------------------------------------------------------------------- boundary
@pytest.mark.parametrize("make", REGULAR)
@pytest.mark.parametrize("mirrored", [False, True])
def test_sides_enclose_the_body_with_their_mid_nodes_half_way(make, mirrored):
    body = body_of(make())
    if mirrored:
        x = body.x * np.r_[-1.0, np.ones(body.dim - 1)]
        body = BodyArrays(x, body.cells)
    p = body.x[body.sides]
    d = body.dim
    # the divergence theorem: the volume is the mean flux of x / dim
    enclosed = (0.5 * np.linalg.det(p[:, :2]) if d == 2 else np.linalg.det(p[:, :3]) / 6).sum()
    assert enclosed == pytest.approx(2.0 if d == 2 else 6.0, rel=1e-13), "positive: outwards"
    assert len(body.sides) == (14 if d == 2 else 2 * 2 * (2 + 2 * 2 + 2 * 1))
    for k, ends in enumerate([(0, 1)] if d == 2 else EDGES[2]):
        assert np.allclose(p[:, d + k], p[:, list(ends)].mean(axis=1), atol=1e-15)
