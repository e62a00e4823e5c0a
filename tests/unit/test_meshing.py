"""Meshes of the bodies of a scene: their volume, their size, their grading, and what cannot be meshed."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from fenics_forming import kinematics, laws, meshing, scene
from fenics_forming.errors import MeshError
from fenics_forming.physics import gmsh_arrays
from fenics_forming.physics.bodies import automatic_size, body_mesh
from fenics_forming.physics.grading import CORNER_SIZE
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.tools import known_tools

FAR = scene.Tool(shape=scene.Plane(point=(0, 1e3), normal=(0, -1)))
FAR_3D = scene.Tool(shape=scene.Plane(point=(0, 0, 1e3), normal=(0, 0, -1)))


def scene_of(shape, geometry="plane_strain", *, symmetry=(), mesh_size=None, **tools):
    tools = tools or {"far": FAR_3D if geometry == "3d" else FAR}
    return scene.Scene(geometry=geometry, materials={"m": scene.Material(flow_stress=laws.Constant(value=100))},
                       workpieces={"b": scene.Workpiece(shape=shape, material="m", symmetry=symmetry,
                                                        mesh_size=mesh_size)},
                       tools=tools, steps=scene.Steps(time=1), stop=scene.Stop(time=1))


def meshed(described):
    mesh, size = body_mesh(described, known_tools(described), MPI.COMM_SELF)
    return Nodes(mesh), size


def volume(nodes, geometry):
    """Integral of the weight over the curved cells: area, volume of revolution, volume."""
    weight = kinematics.KINDS[geometry].weight(ufl.SpatialCoordinate(nodes.mesh))
    dx = ufl.Measure("dx", domain=nodes.mesh, metadata={"quadrature_degree": 6})
    return fem.assemble_scalar(fem.form(weight * dx if geometry == "axisymmetric" else 1.0 * dx))


# ---------------------------------------------------------------------- volumes
L_SHAPE = [(0, 0), (10, 0), (10, 4), (4, 4), (4, 10), (0, 10)]
# geometry, shape, mirrors, exact measure, its relative error: rounding where all sides are straight, else h^4
BODIES = {
    "rectangle": ("plane_strain", scene.Rectangle(from_=(1, 2), to=(5, 9)), (), 28.0, 1e-13),
    "rectangle turned": ("axisymmetric", scene.Rectangle(from_=(1, 2), to=(5, 9)), (), np.pi * 24 * 7, 1e-13),
    "polygon": ("plane_strain", scene.Polygon(points=L_SHAPE), (), 64.0, 1e-13),
    # five convex corners lose, the concave one wins, (1 - pi/4) r² each
    "polygon with fillets": ("plane_strain", scene.Polygon(points=L_SHAPE, fillet=2), (), 48 + 4 * np.pi, 1e-5),
    "circle": ("plane_strain", scene.Circle(centre=(1, 2), radius=5), (), 25 * np.pi, 1e-5),
    "half circle": ("plane_strain", scene.Circle(centre=(1, 2), radius=5), ("y",), 12.5 * np.pi, 1e-5),
    "quarter circle": ("plane_strain", scene.Circle(centre=(1, 2), radius=5), ("x", "y"), 6.25 * np.pi, 1e-5),
    "ball": ("axisymmetric", scene.Circle(centre=(0, 3), radius=5), (), 4 / 3 * np.pi * 125, 1e-5),
    "half ball": ("axisymmetric", scene.Circle(centre=(0, 3), radius=5), ("z",), 2 / 3 * np.pi * 125, 1e-5),
    "torus": ("axisymmetric", scene.Circle(centre=(10, 3), radius=5), (), 2 * np.pi * 10 * 25 * np.pi, 1e-5),
    "box": ("3d", scene.Box(from_=(1, 2, 3), to=(4, 4, 4)), (), 6.0, 1e-12),
    "cylinder": ("3d", scene.Cylinder(base=(1, 2, 3), radius=5, height=8), (), 200 * np.pi, 2e-4),
    "lying cylinder": ("3d", scene.Cylinder(base=(1, 2, 3), axis=(0, 2, 0), radius=5, height=8), (), 200 * np.pi, 2e-4),
    "half cylinder": ("3d", scene.Cylinder(base=(1, 2, 3), radius=5, height=8), ("y",), 100 * np.pi, 2e-4),
    "quarter cylinder": ("3d", scene.Cylinder(base=(1, 2, 3), radius=5, height=8), ("x", "y"), 50 * np.pi, 2e-4),
    "quarter on end": ("3d", scene.Cylinder(base=(1, 2, 3), radius=5, height=8), ("x", "y", "z"), 50 * np.pi, 2e-4),
}


@pytest.mark.parametrize("name", BODIES)
def test_mesh_has_the_volume_of_its_body(name):
    """And valid cells, none with two sides on the boundary; a mirrored round body is the half above its centre."""
    geometry, shape, mirrors, exact, tolerance = BODIES[name]
    nodes, size = meshed(scene_of(shape, geometry, symmetry=mirrors))
    assert volume(nodes, geometry) == pytest.approx(exact, rel=tolerance)
    assert nodes.smallest_jacobian() > 0
    low, high = np.array(shape.bounds(), float)
    axes = {"plane_strain": "xy", "axisymmetric": "rz", "3d": "xyz"}[geometry]
    for axis in [axes.index(m) for m in mirrors] + ([0] if "ball" in name else []):
        across = getattr(shape, "axis", (1,) * len(low))
        if shape.kind == "circle" or across[axis] == 0:
            low[axis] = (low[axis] + high[axis]) / 2
    # a curved side reaches its farthest point only where a node happens to lie
    slack = 3e-3 * shape.radius if hasattr(shape, "radius") else 1e-8
    assert nodes.extents() == pytest.approx(np.array([low, high]), abs=slack)


def test_volume_of_a_round_body_converges_with_the_number_of_its_sides():
    """Quadratic sides through points of the circle: order 4."""
    shape, errors, sides = scene.Circle(centre=(0, 0), radius=5), [], []
    for size in (2.0, 1.0, 0.5):
        nodes, used = meshed(scene_of(shape, mesh_size=size))
        assert used == size
        errors.append(abs(volume(nodes, "plane_strain") / (25 * np.pi) - 1))
        sides.append(len(meshing.exterior_facets(nodes.mesh)))
    orders = -np.diff(np.log(errors)) / np.diff(np.log(sides))
    assert orders == pytest.approx([4, 4], abs=0.1), (errors, sides)


# ---------------------------------------------------------------------- sizes
@pytest.mark.parametrize(("geometry", "shape"), [("plane_strain", scene.Rectangle(from_=(0, 0), to=(7, 7))),
                                                 ("3d", scene.Box(from_=(0, 0, 0), to=(7, 7, 7)))])
def test_automatic_size_cuts_a_square_and_a_cube_into_about_1200_cells(geometry, shape):
    nodes, size = meshed(scene_of(shape, geometry))
    assert len(nodes.cells) == pytest.approx(1200, rel=0.15)
    assert size == automatic_size(7.0 ** nodes.dim, nodes.dim)


@pytest.mark.parametrize("size", [1.0, 0.5])
def test_sides_are_as_long_as_the_mesh_size(size):
    nodes, _ = meshed(scene_of(scene.Rectangle(from_=(0, 0), to=(10, 6)), mesh_size=size))
    x = nodes.x[nodes.vertices]
    lengths = np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2)
    assert np.median(lengths) == pytest.approx(size, rel=0.15)
    assert lengths.max() < 1.6 * size


def longest_sides(nodes, at):
    """Mean of the longest sides of the cells that touch the point ``at``."""
    x = nodes.x[nodes.vertices]
    lengths = np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).max(axis=1)
    nearest = np.linalg.norm(x - at, axis=2).min(axis=1)
    return lengths[nearest <= nearest.min() + 1e-9].mean()


def test_mesh_is_fine_at_the_corners_of_tools_and_coarse_elsewhere():
    """A punch with a sharp corner on the body, half as wide; with a rounded one nothing is graded."""
    body = scene.Rectangle(from_=(0, 0), to=(20, 10))
    punch = [scene.Tool(shape=scene.Rectangle(from_=(0, 10), to=(10, 20), fillet=f)) for f in (0, [0, 2, 0, 0])]
    sharp, round_ = (meshed(scene_of(body, mesh_size=1.0, punch=p))[0] for p in punch)
    assert longest_sides(sharp, (10, 10)) < 1.4 * CORNER_SIZE    # the longest sides of uneven triangles
    assert longest_sides(sharp, (20, 0)) > 0.7
    assert longest_sides(round_, (10, 10)) > 0.7
    assert len(sharp.cells) > len(round_.cells)
    assert volume(sharp, "plane_strain") == pytest.approx(200, rel=1e-13)


def test_mesh_is_fine_at_corners_of_the_body_on_a_tool_with_friction():
    """The edge of the contact, from where the side folds down; without friction the flow there is smooth."""
    body = scene.Rectangle(from_=(0, 0), to=(10, 10))
    plane = scene.Plane(point=(0, 10), normal=(0, -1))
    rough, smooth = (meshed(scene_of(body, mesh_size=1.0, platen=scene.Tool(shape=plane, friction=f)))[0]
                     for f in (laws.Sticking(), laws.NoFriction()))
    assert longest_sides(rough, (10, 10)) < 1.4 * CORNER_SIZE <= longest_sides(rough, (10, 0))
    assert longest_sides(smooth, (10, 10)) > 0.7


def test_tool_corners_far_from_the_body_do_not_matter():
    body = scene.Rectangle(from_=(0, 0), to=(10, 10))
    tools = [scene.Tool(shape=scene.Rectangle(from_=(4, y), to=(30, y + 9))) for y in (10, 13)]
    near, far = (meshed(scene_of(body, mesh_size=1.0, t=tool)) for tool in tools)
    assert len(near[0].cells) > len(far[0].cells)
    assert len(far[0].cells) == len(meshed(scene_of(body, mesh_size=1.0))[0].cells)


@pytest.mark.parametrize("name", ["polygon with fillets", "quarter cylinder"])
def test_same_scene_gives_the_same_mesh(name):
    geometry, shape, mirrors, _, _ = BODIES[name]
    one, two = (meshed(scene_of(shape, geometry, symmetry=mirrors))[0] for _ in range(2))
    assert np.array_equal(one.x, two.x) and np.array_equal(one.cells, two.cells)


# ---------------------------------------------------------------------- files
@pytest.fixture
def files(tmp_path):
    """A box 2 x 3 x 4 with a bore of radius 0.5, as step, brep and msh; a rectangle 2 x 3 as msh."""
    with gmsh_arrays.gmsh_model() as gmsh:
        occ = gmsh.model.occ
        occ.cut([(3, occ.addBox(0, 0, 0, 2, 3, 4))], [(3, occ.addCylinder(1, 1, 0, 0, 0, 4, 0.5))])
        occ.synchronize()
        for ending in ("step", "brep"):
            gmsh.write(str(tmp_path / f"body.{ending}"))
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.6)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(tmp_path / "body.msh"))
    with gmsh_arrays.gmsh_model() as gmsh:
        gmsh.model.occ.addRectangle(0, 0, 0, 2, 3)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
        gmsh.model.mesh.generate(2)
        gmsh.write(str(tmp_path / "flat.msh"))
    return tmp_path


@pytest.mark.parametrize("ending", ["step", "brep", "msh"])
def test_body_from_a_file_has_its_volume_times_the_cube_of_the_scale(files, ending):
    exact = 24 - np.pi
    for scale in (1.0, 10.0):
        # automatic size for the mesh file, which has its own; sides below the radius of the bore for CAD files
        given = None if ending == "msh" else 0.3 * scale
        described = scene_of(scene.BodyFile(path=str(files / f"body.{ending}"), scale=scale), "3d", mesh_size=given)
        nodes, size = meshed(described)
        # the bore is meshed with about 6 to 8 curved sides
        assert volume(nodes, "3d") == pytest.approx(exact * scale**3, rel=2e-3)
        assert nodes.extents() == pytest.approx(scale * np.array([[0, 0, 0], [2, 3, 4]]), abs=1e-6 * scale)
        assert nodes.smallest_jacobian() > 0
        assert size == given or 0.2 * scale < size < 1.0 * scale, "the size follows the scale"


def test_cad_file_without_a_mesh_size_gets_the_automatic_one(files):
    _, size = meshed(scene_of(scene.BodyFile(path=str(files / "body.step"), scale=10.0), "3d"))
    # a step file keeps its numbers to a few digits, and gmsh integrates over its bore: 4e-4 measured
    assert size == pytest.approx(automatic_size(1000 * (24 - np.pi), 3), rel=1e-3)


def test_mesh_file_of_straight_triangles_is_raised_to_order_2(files):
    nodes, size = meshed(scene_of(scene.BodyFile(path=str(files / "flat.msh"), scale=2.0)))
    assert volume(nodes, "plane_strain") == pytest.approx(24.0, rel=1e-13)
    assert 0.5 < size < 1.2


@pytest.mark.parametrize("name", ["body.step", "body.msh"])
def test_mesh_size_of_the_scene_refines_a_cad_file(files, name):
    """A mesh file keeps its cells: it is a mesh already."""
    shape = scene.BodyFile(path=str(files / name))
    coarse, fine = (meshed(scene_of(shape, "3d", mesh_size=h))[0] for h in (0.8, 0.3))
    assert (len(fine.cells) > 2 * len(coarse.cells)) == (name == "body.step")


# ---------------------------------------------------------------------- what cannot be meshed
@pytest.mark.parametrize(("content", "ending"), [("nonsense", "msh"), ("nonsense", "step"), ("", "msh")])
def test_broken_file_is_a_mesh_error_with_a_sentence(tmp_path, content, ending):
    path = tmp_path / f"body.{ending}"
    path.write_text(content)
    with pytest.raises(MeshError) as refused:
        meshed(scene_of(scene.BodyFile(path=str(path)), "3d"))
    assert str(refused.value).startswith("gmsh could not mesh the body: ") and len(str(refused.value)) > 40


@pytest.mark.parametrize("name", ["flat.msh"])
def test_file_without_a_body_of_the_dimension_is_a_mesh_error(files, name):
    with pytest.raises(MeshError, match="it has no tetrahedra"):
        meshed(scene_of(scene.BodyFile(path=str(files / name)), "3d"))


def test_surface_in_a_cad_file_is_no_body(tmp_path):
    with gmsh_arrays.gmsh_model() as gmsh:
        gmsh.model.occ.addRectangle(0, 0, 0, 2, 3)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "flat.step"))
    with pytest.raises(MeshError, match="holds no body of dimension 3"):
        meshed(scene_of(scene.BodyFile(path=str(tmp_path / "flat.step")), "3d"))
    nodes, _ = meshed(scene_of(scene.BodyFile(path=str(tmp_path / "flat.step"))))
    assert volume(nodes, "plane_strain") == pytest.approx(6.0, rel=1e-12), "in the plane it is one"


def test_outline_that_gmsh_cannot_fill_is_a_mesh_error():
    with pytest.raises(MeshError, match="gmsh could not mesh the body: ."):
        meshing.polygon([(0, 0), (1, 1), (1, 0), (0, 1)], 0.3, comm=MPI.COMM_SELF)


def test_gmsh_is_left_as_it_was_found():
    """A user's own gmsh session survives a mesh that the package makes, and one that fails."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("mine")
        gmsh.model.geo.addPoint(0, 0, 0)
        gmsh.model.geo.synchronize()
        meshing.polygon([(0, 0), (1, 0), (1, 1)], 0.5, comm=MPI.COMM_SELF)
        assert gmsh.isInitialized() and "mine" in gmsh.model.list() and "fenics_forming" not in gmsh.model.list()
    finally:
        gmsh.finalize()
    with pytest.raises(MeshError):
        meshing.polygon([(0, 0), (1, 1), (1, 0), (0, 1)], 0.3, comm=MPI.COMM_SELF)
    assert not gmsh.isInitialized()


# ---------------------------------------------------------------------- meshes without gmsh
@pytest.mark.parametrize("dim", [2, 3])
def test_raising_a_mesh_to_order_2_keeps_its_body(dim):
    from dolfinx import mesh as dmesh

    make = dmesh.create_unit_square if dim == 2 else dmesh.create_unit_cube
    straight = make(MPI.COMM_SELF, *[3] * dim)
    raised = meshing.order_two(straight)
    nodes = Nodes(raised)
    assert nodes.cell_sizes().sum() == pytest.approx(1.0, rel=1e-14)
    assert len(nodes.x) == 7**dim and len(nodes.cells) == (18 if dim == 2 else 162)
    assert np.allclose(nodes.with_mids(nodes.x.copy()), nodes.x, atol=1e-15)
    assert meshing.order_two(raised) is raised


# ---------------------------------------------------------------------- cells beside coarse curved surfaces
def bored_plate(gmsh, bore):
    occ = gmsh.model.occ
    occ.cut([(3, occ.addBox(-10, -10, 0, 20, 20, 10))], [(3, occ.addCylinder(0, 0, -1, 0, 0, 12, bore))])
    occ.synchronize()


@pytest.mark.parametrize("bore", [3, 8])
def test_no_cell_beside_a_coarse_bore_is_inverted(bore):
    """Beside the bore of 8 mm gmsh turns cells inside out when raising them to order 2."""
    nodes = Nodes(meshing.generate(lambda gmsh: bored_plate(gmsh, bore), 3, 10.0))
    assert nodes.smallest_jacobian() > 0
    assert volume(nodes, "3d") == pytest.approx(10 * (400 - np.pi * bore**2), rel=0.02)


def test_a_bore_that_no_cell_can_follow_asks_for_a_smaller_mesh_size():
    with pytest.raises(MeshError, match="cells are turned inside out by the curved surface.* a smaller mesh_size"):
        meshing.generate(lambda gmsh: bored_plate(gmsh, 9), 3, 10.0)
