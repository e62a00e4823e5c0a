"""A solid body meshed anew: the same surface, the same labels, the wanted sizes, well-shaped cells."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from fenics_forming.errors import MeshError
from fenics_forming.physics import meshing
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.remeshing import BodyArrays, mmg, remesh, solid
from fenics_forming.physics.remeshing.quadratic import Curves, Facets
from fenics_forming.physics.remeshing.quality import Quality, scaled_jacobian
from fenics_forming.physics.remeshing.straight import cell_edges, on_boundary

needs_mmg = pytest.mark.skipif(not mmg.installed(), reason="mmgpy, an optional package, is not installed")
ENGINES = [pytest.param("mmg", marks=needs_mmg), "gmsh"]


def arrays(mesh):
    nodes = Nodes(mesh)
    return nodes.x.copy(), nodes.cells.astype(np.int64)


def block(divisions):
    """Unit cube in the numbering of dolfinx, whose cells have no common orientation."""
    return arrays(meshing.box((0, 0, 0), (1, 1, 1), (divisions,) * 3, MPI.COMM_SELF))


def quarter_cylinder(size):
    """Radius 1, height 2, mirror planes x = 0 and y = 0."""
    return arrays(meshing.generate(lambda gmsh: (gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 2, 1, angle=np.pi / 2),
                                                 gmsh.model.occ.synchronize()), 3, size, comm=MPI.COMM_SELF))


def upset(x, height, steps=100, bulge=0.5):
    """The exact isochoric barrel: v_z = -(V/h)(z + b h/2pi sin(2 pi z/h)), v_r = -r/2 dv_z/dz, from h = 2."""
    def velocity(x, h):
        a = 2 * np.pi * x[:, 2] / h
        return np.column_stack([x[:, :2] * ((1 + bulge * np.cos(a)) / 2 / h)[:, None],
                                -(x[:, 2] + bulge * h / 2 / np.pi * np.sin(a)) / h])
    x, d = x.copy(), (2 - height) / steps
    for h in 2 - d * np.arange(steps):
        k1 = velocity(x, h)
        k2 = velocity(x + d / 2 * k1, h - d / 2)
        k3 = velocity(x + d / 2 * k2, h - d / 2)
        x += d / 6 * (k1 + 2 * k2 + 2 * k3 + velocity(x + d * k3, h - d))
    return x


def labelled(x, cells, places):
    """The body, and its labels: of the first place on whose plane (axis, coordinate) all nodes of a side lie."""
    body = BodyArrays(x, cells)
    labels = np.zeros(len(body.sides), int)
    for label, (axis, coordinate) in places.items():
        labels[(abs(x[body.sides, axis] - coordinate) < 1e-9).all(axis=1)] = label
    return body, labels


def upset_cylinder(size, height=0.8):
    x, cells = quarter_cylinder(size)
    places = {1: (2, 2.0), 2: (2, 0.0), -1: (0, 0.0), -2: (1, 0.0)}
    _, labels = labelled(x, cells, places)
    x = upset(x, height)
    for label, (axis, coordinate) in places.items():
        nodes = np.unique(BodyArrays(x, cells).sides[labels == label])
        x[nodes, axis] = height if label == 1 else coordinate
    return BodyArrays(x, cells), labels


def volume(body):
    """Divergence theorem on the quadratic facets, exact for them: 1/3 ∫ x . n da, mm³."""
    import basix

    p, w = basix.make_quadrature(basix.CellType.triangle, 6)
    element = basix.create_element(basix.ElementFamily.P, basix.CellType.triangle, 2, basix.LagrangeVariant.gll_warped)
    n, u, v = np.einsum("dpa,fak->dfpk", element.tabulate(1, p)[:, :, :, 0], body.x[body.sides])
    return float((np.einsum("fpk,fpk->fp", n, np.cross(u, v)) @ w).sum() / 3)


def uniform(size):
    return lambda points: np.full(len(points), size)


@pytest.mark.parametrize("engine", ENGINES)
def test_block_keeps_its_faces_labels_and_volume(engine):
    places = {1: (2, 1.0), -1: (0, 0.0), -2: (1, 0.0)}
    body, labels = labelled(*block(4), places)
    new = remesh(body, labels, uniform(0.25), engine=engine)
    assert volume(new) == pytest.approx(1.0, rel=1e-13), "all sides are flat: rounding only"
    assert np.array_equal(new.labels, labelled(new.x, new.cells, places)[1])
    for label, (axis, coordinate) in places.items():
        assert (new.x[new.sides[new.labels == label], axis] == coordinate).all(), "not only to rounding"
    edges = {tuple(c) for c in np.round(new.x[np.unique(new.sides[:, :3])], 12) if ((c == 0) | (c == 1)).all()}
    assert len(edges) == 8, "the corners of the cube stay"
    assert on_boundary(new.cells[:, :4]).sum(axis=1).max() == 1
    assert new.engine == engine


def test_first_mesh_keeps_its_body_and_has_one_boundary_side_a_cell():
    """Cut at their centres, cells with two boundary sides would leave radius ratios of 0.16 or less."""
    raw = BodyArrays(*quarter_cylinder(0.4))
    better = solid.improved(raw)
    assert on_boundary(better.cells[:, :4]).sum(axis=1).max() == 1
    assert len(better.sides) == len(raw.sides)
    assert volume(better) == pytest.approx(volume(raw), rel=1e-3)     # nodes slide along the old surface
    assert Quality.of(better.x, better.cells).smallest > 0.2 and scaled_jacobian(better.x, better.cells).min() > 0.5


@pytest.mark.parametrize("engine", ENGINES)
def test_upset_cylinder_gets_good_cells_and_keeps_its_volume(engine):
    body, labels = upset_cylinder(0.25)
    assert Quality.of(body.x, body.cells).smallest < 0.05, "poor enough to be meshed anew"
    new = remesh(body, labels, uniform(0.15), engine=engine)
    quality = Quality.of(new.x, new.cells)
    assert quality.smallest > 0.05 and quality.low > 0.25, "the limits of the trigger"
    assert scaled_jacobian(new.x, new.cells).min() > 0.1
    # the first row of the old facets under the tool turns by 20 degrees against the second: 0.01 are cut off there
    assert volume(new) == pytest.approx(volume(body), rel=2e-3)
    assert set(np.unique(new.labels)) == {-2, -1, 0, 1, 2}
    for axis in (0, 1):
        assert (new.x[new.sides[new.labels == -1 - axis], axis] == 0).all()
    assert (new.x[new.sides[new.labels == 1], 2] == 0.8).all()
    # the contact edge: its nodes, mid-nodes too, stay on the old one, a circle up to the error of quadratic sides
    shared = np.intersect1d(new.sides[new.labels == 1], new.sides[new.labels == 0])
    radius = np.hypot(*new.x[shared, :2].T)
    assert np.ptp(radius) < 1e-3 * radius.mean()


@needs_mmg
def test_number_of_cells_is_the_wanted_one():
    body, labels = labelled(*block(3), {})
    new = remesh(body, labels, uniform(0.12))
    assert len(new.cells) == pytest.approx(6 * 2**0.5 / 0.12**3, rel=0.2), "regular cells of that size in a unit volume"


@needs_mmg
def test_sizes_are_followed():
    body, labels = labelled(*block(3), {})
    new = remesh(body, labels, lambda p: 0.08 + 0.25 * p[:, 2])
    edges, _ = cell_edges(new.cells[:, :4])
    length, height = np.linalg.norm(new.x[edges[:, 1]] - new.x[edges[:, 0]], axis=1), new.x[edges, 2].mean(axis=1)
    # edges vary by about a third around their size; means of hundreds of them do not
    assert length[height < 0.1].mean() == pytest.approx(0.09, rel=0.25)
    assert length[height > 0.9].mean() == pytest.approx(0.32, rel=0.25)


@pytest.mark.parametrize("engine", ENGINES)
def test_same_input_same_mesh(engine):
    body, labels = upset_cylinder(0.4, height=1.6)
    one, other = (remesh(body, labels, uniform(0.3), engine=engine) for _ in range(2))
    assert np.array_equal(one.x, other.x) and np.array_equal(one.cells, other.cells)


@needs_mmg
def test_inverted_cells_inside_are_rescued():
    x, cells = block(4)
    centre = np.linalg.norm(x - 0.5, axis=1).argmin()
    x[centre] += (0.4, 0.1, 0.05)
    body, labels = labelled(x, cells, {1: (2, 1.0)})
    new = remesh(body, labels, uniform(0.25))
    assert new.engine == "gmsh, then mmg"
    assert volume(new) == pytest.approx(1.0, rel=1e-13)
    assert Quality.of(new.x, new.cells).smallest > 0.05


@pytest.mark.parametrize("engine", ENGINES)
def test_ball_without_any_edge_stays_a_ball(engine):
    x, cells = arrays(meshing.generate(lambda gmsh: (gmsh.model.occ.addSphere(0, 0, 0, 1), gmsh.model.occ.synchronize()),
                                       3, 0.5, comm=MPI.COMM_SELF))
    body = BodyArrays(x, cells)
    new = remesh(body, np.zeros(len(body.sides), int), uniform(0.4), engine=engine)
    assert Quality.of(new.x, new.cells).low > 0.25
    # sides of order 2 of length 0.5 R leave the sphere by 1e-3 R at most, to either side
    assert volume(new) == pytest.approx(4 / 3 * np.pi, rel=1e-3)
    assert abs(np.linalg.norm(new.x[np.unique(new.sides)], axis=1) - 1).max() < 2e-3


@pytest.mark.parametrize("engine", [ENGINES[0]])
def test_chord_limits_the_straight_edges_of_a_curved_surface(engine):
    body, labels = upset_cylinder(0.5, height=1.99)
    new = remesh(body, labels, uniform(0.5), chord=0.01, engine=engine)
    round_side = new.sides[new.labels == 0]
    middle = (new.x[round_side[:, [1, 2, 0]]] + new.x[round_side[:, [2, 0, 1]]]) / 2
    # h²/8R with the edges of a mesh up to 1.4 times as long as their mean; without the chord it is 0.07
    assert (1 - np.hypot(*middle.reshape(-1, 3)[:, :2].T)).max() < 0.02


def test_body_pinched_to_an_edge_is_reported():
    """Two cubes with one edge in common."""
    x, cells = block(1)
    both = np.concatenate([x, x + (1, 1, 0)])
    x, number = np.unique(both.round(12), axis=0, return_inverse=True)
    cells = number.ravel()[np.concatenate([cells, cells + len(both) // 2])]
    body = BodyArrays(x, cells)
    with pytest.raises(MeshError, match="pinched"):
        remesh(body, np.zeros(len(body.sides), int), uniform(0.5))


def test_surface_that_cuts_itself_is_reported():
    x, cells = block(4)
    x[(abs(x - (0.5, 0.5, 1.0)) < 1e-9).all(axis=1), 2] = -0.5      # a node of the top pulled out through the bottom
    body, labels = labelled(x, cells, {})
    with pytest.raises(MeshError, match="could not be meshed anew"):
        remesh(body, labels, uniform(0.3), engine="gmsh")


def test_closest_points_of_curved_facets_and_edges():
    """Of a paraboloid z = x² + y², which a quadratic facet is exactly: the condition is that the rest is normal to it."""
    uv = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0]])
    facet = np.column_stack([uv, (uv**2).sum(axis=1)])
    points = np.array([[0.2, 0.3, 0.2], [0.25, 0.25, -0.3], [0.4, 0.1, 0.2]])
    foot = Facets(facet[None]).closest(points)
    x, y, z = foot.T
    assert z == pytest.approx(x**2 + y**2, abs=1e-14)
    rest = points - foot
    normal = np.column_stack([-2 * x, -2 * y, np.ones(3)])
    assert abs(np.cross(rest, normal)).max() < 1e-12
    outside = Facets(facet[None]).closest(np.array([[0.5, -1.0, 0.25], [-1, -1, -1]]))
    assert outside[0, 1] == 0 and outside[0, 2] == pytest.approx(outside[0, 0]**2, abs=1e-14), "on the side y = 0"
    assert (outside[1] == 0).all(), "on the corner"
    edge = Curves(facet[None, [0, 1, 5]])
    t = edge.closest(np.array([[0.3, 0.5, 0.4]]))[0]
    assert t[2] == pytest.approx(t[0]**2, abs=1e-14)
    assert (0.3 - t[0]) + 2 * t[0] * (0.4 - t[2]) == pytest.approx(0, abs=1e-12)


def test_rounding_does_not_decide_between_facets_that_meet_at_an_edge():
    """Above the edge of a roof the flat pieces on both sides are equally near, and the closest places on their bulging
    facets differ: which of them is taken must not hang on the last digit, which depends on the number of ranks."""
    x = np.array([[0, 0, 0], [1, 0, 0], [0.4, 1, -0.9], [0.6, -1, -0.8]])
    bulge = np.array([[0, 0, 0.25], [0, 0, 0.25], [0, 0, 0]])
    roof = np.stack([np.concatenate([x[[0, 1, top]], 0.5 * (x[[1, 0, 0]] + x[[top, top, 1]]) + bulge]) for top in (2, 3)])
    points = np.column_stack([np.linspace(0.3, 0.7, 41), np.zeros(41), np.full(41, 0.1)])
    turn = Rotation.from_rotvec([0.3, 0.5, 0.7]).as_matrix().T       # along the axes both are as near to the last digit
    noise = 1e-13 * np.random.default_rng(1).standard_normal((9, *points.shape))
    found = np.array([Facets(roof @ turn).closest(points @ turn + shift) for shift in noise])
    assert np.linalg.norm(found - points @ turn, axis=2).max() < 0.1, "nearer than the edge: on a facet"
    assert np.ptp(found, axis=0).max() < 1e-11          # 0.02 where rounding decides
