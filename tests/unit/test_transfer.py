"""Points are found in the cells that hold them; what is transferred stays bounded, sharp and, nearly, conserved."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from fenics_forming.physics import gmsh_arrays
from fenics_forming.physics.locating import Locator
from fenics_forming.physics.nodes import EDGES
from fenics_forming.physics.remeshing import BodyArrays, remesh
from fenics_forming.process.meshes.transfer import Transfer, conservation, integral

DIMENSIONS = pytest.mark.parametrize("dim", [2, 3])


@cache
def plate(size, algorithm=6):
    """An unstructured mesh of the rectangle 1 x 2."""
    return meshed(2, size, algorithm, lambda gmsh: gmsh.model.occ.addRectangle(0, 0, 0, 1, 2))


@cache
def cylinder(size):
    return meshed(3, size, 1, lambda gmsh: gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 1, 1))


@cache
def disk(size):
    return meshed(2, size, 6, lambda gmsh: gmsh.model.occ.addDisk(0, 0, 0, 1, 1))


@cache
def horseshoe():
    """A block with a deep narrow notch, the elements fine at one side of it and coarse at the other."""
    def build(gmsh):
        occ = gmsh.model.occ
        occ.cut([(2, occ.addRectangle(0, 0, 0, 2, 2))], [(2, occ.addRectangle(0.95, 0.3, 0, 0.1, 2))])
    return meshed(2, None, 6, build, lambda x, y: 0.02 if x < 0.98 else 0.4)


def meshed(dim, size, algorithm, build, sizes=None):
    with gmsh_arrays.gmsh_model() as gmsh:
        build(gmsh)
        gmsh.model.occ.synchronize()
        if sizes is None:
            gmsh.option.setNumber("Mesh.MeshSizeMax", size)
            gmsh.option.setNumber("Mesh.MeshSizeMin", size)
        else:
            gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
            gmsh.model.mesh.setSizeCallback(lambda d, t, x, y, z, lc: sizes(x, y))
        gmsh.option.setNumber("Mesh.Algorithm" if dim == 2 else "Mesh.Algorithm3D", algorithm)
        gmsh.model.mesh.generate(dim)
        gmsh.model.mesh.setOrder(2)
        x, cells = gmsh_arrays.arrays(gmsh, dim)
    return SimpleNamespace(x=x, cells=cells)


@cache
def straight_box():
    return meshed(3, 0.4, 1, lambda gmsh: gmsh.model.occ.addBox(0, 0, 0, 1, 2, 1))


def body(dim):
    return plate(0.15) if dim == 2 else cylinder(0.35)


def with_mids(mesh, nodal):
    """History: mid-nodes have the mean of the ends of their edge."""
    dim = mesh.x.shape[1]
    for k, (a, b) in enumerate(EDGES[dim]):
        nodal[mesh.cells[:, dim + 1 + k]] = 0.5 * (nodal[mesh.cells[:, a]] + nodal[mesh.cells[:, b]])
    return nodal


def inside(mesh, count=400, seed=1):
    """Random points of the body, each in a straight cell."""
    random = np.random.default_rng(seed)
    dim = mesh.x.shape[1]
    cells = random.integers(len(mesh.cells), size=count)
    return np.einsum("pi,pij->pj", random.dirichlet(np.ones(dim + 1), count), mesh.x[mesh.cells[cells, : dim + 1]])


def bent(x):
    """A map whose components are quadratic: order-2 geometry carries it exactly."""
    moved = x.copy()
    moved[:, 0] += 0.1 * x[:, -1] ** 2 + 0.05 * x[:, 0] * x[:, -1]
    moved[:, -1] += 0.2 * x[:, 0] - 0.03 * x[:, 0] ** 2
    return moved


# ---------------------------------------------------------------------- finding
@pytest.mark.parametrize("mesh", [plate(0.15), cylinder(0.35), horseshoe()], ids=["plate", "cylinder", "horseshoe"])
def test_every_point_of_the_body_is_found_in_a_cell_that_holds_it(mesh):
    """Also across a notch, where the walk ends at the wrong side, and beside cells twenty times as large."""
    points = np.concatenate([inside(mesh), mesh.x[np.unique(mesh.cells[:, : mesh.x.shape[1] + 1])]])
    locator = Locator(mesh.x, mesh.cells)
    found = locator.find(points)
    assert found.distance.max() < 1e-13
    assert found.barycentric.min() >= 0 and np.abs(found.barycentric.sum(axis=1) - 1).max() < 1e-14
    place = np.einsum("pi,pij->pj", found.barycentric, mesh.x[locator.vertices[found.cells]])
    assert np.abs(place - points).max() < 1e-13


@DIMENSIONS
def test_neighbours_share_the_facet_opposite_to_the_vertex(dim):
    mesh = body(dim)
    locator = Locator(mesh.x, mesh.cells)
    for i, across in enumerate(locator.neighbours.T):
        here, there = np.flatnonzero(across >= 0), across[across >= 0]
        facet = np.delete(locator.vertices[here], i, axis=1)
        shared = (facet[:, :, None] == locator.vertices[there][:, None, :]).any(axis=2)
        assert shared.all() and (there != here).all()
    area = {2: 6.0, 3: 4 * np.pi}[dim]          # perimeter 6; side and two ends of the cylinder
    exterior = np.argwhere(locator.neighbours < 0)
    corners = np.stack([mesh.x[np.delete(locator.vertices[c], i)] for c, i in exterior])
    edges = corners[:, 1:] - corners[:, :1]
    size = np.linalg.norm(edges[:, 0], axis=1)
    if dim == 3:
        size = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    assert size.sum() == pytest.approx(area, rel=0.03), "the facets without neighbour are the surface"


def test_point_outside_takes_a_near_place_and_its_distance_is_told():
    mesh = plate(0.15)
    points = np.array([[-0.01, 0.7], [1.2, 0.333], [0.5, 2.001], [-3.0, 1.0]])
    found = Locator(mesh.x, mesh.cells).find(points)
    assert found.barycentric.min() >= 0
    assert found.distance == pytest.approx([0.01, 0.2, 0.001, 3.0], rel=0.1), "true distances, up to the clipping"
    assert (found.distance >= np.array([0.01, 0.2, 0.001, 3.0]) * (1 - 1e-12)).all()


@DIMENSIONS
def test_curved_cells_are_inverted_exactly(dim):
    """The coordinates in the bent mesh are those of the same material point in the straight one."""
    mesh = plate(0.15) if dim == 2 else straight_box()
    points = inside(mesh)
    curved = Locator(bent(mesh.x), mesh.cells)
    found = curved.find_curved(bent(points))
    assert found.distance.max() < 1e-13
    straight = np.einsum("pi,pij->pj", found.barycentric, mesh.x[curved.vertices[found.cells]])
    assert np.abs(straight - points).max() < 1e-12


def test_points_on_the_circle_lie_on_the_curved_sides():
    """The straight sides of 0.3 miss the circle by 1e-2, the sides of order 2 by about h⁴: less than 1e-4."""
    mesh = disk(0.3)
    angle = np.linspace(0, 2 * np.pi, 200)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    locator = Locator(mesh.x, mesh.cells)
    straight, found = locator.find(circle), locator.find_curved(circle)
    assert 5e-3 < straight.distance.max() < 2e-2 and found.distance.max() < 1e-4
    assert np.linalg.norm(locator.place(found) - circle, axis=1) == pytest.approx(found.distance, abs=1e-15)
    far = locator.find_curved(1.2 * circle)
    assert far.distance == pytest.approx(0.2, abs=1e-4), "the nearest place is straight below"


# ---------------------------------------------------------------------- transfer
@DIMENSIONS
def test_linear_fields_are_kept_to_round_off_everywhere(dim):
    """Also several at once, and at points beyond the straight sides of a curved surface (up to the range of the old)."""
    old = body(dim)
    new = plate(0.11, 5) if dim == 2 else cylinder(0.3)
    slope = np.arange(1.0, dim + 1)
    before = np.stack([1 + old.x @ slope, 3 - old.x @ slope[::-1], np.full(len(old.x), 7.0)], axis=1)
    after = Transfer(old, new.x).linear(before)
    exact = np.stack([1 + new.x @ slope, 3 - new.x @ slope[::-1], np.full(len(new.x), 7.0)], axis=1)
    within = (exact >= before.min(axis=0)).all(axis=1) & (exact <= before.max(axis=0)).all(axis=1)
    if dim == 3:       # at the rim the neighbours' range cuts what lies beyond the straight sides: a sagitta, 1e-2
        assert np.abs(after - exact).max() < 3e-2
        within = np.hypot(new.x[:, 0], new.x[:, 1]) < 0.9
    assert within.sum() > 50 and np.abs(after - exact)[within].max() < 1e-13
    assert (after[:, 2] == 7.0).all()


@DIMENSIONS
def test_values_at_the_same_vertices_are_the_same(dim):
    mesh = body(dim)
    values = np.random.default_rng(0).uniform(0, 1, len(mesh.x))
    vertices = np.unique(mesh.cells[:, : dim + 1])
    assert Transfer(mesh, mesh.x[vertices]).linear(values) == pytest.approx(values[vertices], abs=1e-12)


@DIMENSIONS
def test_a_jump_is_carried_without_overshoot(dim):
    """A field of noughts and ones, and one point thrown far outside: values never leave 0 to 1, none is lost."""
    old = body(dim)
    step = (old.x[:, 0] > 0.43).astype(float)
    points = np.concatenate([inside(old, 2000), [[50.0] * dim]])
    after = Transfer(old, points).linear(step)
    assert after.min() >= 0 and after.max() <= 1 and after[-1] == 1.0
    assert set(np.round(after[np.abs(points[:, 0] - 0.43) > 0.8], 15)) <= {0.0, 1.0}


@DIMENSIONS
def test_quadratic_velocity_is_kept_to_round_off_in_straight_cells(dim):
    old = plate(0.15) if dim == 2 else straight_box()
    points = inside(old)
    def velocity(x):
        return np.stack([x[:, 0] ** 2 - x[:, 1] * x[:, -1]] + [x[:, k] * x[:, 0] - 2 for k in range(1, dim)], axis=1)
    assert Transfer(old, points).quadratic(velocity(old.x)) == pytest.approx(velocity(points), abs=1e-12)


def back_and_forth(old, new, field, times):
    there, back = Transfer(old, new.x), Transfer(new, old.x)
    start = with_mids(old, field(old.x))
    values = start
    for _ in range(times // 2):
        values = with_mids(old, back.linear(with_mids(new, there.linear(values))))
    return start, values


def peak(centre, width):
    return lambda x: np.exp(-((x - centre) ** 2).sum(axis=1) / width**2)


# Width 0.165 makes plain linear interpolation lose what notes/remeshing.md 3 has in its row "P1 linear": here it keeps
# .74 | .90 | .98 of the peak (error 2.0e-1 | 6.7e-2 | 1.6e-2), there .77 | .915 | .975 (2.3e-1 | 7.1e-2 | 1.7e-2).
@pytest.mark.parametrize("centre", [[0.45, 1.05], [0.42, 1.08]], ids=["one place", "another"])
@pytest.mark.parametrize(("size", "kept", "error"), [(0.067, 0.95, 2e-2), (0.031, 0.985, 2.5e-3),
                                                    pytest.param(0.0152, 0.997, 1.6e-4, marks=pytest.mark.long)])
def test_ten_transfers_keep_a_peak(size, kept, error, centre):
    """1.2k | 5.7k | 23k triangles and meshes of 0.75 times as many: measured .996/1.4e-2, .997/7.0e-4, .9997/6.9e-5 at the
    first place; the notes have .94/5.5e-2, .985/4.7e-3, .997/3.5e-4."""
    start, values = back_and_forth(plate(size, 5), plate(1.1 * size), peak(centre, 0.165), 10)
    assert values.max() > kept * start.max()
    assert np.linalg.norm(values - start) < error * np.linalg.norm(start)
    assert values.min() >= start.min() and values.max() <= start.max(), "within the range of the old"


def test_ten_transfers_keep_a_peak_in_a_cylinder():
    """12k and 14k tetrahedra, three elements from the peak to 1/e: measured .947/2.8e-2 (plain interpolation .6/3.1e-1)."""
    old, new = cylinder(0.11), cylinder(0.105)
    start, values = back_and_forth(old, new, peak([0.2, 0.1, 0.45], 0.3), 10)
    assert values.max() > 0.93 * start.max()
    assert np.linalg.norm(values - start) < 4e-2 * np.linalg.norm(start)
    assert values.min() >= start.min()


@DIMENSIONS
def test_cubic_fields_are_kept_where_the_patches_are_whole(dim):
    """Inside, the slopes and curvatures at the vertices are those of the cubic, to what holds the fits (1e-6)."""
    mesh = body(dim)
    def field(x):
        return 2 + x[:, 0] ** 3 - x[:, 0] * x[:, -1] ** 2 + 0.5 * x[:, -1] ** 2
    points = inside(mesh, 2000)
    middle = np.array([0.5, 1.0] if dim == 2 else [0.0, 0.0, 0.5])
    away = np.abs(points - middle).max(axis=1) < 0.2
    assert away.sum() > 15
    after = Transfer(mesh, points).linear(field(mesh.x))
    assert np.abs(after - field(points))[away].max() < 1e-5


# ---------------------------------------------------------------------- a real remeshing
def upset(x, reduction=0.6, steps=200):
    """Where the isochoric barrel field takes the points of a cylinder 1 x 2: v_z = -V/h (z + b h/(2 pi) sin(2 pi z/h))."""
    x, height, travel = x.copy(), 2.0, 2 * reduction / steps

    def rate(x, h):
        r, z = x.T
        return np.stack([r / 2 / h * (1 + 0.5 * np.cos(2 * np.pi * z / h)),
                         -(z + 0.25 * h / np.pi * np.sin(2 * np.pi * z / h)) / h], axis=1)

    for _ in range(steps):
        middle = x + 0.5 * travel * rate(x, height)
        x, height = x + travel * rate(middle, height - 0.5 * travel), height - travel
    return x


def renewed_after_upsetting(size):
    """A mesh upset by 60 %, to cells of radius ratio 0.05, and one of the given size in its place."""
    first = plate(0.067, 5)
    old = BodyArrays(upset(first.x), first.cells)
    labels = np.zeros(len(old.sides), int)
    middle = old.x[old.sides[:, :2]].mean(axis=1)
    labels[middle[:, 1] < 1e-6], labels[middle[:, 1] > 0.8 - 1e-6], labels[middle[:, 0] < 1e-9] = 1, 2, -1
    return first, old, remesh(old, labels, lambda points: np.full(len(points), size))


def test_material_goes_on_where_it_was_after_an_upset_mesh_is_renewed():
    """The new nodes know their first places to 1e-4 (measured 3e-5), and nothing falls below the old."""
    first, old, new = renewed_after_upsetting(0.067)
    transfer = Transfer(old, new.x)
    at_first = transfer.quadratic(first.x)
    assert np.abs(upset(at_first) - new.x).max() < 1e-4
    strain = with_mids(old, peak([0.45, 1.05], 0.3)(first.x))
    moved = with_mids(new, transfer.linear(strain))
    exact = peak([0.45, 1.05], 0.3)(at_first)
    assert np.linalg.norm(moved - exact) < 0.03 * np.linalg.norm(exact), "two to three elements from the peak to 1/e"
    assert moved.min() >= strain.min() and moved.max() <= strain.max()


def test_a_peak_keeps_its_integral_from_an_upset_mesh_to_a_new_one():
    """To 1e-3 on the average; from mesh to mesh it is a matter of luck, 1.3e-4 to 1.6e-3 on these."""
    lost = []
    for size in (0.060, 0.062, 0.064, 0.066, 0.067, 0.068, 0.070, 0.072, 0.074):
        first, old, new = renewed_after_upsetting(size)
        strain = with_mids(old, peak([0.45, 1.05], 0.3)(first.x))
        moved = with_mids(new, Transfer(old, new.x).linear(strain))
        lost.append(abs(conservation(old, new, {"strain": (strain, moved)}, axisymmetric=True)["strain"]))
    assert np.mean(lost) < 1e-3, lost


# ---------------------------------------------------------------------- conservation
@DIMENSIONS
def test_integrals_are_those_of_the_curved_body(dim):
    """Area or volume, first moment, and in axisymmetry Pappus: a rectangle 1 x 2 on the axis is a cylinder of 2 pi."""
    mesh = body(dim)
    one = np.ones(len(mesh.x))
    if dim == 2:
        assert integral(mesh, one) == pytest.approx(2, rel=1e-13)
        assert integral(mesh, mesh.x[:, 1]) == pytest.approx(2, rel=1e-13)
        assert integral(mesh, one, axisymmetric=True) == pytest.approx(2 * np.pi, rel=1e-13)
        assert integral(mesh, mesh.x[:, 0] ** 2, axisymmetric=True) == pytest.approx(np.pi, rel=1e-13)
        assert integral(disk(0.3), np.ones(len(disk(0.3).x))) == pytest.approx(np.pi, rel=1e-4), "sides of order 2"
    else:
        assert integral(mesh, one) == pytest.approx(np.pi, rel=1e-3), "sides of order 2; straight ones miss 3 %"
        assert integral(mesh, mesh.x[:, 2]) == pytest.approx(np.pi / 2, rel=2e-3)


def test_conservation_is_reported_by_field():
    """A peak over ten cells is conserved to 1e-3 (the notes: 6e-4 and better); what changes by 1 % is said to."""
    old, new = plate(0.067, 5), plate(0.074)
    transfer, field = Transfer(old, new.x), peak([0.45, 1.05], 0.3)
    strain = with_mids(old, field(old.x))
    moved = with_mids(new, transfer.linear(strain))
    turning = np.stack([-old.x[:, 1], old.x[:, 0]], axis=1)
    for axisymmetric in (False, True):
        report = conservation(old, new, {
            "strain": (strain, moved), "grown": (strain, 1.01 * moved), "none": (0 * strain, 0 * moved),
            "velocity": (turning, transfer.quadratic(turning))}, axisymmetric=axisymmetric)
        assert abs(report["strain"]) < 1e-3 and report["none"] == 0.0
        assert report["grown"] - report["strain"] == pytest.approx(0.01, rel=1e-2)
        assert report["velocity"] < 1e-12
