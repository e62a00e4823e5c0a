"""Volume constancy: the exact volume of curved bodies, and its restoration by one offset of the free surface."""

import subprocess
import sys
import textwrap

import numpy as np
import pytest
import ufl
from dolfinx import fem

from fenics_forming import kinematics, meshing
from fenics_forming.physics.contact.rigid import KnownTool, ToolMotion
from fenics_forming.physics.contact.surfaces import Plane
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.surface import Surface
from fenics_forming.process.volume import FreeSurface, _heights, _jacobians

KINDS = pytest.mark.parametrize("kind", ["plane_strain", "axisymmetric", "3d"])
ROUNDING = 1e-12     # of the volume: what issue 3 asks for; measured 1e-15


def curved_body(kind, divisions=(6, 4)):
    """A block with curved sides on mirror planes at its low x (in axisymmetry the axis) and its low last axis."""
    kin = kinematics.KINDS[kind]
    nx, ny = divisions
    nodes = Nodes(meshing.rectangle((0, 0), (2, 1), (nx, ny)) if kin.dim == 2 else
                  meshing.box((0, 0, 0), (2, 1, 1), (nx - 2, ny - 1, ny - 1)))
    x = nodes.x
    x[:, 0] += 0.1 * x[:, 0] * x[:, -1] ** 2
    x[:, -1] += 0.05 * np.sin(3 * x[:, 0]) * x[:, -1]
    return nodes, kin, FreeSurface.of_mesh(nodes, kin, {0: 0.0, kin.dim - 1: 0.0})


def cell_volume(nodes, kin):
    """Integral over the cells, degree 6: exact, and independent of the surface."""
    weight = kin.weight(ufl.SpatialCoordinate(nodes.mesh)) * fem.Constant(nodes.mesh, 1.0)
    return fem.assemble_scalar(fem.form(weight * ufl.dx(domain=nodes.mesh, metadata={"quadrature_degree": 6})))


def platen(dim, height=1.0):
    up = np.eye(dim)[-1]
    return KnownTool("platen", Plane(tuple(height * up), tuple(-up)), motion=ToolMotion(0 * up, 0 * up))


# ---------------------------------------------------------------------- volume
@KINDS
def test_volume_from_the_surface_is_that_of_the_curved_cells(kind):
    nodes, kin, free = curved_body(kind)
    assert free.volume(nodes.x) == pytest.approx(cell_volume(nodes, kin), rel=1e-14)


@KINDS
def test_volume_loses_no_digits_far_from_the_origin(kind):
    """Moved by a thousand times its size along its last axis: rounding of the positions alone, 1e3 x 1e-16."""
    nodes, kin, free = curved_body(kind)
    before = free.volume(nodes.x)
    nodes.x[:, -1] += 1000
    assert Surface.of(nodes, kin).volume(nodes.x) == pytest.approx(before, rel=1e-12)


@KINDS
def test_rate_of_the_volume_is_its_exact_derivative(kind):
    """Central differences of a cubic are off by the square of the step: 1e-10, and rounding 1e-11."""
    nodes, _, free = curved_body(kind)
    motion, step = np.sin(3 * nodes.x + 1), 1e-5
    difference = (free.volume(nodes.x + step * motion) - free.volume(nodes.x - step * motion)) / (2 * step)
    assert free.surface.volume_rate(nodes.x, motion) == pytest.approx(difference, rel=1e-8)


@pytest.mark.parametrize("dim", [2, 3])
def test_normals_of_a_round_body_point_away_from_its_centre(dim):
    """Parabolas through the nodes of a circle, or a cylinder: their normals are off by the square of the side, 1/24²."""
    nodes = Nodes(meshing.rectangle((-1, -1), (1, 1), (12, 12)) if dim == 2 else
                  meshing.box((-1, -1, 0), (1, 1, 1), (8, 8, 2)))
    x = nodes.x
    square = np.abs(x[:, :2]).max(axis=1)
    radius = np.linalg.norm(x[:, :2], axis=1)
    x[:, :2] *= (square / np.where(radius > 0, radius, 1))[:, None]
    surface = Surface.of(nodes, kinematics.PLANE_STRAIN if dim == 2 else kinematics.THREE_DIMENSIONAL)
    mantle = np.isclose(np.linalg.norm(x[surface.sides][..., :2], axis=2), 1).all(axis=1)
    normals, cosine = surface.normals(x, mantle)
    on = surface.marked(mantle, len(x))
    assert np.linalg.norm(normals[on], axis=1) == pytest.approx(1, rel=1e-14)
    assert normals[on, :2] == pytest.approx(x[on, :2], abs=1e-2)
    assert (normals[~on] == 0).all() and (cosine[on] > 0.9).all()


# ---------------------------------------------------------------------- restoring
@KINDS
@pytest.mark.parametrize("change", [0.02, -0.02, 1e-4, -1e-9, 0.1, -0.05])
def test_offset_restores_the_volume_to_rounding(kind, change):
    nodes, kin, free = curved_body(kind)
    wanted = free.volume(nodes.x) * (1 + change)
    done = free.offset_to(wanted, nodes.x)
    assert done.shortfall is None and np.sign(done.distance) == np.sign(change)
    assert cell_volume(nodes, kin) == pytest.approx(wanted, rel=ROUNDING)
    assert done.after == pytest.approx(wanted, rel=ROUNDING)
    assert done.given_back == pytest.approx(wanted - done.before, rel=1e-5)   # 1e-9 of the volume has 1e-6 of digits
    assert nodes.smallest_jacobian() > 0


@KINDS
def test_mirror_planes_and_the_axis_stay_where_they_are(kind):
    nodes, kin, free = curved_body(kind)
    on = [(axis, np.flatnonzero(nodes.x[:, axis] == 0)) for axis in (0, kin.dim - 1)]
    free.offset_to(1.1 * free.volume(nodes.x), nodes.x)
    for axis, there in on:
        assert len(there) and (nodes.x[there, axis] == 0).all()


@KINDS
def test_nodes_on_a_tool_keep_their_place_to_the_last_bit(kind):
    nodes, kin, free = curved_body(kind)
    tool = platen(kin.dim, 1.02)
    nodes.x[np.isclose(nodes.x[:, -1], nodes.x[:, -1].max(), atol=0.06), -1] = 1.02
    on, before = nodes.x[:, -1] == 1.02, nodes.x.copy()
    assert on.sum() > 5
    wanted = 1.01 * free.volume(nodes.x)
    done = free.offset_to(wanted, nodes.x, [tool])
    assert (nodes.x[on] == before[on]).all()
    assert done.after == pytest.approx(wanted, rel=ROUNDING) and done.shortfall is None
    assert tool.gap(nodes.x)[0].min() >= 0


def test_nodes_driven_into_a_tool_are_put_back_and_the_others_make_up_for_them():
    """A wall close to the right side: the bulge runs into it, no node ends inside, the volume is exact."""
    nodes, kin, free = curved_body("plane_strain")
    outmost = nodes.x[np.argmax(nodes.x @ (1.0, -0.1))]
    wall = KnownTool("wall", Plane((outmost[0] + 0.01, outmost[1]), (-1.0, 0.1)),
                     motion=ToolMotion(np.zeros(2), np.zeros(2)))
    assert 0 < wall.gap(nodes.x)[0].min() < 0.011
    wanted = 1.1 * free.volume(nodes.x)
    done = free.offset_to(wanted, nodes.x, [wall])
    after = wall.gap(nodes.x)[0]
    assert np.sum(np.abs(after) < 1e-9) >= 2 and after.min() > -1e-12, "some landed, none is inside"
    assert cell_volume(nodes, kin) == pytest.approx(wanted, rel=ROUNDING) and done.shortfall is None


def test_nodes_of_a_mirror_plane_that_are_put_back_onto_a_sloping_tool_stay_on_that_plane():
    """The normal of a facet leads away from the plane: a mid-node that has left it stays behind, and looks like a fold."""
    nodes, _, free = curved_body("3d")
    normal = np.array([0.3, 0.0, -1.0]) / np.hypot(0.3, 1.0)
    tool = KnownTool("die", Plane((0.0, 0.0, 1.01), tuple(normal)), motion=ToolMotion(np.zeros(3), np.zeros(3)))
    before = free.volume(nodes.x)
    free.offset_to(1.02 * before, nodes.x, [tool])
    assert max(np.abs(nodes.x[free.on_plane[axis], axis]).max() for axis in (0, 2)) < 1e-15
    assert free.volume(nodes.x) == pytest.approx(1.02 * before, rel=ROUNDING)


def test_free_surface_moves_by_the_same_normal_distance_up_to_a_slanted_mirror_plane():
    """A wedge with its mirror plane across a slanted side: every point of the side goes out by the one distance."""
    nodes = Nodes(meshing.rectangle((0, 0), (2, 1), (6, 4)))
    nodes.x[:, 0] += 0.5 * nodes.x[:, 1] * nodes.x[:, 0] / 2      # the right side leans by 26.6 degrees
    free = FreeSurface.of_mesh(nodes, kinematics.PLANE_STRAIN, {1: 0.0})
    tool = platen(2)
    before = nodes.x.copy()
    done = free.offset_to(1.001 * free.volume(nodes.x), nodes.x, [tool])
    normal = np.array([1, -0.5]) / np.hypot(1, 0.5)
    side = (before[:, 0] > 2 + 0.5 * before[:, 1] - 1e-9) & (before[:, 1] < 0.9)
    assert side.sum() > 3
    assert (nodes.x - before)[side] @ normal == pytest.approx(done.distance, rel=1e-12)


def disk(size=0.2):
    nodes = Nodes(meshing.generate(lambda gmsh: (gmsh.model.occ.addDisk(0, 0, 0, 1, 1), gmsh.model.occ.synchronize()), 2,
                                   size))
    return nodes, FreeSurface.of_mesh(nodes, kinematics.PLANE_STRAIN, {})


def test_offset_of_a_disk_is_uniform():
    """A circle stays one, and goes as far as its area says."""
    nodes, free = disk()
    rim = np.isclose(np.linalg.norm(nodes.x, axis=1), 1)
    done = free.offset_to(1.02 * free.volume(nodes.x), nodes.x)
    # vertices and mid-nodes differ by the cosine at the vertices, that of the fourth order of the side: 3e-7
    assert np.linalg.norm(nodes.x[rim], axis=1) == pytest.approx(np.sqrt(1.02), rel=1e-6)
    assert done.distance == pytest.approx(np.sqrt(1.02) - 1, rel=1e-5)


@pytest.mark.parametrize("change", [-0.15, 0.3])
def test_large_offset_is_spread_so_that_no_cell_inverts(change):
    """More than a tenth of an element: a third of a whole one goes under, and no Jacobian with it."""
    nodes, free = disk()
    height = _heights(nodes.x[nodes.vertices]).min()
    done = free.offset_to((1 + change) * free.volume(nodes.x), nodes.x)
    assert abs(done.distance) > 0.3 * height, "more than may move at once"
    assert done.shortfall is None
    assert (_jacobians(nodes.x[nodes.cells]) * nodes._orientation[:, None]).min() > 0
    rim = np.linalg.norm(nodes.x, axis=1) > np.sqrt(1 + change) - 1e-3
    assert np.linalg.norm(nodes.x[rim], axis=1) == pytest.approx(np.sqrt(1 + change), rel=1e-5)


def test_lip_keeps_its_place_while_the_others_make_up_for_it():
    """Beside held nodes, as where a wall leaves a punch: its sagging sides leave its cells hardly any room."""
    nodes = Nodes(meshing.rectangle((0, 0), (2, 1), (8, 4)))
    held = (nodes.x[:, 1] == 1.0) & (nodes.x[:, 0] <= 1.0)
    lip, first, second = (np.flatnonzero((nodes.x == (x, 1.0)).all(axis=1)) for x in (1.25, 1.125, 1.375))
    mids, ends = nodes.edges_at(lip)
    nodes.x[lip] = 1.184, 0.866
    nodes.x[mids] = nodes.x[ends].mean(axis=1)
    nodes.x[first, 1] -= 0.01
    nodes.x[second, 1] -= 0.047
    assert nodes.smallest_jacobian() > 0
    free = FreeSurface.of_mesh(nodes, kinematics.PLANE_STRAIN, {})
    wanted = free.volume(nodes.x) - 0.25          # a fifth of a cell from five sides of the body
    done = free.offset_to(wanted, nodes.x, pressed=held)
    assert done.shortfall is None and done.after == pytest.approx(wanted, rel=ROUNDING)
    assert nodes.smallest_jacobian() > 0


def test_what_does_not_fit_under_the_cap_is_reported_and_waits():
    nodes, _, free = curved_body("plane_strain", (12, 8))
    wanted = 0.4 * free.volume(nodes.x)
    done = free.offset_to(wanted, nodes.x)
    assert "would have to move" in done.shortfall
    assert wanted < done.after < done.before and nodes.smallest_jacobian() > 0


def test_body_without_a_free_surface_is_left_alone():
    """All its outside lies on four tools."""
    nodes = Nodes(meshing.rectangle((0, 0), (2, 1), (4, 2)))
    free = FreeSurface.of_mesh(nodes, kinematics.PLANE_STRAIN, {})
    walls = [KnownTool(str(p), Plane(p, n), motion=ToolMotion(np.zeros(2), np.zeros(2)))
             for p, n in (((0., 0.), (1., 0.)), ((2., 0.), (-1., 0.)), ((0., 0.), (0., 1.)), ((0., 1.), (0., -1.)))]
    before = nodes.x.copy()
    done = free.offset_to(2.1, nodes.x, walls)
    assert "no free surface" in done.shortfall and done.given_back == 0
    assert (nodes.x == before).all()


def test_whole_arrays_on_one_rank_give_the_same():
    """As a remeshing has them: positions, cells and sides, without a mesh."""
    nodes, kin, free = curved_body("3d")
    alone = FreeSurface.of_arrays(nodes.x.copy(), nodes.cells, free.surface.sides, kin, {0: 0.0, 2: 0.0})
    x, wanted = nodes.x.copy(), 1.01 * free.volume(nodes.x)
    alone.offset_to(wanted, x)
    free.offset_to(wanted, nodes.x)
    assert x == pytest.approx(nodes.x, abs=1e-14)


def test_heights_and_jacobians_of_known_cells():
    right = np.array([[[0.0, 0], [3, 0], [0, 4]]])
    assert _heights(right) == pytest.approx([12 / 5])
    tet = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]])
    assert _heights(tet) == pytest.approx([1 / np.sqrt(3)])
    six = np.concatenate([right, 0.5 * (right[:, [1, 0, 0]] + right[:, [2, 2, 1]])], axis=1)
    assert _jacobians(six) == pytest.approx(12 * np.ones((1, 4)))
    six[0, 5] = [1.5, -0.3]          # the middle of the side from the first to the second vertex, pulled out
    # x = 3 s, y = 4 t - 1.2 s (1 - s - t): the determinant is 3 (4 + 1.2 s)
    assert _jacobians(six)[0] == pytest.approx([3 * 4, 3 * 5.2, 3 * 4, 3 * 4.4])


@pytest.mark.mpi
def test_two_ranks_restore_what_one_restores():
    """The same displacement field on any number of ranks, to rounding, and the same copy of shared nodes."""
    program = textwrap.dedent("""
        import numpy as np
        from mpi4py import MPI
        from tests.unit.test_volume import curved_body, platen
        for kind in ("axisymmetric", "3d"):
            nodes, kin, free = curved_body(kind)
            start = nodes.x.copy()
            done = free.offset_to(1.03 * free.volume(nodes.x), nodes.x, [platen(kin.dim, 1.06)])
            owned = nodes.mesh.geometry.index_map().size_local
            moments = [np.sum((nodes.x - start)[:owned] ** 2 * (1 + start[:owned] ** k)) for k in (1, 2)]
            apart = nodes.sum_at_all(nodes.x) / nodes.sum_at_all(np.ones(nodes.count))[:, None] - nodes.x
            assert np.abs(apart).max() == 0 or nodes.comm.size > 1 and np.abs(apart).max() < 1e-15
            print(*MPI.COMM_WORLD.allreduce(np.array([*moments])), done.distance, done.after, sep=chr(10)) \\
                if nodes.comm.rank == 0 else MPI.COMM_WORLD.allreduce(np.array([*moments]))
        """)
    answers = []
    for launcher in ([], ["mpirun", "-n", "2"]):
        done = subprocess.run([*launcher, sys.executable, "-c", program], capture_output=True, text=True, check=True,
                              timeout=900)
        answers.append(np.array(done.stdout.split(), float))
    assert len(answers[0]) == 8
    assert answers[1] == pytest.approx(answers[0], rel=1e-10)
