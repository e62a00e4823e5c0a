"""Element sizes: each source of them, how they grow, and what the meshes made with them look like."""

import numpy as np
import pytest
from mpi4py import MPI

from fenics_forming import laws, scene
from fenics_forming.physics.bodies import automatic_size, body_mesh
from fenics_forming.physics.contact.rigid import ToolMotion
from fenics_forming.physics.contact.surfaces import Circle, Plane
from fenics_forming.physics.contact.triangulated import Triangulated
from fenics_forming.physics.locating import Locator
from fenics_forming.physics.refining import cell_sizes
from fenics_forming.physics.remeshing import BodyArrays, remesh
from fenics_forming.physics.sizes import AtNodes, AtPoints, Remembered, Sizes, body_sizes, graded, nodal_sizes
from fenics_forming.physics.sizes.field import edges_of
from fenics_forming.physics.sizes.thickness import thickness
from fenics_forming.physics.sizes.wanted import thickness_sizes
from fenics_forming.physics.tools import known_tools
from fenics_forming.process.meshes.adaptation import EDGE_SIZE, FINEST, SHARE, adapted_sizes, contact_edges, gradient_sizes

SQUARE = scene.Rectangle(from_=(0, 0), to=(10, 10))
CUBE = scene.Box(from_=(0, 0, 0), to=(10, 10, 10))
PLATEN = scene.Tool(shape=scene.Plane(point=(0, 10), normal=(0, -1)))
PLATEN_3D = scene.Tool(shape=scene.Plane(point=(0, 0, 10), normal=(0, 0, -1)))


def scene_of(shape, *, mesh_size=1.0, symmetry=(), refine=(), remesh=None, geometry=None, **tools):
    space = shape.dimension == 3
    body = scene.Workpiece(shape=shape, material="m", symmetry=symmetry, mesh_size=mesh_size, refine=refine, remesh=remesh)
    return scene.Scene(geometry=geometry or ("3d" if space else "plane_strain"), workpieces={"b": body},
                       materials={"m": scene.Material(flow_stress=laws.Constant(value=100))},
                       tools=tools or {"platen": PLATEN_3D if space else PLATEN},
                       steps=scene.Steps(time=1), stop=scene.Stop(time=1))


def first_body(described):
    mesh, _ = body_mesh(described, known_tools(described), MPI.COMM_SELF)
    dim = described.dimension
    return BodyArrays(mesh.geometry.x[:, :dim].copy(), mesh.geometry.dofmap.astype(np.int64))


def centres(body):
    return body.x[body.cells[:, : body.dim + 1]].mean(axis=1)


def sides_at(body, where):
    """Median over the cells with their centre at ``where`` of the side of the regular cell of the same volume.

    gmsh packs cells of sides h: in the plane that is 1.0 h, in space (regular tetrahedra leave gaps) 1.1 to 1.2 h.
    """
    return np.median(cell_sizes(body)[where(centres(body))]) / {2: 1.0, 3: 1.15}[body.dim]


# ---------------------------------------------------------------------- the automatic size
@pytest.mark.parametrize("side", [0.1, 1.0, 7.0, 55.0, 300.0])
@pytest.mark.parametrize("dim", [2, 3])
def test_any_cube_and_any_square_has_about_1200_cells(dim, side):
    """FORMULATION.md 8; 15 %, because on an edge there must be a whole number of sides, about 5.5 in space."""
    shape = scene.Rectangle(from_=(0, 0), to=(side, side)) if dim == 2 else scene.Box(from_=(0, 0, 0), to=(side,) * 3)
    tool = scene.Tool(shape=scene.Plane(point=(0,) * (dim - 1) + (side,), normal=(0,) * (dim - 1) + (-1,)))
    body = first_body(scene_of(shape, mesh_size=None, platen=tool))
    assert len(body.cells) == pytest.approx(1200, rel=0.15)
    assert automatic_size(side**dim, dim) == pytest.approx({2: 0.044, 3: 0.183}[dim] * side)


# ---------------------------------------------------------------------- domains
def inside(x, low, high):
    return ((x > low) & (x < high)).all(axis=1)


DOMAINS = {
    "box": (SQUARE, scene.BoxDomain(from_=(2, 2), to=(6, 4), size=0.25), lambda x: inside(x, (2, 2), (6, 4)),
            lambda x: x[:, 1] > 8.5),
    "circle": (SQUARE, scene.SphereDomain(centre=(3, 3), radius=1.5, size=0.25),
               lambda x: np.hypot(*(x - 3).T) < 1.5, lambda x: x[:, 0] > 9),
    "near tool": (SQUARE, scene.NearTool(tool="platen", distance=1, size=0.25), lambda x: x[:, 1] > 9,
                  lambda x: x[:, 1] < 4.5),
    "near surface": (SQUARE, scene.NearSurface(distance=0.5, size=0.25),
                     lambda x: ~inside(x, 0.5, 9.5), lambda x: inside(x, 4.7, 5.3)),
    "box in space": (CUBE, scene.BoxDomain(from_=(2, 2, 2), to=(5, 5, 5), size=0.6), lambda x: inside(x, 2, 5), None),
    "ball": (CUBE, scene.SphereDomain(centre=(5, 5, 5), radius=2, size=0.6),
             lambda x: np.linalg.norm(x - 5, axis=1) < 2, None),
    "cylinder": (CUBE, scene.CylinderDomain(base=(5, 5, 0), axis=(0, 0, 2), radius=1.5, height=6, size=0.6),
                 lambda x: (np.hypot(x[:, 0] - 5, x[:, 1] - 5) < 1.5) & (x[:, 2] < 6), None),
    "near tool in space": (CUBE, scene.NearTool(tool="platen", distance=1, size=0.6), lambda x: x[:, 2] > 9,
                           lambda x: x[:, 2] < 2),
    "near surface in space": (CUBE, scene.NearSurface(distance=0.5, size=0.8), lambda x: ~inside(x, 0.5, 9.5), None),
}


@pytest.mark.parametrize("name", DOMAINS)
def test_first_mesh_has_the_size_of_a_domain_inside_and_its_own_far_away(name):
    shape, domain, within, far = DOMAINS[name]
    base = 1.0 if shape.dimension == 2 else 2.0
    body = first_body(scene_of(shape, mesh_size=base, refine=[domain]))
    # in space the sizes grow at the faces of a small domain already
    assert sides_at(body, within) == pytest.approx(domain.size, rel=0.15 if body.dim == 2 else 0.2)
    if far is not None:
        assert sides_at(body, far) == pytest.approx(base, rel=0.2)
    assert len(body.cells) > 1.5 * len(first_body(scene_of(shape, mesh_size=base)).cells)


@pytest.mark.parametrize("name", ["box", "circle", "near tool", "near surface"])
def test_next_mesh_has_the_size_of_a_domain_too(name):
    """Old mesh without the domain, new one with it: the same rule, whichever mesh it is asked on."""
    shape, domain, within, _ = DOMAINS[name]
    described = scene_of(shape, refine=[domain], remesh=True)
    old = first_body(scene_of(shape))
    labels = np.zeros(len(old.sides), dtype=int)
    sizes = adapted_sizes(described, known_tools(described), old, labels, {}, 1.0)
    assert sides_at(remesh(old, labels, sizes), within) == pytest.approx(domain.size, rel=0.15)


def test_domain_near_a_tool_goes_along_with_it():
    described = scene_of(SQUARE, refine=[scene.NearTool(tool="platen", distance=1, size=0.25)])
    tools = known_tools(described)
    tools[0].motion = ToolMotion(np.array([0.0, -4.0]), np.zeros(2))
    sizes = body_sizes(described, tools, first_body(scene_of(SQUARE)), {}, 1.0)
    assert sizes(np.array([[5.0, 6.0], [5.0, 5.5], [5.0, 4.0], [5.0, 0.0]])) == pytest.approx([0.25, 0.25, 0.45, 1.0])


def test_smallest_of_overlapping_domains_counts_whatever_their_order():
    coarse, fine = (scene.SphereDomain(centre=(5, 5), radius=r, size=s) for r, s in ((3, 0.5), (1, 0.2)))
    body = first_body(scene_of(SQUARE))
    points = np.random.default_rng(0).uniform(0, 10, (200, 2))
    one, two = (body_sizes(scene_of(SQUARE, refine=order), known_tools(scene_of(SQUARE)), body, {}, 1.0)(points)
                for order in ((coarse, fine), (fine, coarse)))
    assert np.array_equal(one, two)
    assert one.min() == 0.2


def test_mirror_planes_are_no_surface_of_the_body():
    domain = scene.NearSurface(distance=0.5, size=0.25)
    body = first_body(scene_of(SQUARE, symmetry=["x", "y"], refine=[domain]))
    assert sides_at(body, lambda x: x.max(axis=1) > 9.5) == pytest.approx(0.25, rel=0.15)
    assert sides_at(body, lambda x: x.max(axis=1) < 1.5) == pytest.approx(1.0, rel=0.2)


# ---------------------------------------------------------------------- growth
PUNCH = scene.Rectangle(from_=(0, 10), to=(5, 20), fillet=[0, 0.5, 0, 0])
EVERYTHING = [scene.NearSurface(distance=0.3, size=0.5), scene.SphereDomain(centre=(7, 3), radius=0.5, size=0.1),
              scene.NearTool(tool="punch", distance=0.5, size=0.3), scene.BoxDomain(from_=(1, 1), to=(2, 2), size=0.2)]


def everything(growth):
    return scene_of(SQUARE, refine=EVERYTHING, remesh={"growth": growth}, punch=scene.Tool(shape=PUNCH))


@pytest.mark.parametrize("growth", [0.1, 0.2, 0.4])
def test_size_grows_by_no_more_than_wanted_per_distance(growth):
    """Every source does: exactly, up to rounding; near points and far ones."""
    described = everything(growth)
    sizes = body_sizes(described, known_tools(described), first_body(scene_of(SQUARE)), {}, 1.0)
    rng = np.random.default_rng(1)
    a = rng.uniform(0, 10, (4000, 2))
    b = np.clip(a + rng.normal(size=a.shape) * rng.choice([1e-3, 0.1, 3.0], (len(a), 1)), 0, 10)
    change, apart = np.abs(sizes(a) - sizes(b)), np.linalg.norm(a - b, axis=1)
    assert (change <= growth * apart + 1e-12).all()
    assert (change / apart).max() > 0.99 * growth, "and by that much somewhere"


def neighbour_ratios(body):
    """Size of the larger over the smaller cell at every inner side of a plane mesh."""
    across = Locator(body.x, body.cells).neighbours
    first, _ = np.nonzero(across >= 0)
    size = cell_sizes(body)
    one, other = size[first], size[across[across >= 0]]
    return np.maximum(one, other) / np.minimum(one, other)


def test_cells_of_the_first_mesh_differ_little_from_their_neighbours():
    """Centres of neighbours are 0.6 sides apart: sizes that grow by 0.2 differ by 12 % there, and a mesher adds as
    much of its own (an even mesh of gmsh has ratios up to 1.3)."""
    ratios = {growth: neighbour_ratios(first_body(everything(growth))) for growth in (0.1, 0.2)}
    assert np.quantile(ratios[0.2], 0.99) < 1.4
    assert ratios[0.2].max() < 2.0
    assert len(ratios[0.1]) > 1.2 * len(ratios[0.2]), "a slower growth takes more cells"


@pytest.mark.parametrize("count", [5, 500])
def test_sizes_at_points_are_the_least_over_all_of_them(count):
    """Few points are compared one by one; many by trees of points of like size, to within that likeness."""
    rng = np.random.default_rng(count)
    at, size, points = rng.uniform(0, 10, (count, 2)), rng.uniform(0.05, 0.5, count), rng.uniform(0, 10, (300, 2))
    exact = np.minimum((size + 0.2 * np.linalg.norm(points[:, None] - at, axis=2)).min(axis=1), 1.0)
    found = AtPoints(at, size, 0.2, 1.0)(points)
    assert found == pytest.approx(exact, rel=0.1 if count > 100 else 1e-14)
    assert (found >= exact - 1e-14).all()
    assert AtPoints(at, size, 0.2, 1.0)(at) == pytest.approx(np.minimum(size, AtPoints(at, size, 0.2, 1.0)(at)))


def test_nodal_sizes_are_limited_along_the_edges():
    body = first_body(scene_of(SQUARE))
    size = np.full(len(body.x), np.inf)
    corner = int(np.argmin(body.x.sum(axis=1)))
    size[corner] = 0.1
    found = graded(size, body.x, body.cells[:, :3], 0.2)
    ends = edges_of(body.cells[:, :3])
    length = np.linalg.norm(np.diff(body.x[ends], axis=1)[:, 0], axis=1)
    assert found[corner] == 0.1
    assert (np.abs(np.diff(found[ends], axis=1))[:, 0] <= 0.2 * length * (1 + 1e-12) + 2e-3).all()
    vertices = np.unique(body.cells[:, :3])
    straight = 0.1 + 0.2 * np.linalg.norm(body.x[vertices] - body.x[corner], axis=1)
    # along edges the way is longer than straight, by 15 % at most among equilateral triangles
    assert (found[vertices] >= straight - 1e-9).all()
    assert (found[vertices] <= 0.1 + 1.2 * (straight - 0.1)).all()
    assert np.isinf(graded(np.full(len(body.x), np.inf), body.x, body.cells[:, :3], 0.2)).all()


def test_nodal_sizes_are_linear_in_between():
    body = first_body(scene_of(SQUARE))
    points = np.random.default_rng(2).uniform(0.1, 9.9, (50, 2))
    assert AtNodes(body, 1 + 0.1 * body.x[:, 0])(points) == pytest.approx(1 + 0.1 * points[:, 0])


# ---------------------------------------------------------------------- roundings of tools
def sides_on(body, where):
    """Lengths of the boundary sides with both ends at ``where``."""
    p = body.x[body.sides[:, : body.dim]]
    chosen = where(p.reshape(-1, 2)).reshape(len(p), 2).all(axis=1)
    return np.linalg.norm(p[chosen, 1] - p[chosen, 0], axis=1)


@pytest.mark.parametrize(("chord", "wanted"), [(None, 0.5 * np.pi / 6), (1e-3, np.sqrt(8 * 0.5 * 1e-3))])
def test_rounding_of_a_tool_on_the_body_asks_for_sides_that_follow_it(chord, wanted):
    """Three sides on a quarter of a turn, or the chord of an arc of that length: R - sqrt(R² - h²/4) = h²/8R."""
    described = scene_of(SQUARE, remesh={"chord": chord} if chord else True, punch=scene.Tool(shape=PUNCH))
    sizes = body_sizes(described, known_tools(described), first_body(scene_of(SQUARE)), {}, 1.0)
    assert sizes(np.array([[4.5, 10.0]])) == pytest.approx([wanted])
    assert sizes(np.array([[4.5, 9.0]])) == pytest.approx([wanted + 0.2])
    # the fillet starts at r = 4.5 and rises from the body
    there = sides_on(first_body(described), lambda x: (x[:, 1] > 10 - 1e-9) & (np.abs(x[:, 0] - 4.5) < 0.25))
    assert np.median(there) == pytest.approx(wanted, rel=0.4)


def test_rounding_does_not_count_far_from_the_body_nor_without_remeshing():
    at = np.array([[4.5, 10.0]])
    body = first_body(scene_of(SQUARE))
    for far, remeshed, expected in ((0, True, 0.5 * np.pi / 6), (3, True, 1.0), (0, None, 1.0)):
        described = scene_of(SQUARE, remesh=remeshed, punch=scene.Tool(shape=PUNCH))
        tools = known_tools(described)
        tools[0].motion = ToolMotion(np.array([0.0, far]), np.zeros(2))
        assert body_sizes(described, tools, body, {}, 1.0)(at) == pytest.approx([expected]), (far, remeshed)


def test_round_tool_asks_for_its_curvature_all_along():
    roll = scene.Tool(shape=scene.CircleTool(centre=(5, 11), radius=1))
    sizes = body_sizes(scene_of(SQUARE, remesh=True, roll=roll), known_tools(scene_of(SQUARE, remesh=True, roll=roll)),
                       first_body(scene_of(SQUARE)), {}, 1.0)
    assert sizes(np.array([[5.0, 10.0], [5.0, 9.0]])) == pytest.approx([np.pi / 6, np.pi / 6 + 0.2])


def test_min_size_bounds_what_tools_ask_for_but_not_domains():
    domain = scene.SphereDomain(centre=(9, 1), radius=0.5, size=0.05)
    described = scene_of(SQUARE, remesh={"min_size": 0.4}, refine=[domain], punch=scene.Tool(shape=PUNCH))
    sizes = body_sizes(described, known_tools(described), first_body(scene_of(SQUARE)), {}, 1.0)
    assert sizes(np.array([[4.5, 10.0], [9.0, 1.0]])) == pytest.approx([0.4, 0.05])


def test_max_size_bounds_the_size_of_every_mesh():
    body = first_body(scene_of(SQUARE, remesh={"max_size": 0.5}))
    assert sides_at(body, lambda x: x[:, 0] > 0) == pytest.approx(0.5, rel=0.15)
    described = scene_of(SQUARE, remesh={"max_size": 2.0})
    sizes = adapted_sizes(described, known_tools(described), body, np.zeros(len(body.sides), int), {}, 1.0)
    assert sizes(np.array([[5.0, 5.0]])) == pytest.approx([2.0]), "later meshes may be coarser than the first"


def test_facets_of_a_round_surface_tell_its_radius():
    """A cylinder of radius 5 in 36 facets, a box: facets of height h turn by h / R; right angles are edges."""
    angle = np.linspace(0, 2 * np.pi, 36, endpoint=False)
    ring = 5 * np.column_stack([np.cos(angle), np.sin(angle)])
    vertices = np.concatenate([np.c_[ring, np.zeros(36)], np.c_[ring, np.full(36, 9.0)]])
    i, j = np.arange(36), np.roll(np.arange(36), -1)
    mantle = np.concatenate([np.c_[i, j, j + 36], np.c_[i, j + 36, i + 36]])
    points, radius, _ = Triangulated(vertices, mantle).roundings(0.5)
    assert radius == pytest.approx(5.0, rel=5e-3)
    assert np.hypot(*points[:, :2].T) == pytest.approx(5.0)
    assert len(points) >= 36 * 18
    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
             [1, 5, 7], [1, 7, 3]]
    assert len(Triangulated(cube, np.array(faces)).roundings(0.5)[0]) == 0


def test_surfaces_without_fillets_have_no_points_of_them():
    assert Plane((0, 0), (0, 1)).radius is None
    assert [len(a) for a in Plane((0, 0), (0, 1)).roundings(0.1)] == [0, 0, 0]
    assert Circle((0, 0), 3.0).radius == 3.0


def test_turned_tool_has_its_corners_where_they_are_now():
    motion = ToolMotion(np.array([1.0, 2.0]), np.zeros(2), angle=0.7, centre=np.array([3.0, -1.0]))
    points = np.random.default_rng(3).normal(size=(5, 2))
    assert motion.to_tool(motion.to_space(points)) == pytest.approx(points, abs=1e-14)


# ---------------------------------------------------------------------- thin sections
FLASH = [(0, 0), (20, 0), (20, 1), (10, 1), (10, 10), (0, 10)]


def cells_across(body, start, end):
    """Number of cells on the way from one point to another."""
    s = np.linspace(0.003, 0.997, 500)[:, None]
    return len(np.unique(Locator(body.x, body.cells).find((1 - s) * np.array(start) + s * np.array(end)).cells))


@pytest.mark.parametrize(("symmetry", "least"), [((), 5), (("y",), 3)])
def test_thin_flash_has_its_elements(symmetry, least):
    """A line across three layers of triangles meets five or six, across the two above a mirror plane three or four;
    without `remesh` there is one layer."""
    flash = scene.Polygon(points=FLASH)
    body = first_body(scene_of(flash, mesh_size=2.0, symmetry=symmetry, remesh=True))
    coarse = first_body(scene_of(flash, mesh_size=2.0, symmetry=symmetry))
    places = np.linspace(11, 19, 9)
    assert min(cells_across(body, (x, 0), (x, 1)) for x in places) >= least
    assert min(cells_across(coarse, (x, 0), (x, 1)) for x in places) < least
    assert sides_at(body, lambda x: (x[:, 0] < 7) & (x[:, 1] > 4)) > 1.0, "and elsewhere nothing changes much"


def test_thin_plate_in_space_has_its_elements():
    plate = scene.Box(from_=(0, 0, 0), to=(10, 10, 1))
    body = first_body(scene_of(plate, mesh_size=2.0, remesh=True))
    assert sides_at(body, lambda x: x[:, 0] > 0) == pytest.approx(0.5, rel=0.2)


@pytest.mark.parametrize("symmetry", [(), ("z",), ("y", "z")])
def test_rim_of_a_lip_in_space_is_no_thin_section(symmetry):
    """A wedge of 51 degrees that ends in a rim of 0.2 mm: the way around its rim is nowhere three times as long as the one
    across, with its upper half alone neither. A plate of that thickness asks for half of it, beside mirror planes as well;
    only within its thickness of its own rim the way is no longer."""
    low = {axis: 0.0 if axis in symmetry else -2.0 for axis in "yz"}
    block = scene.Box(from_=(0, low["y"], low["z"]), to=(4, 2, 2))
    described = scene_of(block, mesh_size=1.0, remesh=True, symmetry=symmetry)
    body, mirrors = first_body(described), {"xyz".index(axis): 0.0 for axis in symmetry}
    sizes = Sizes(base=2.0, least=0.01, growth=0.2)

    def wanted(height):
        x = body.x * [1.0, 1.0, 0.0] + (body.x[:, 2] * height)[:, None] * [0.0, 0.0, 1.0]
        return x, thickness_sizes(BodyArrays(x, body.cells), mirrors, sizes)

    x, wedge = wanted(1.0 - 0.2375 * body.x[:, 0])
    assert np.isinf(wedge[x[:, 0] > 2.5]).all()
    x, plate = wanted(np.full(len(body.x), 0.05))
    thin = (x[:, 0] > 0.5) & (x[:, 0] < 3.5) & (x[:, 1] < 1.5) & np.isfinite(plate)
    assert thin.sum() > 10 and plate[thin] == pytest.approx(0.1 / 1.5 if "z" in symmetry else 0.1)
    if "y" in symmetry:
        assert np.isfinite(plate[(x[:, 1] < 1e-9) & (x[:, 2] > 0.09) & (x[:, 0] > 0.5) & (x[:, 0] < 3.5)]).any()


@pytest.mark.parametrize(("shape", "exact"), [(scene.Rectangle(from_=(0, 0), to=(9, 2)), 2.0),
                                              (scene.Box(from_=(0, 0, 0), to=(9, 8, 2)), 2.0)])
def test_thickness_is_the_distance_to_the_side_that_faces_away(shape, exact):
    """At right angles the neighbour behind a corner is not met; the long way across lies out of reach."""
    body = first_body(scene_of(shape))
    dim = body.dim
    distance, met = thickness(body.x, body.sides[:, :dim], 4.0)
    p = body.x[body.sides[:, :dim]]
    flat = (np.ptp(p[..., -1], axis=1) < 1e-9)
    assert distance[flat] == pytest.approx(exact, rel=1e-12)
    assert np.isinf(distance[~flat]).all() and (met[~flat] == -1).all()
    assert p[met[flat], 0, -1] == pytest.approx(2.0 - p[flat, 0, -1])


@pytest.mark.parametrize("dim", [2, 3])
def test_thick_body_asks_for_nothing(dim):
    shape = SQUARE if dim == 2 else CUBE
    plain, remeshed = (first_body(scene_of(shape, mesh_size=1.5, remesh=r)) for r in (None, True))
    if dim == 3:     # inside, cells at edges are cut in another way
        assert len(plain.sides) == len(remeshed.sides)
    else:
        assert np.array_equal(plain.x, remeshed.x) and np.array_equal(plain.cells, remeshed.cells)


# ---------------------------------------------------------------------- gradients
def band(x, width=0.5):
    """Steps from 0 to 1 across the diagonal of the square."""
    return 0.5 * (1 + np.tanh((x[:, 0] - x[:, 1]) / (np.sqrt(2) * width)))


def test_gradient_asks_for_a_share_of_the_range_in_each_element():
    """f = x on 10 mm: all but 2 % of the volume at both ends lie within 9.6, so h = 0.2 * 9.6 / strength."""
    body = first_body(scene_of(SQUARE, mesh_size=0.2))
    vertices = np.unique(body.cells[:, :3])
    for strength in (1.0, 4.0):
        size = gradient_sizes(body, body.x[:, 0], strength)[vertices]
        assert size == pytest.approx(SHARE * 9.6 / strength, rel=0.03)
    assert gradient_sizes(body, 7 - 300 * body.x[:, 0], 4.0)[vertices] == pytest.approx(size), "of any scale"
    assert np.isinf(gradient_sizes(body, np.full(len(body.x), 3.0), 1.0)).all(), "an even field asks for nothing"


@pytest.mark.parametrize("key", ["strain_rate", "temperature"])
def test_elements_gather_where_the_field_changes(key):
    """The band is a ninth of the square; at strength 2 most of the cells lie in it, and none spans much of the step."""
    old = first_body(scene_of(SQUARE, mesh_size=0.5))
    described = scene_of(SQUARE, remesh={key: 2.0, "min_size": 0.05})
    labels = np.zeros(len(old.sides), dtype=int)
    meshes = {}
    for given in ({}, {key: band(old.x)}):
        sizes = adapted_sizes(described, known_tools(described), old, labels, {}, 1.0, **given)
        meshes[len(given)] = remesh(old, labels, sizes)
    near = {k: (np.abs(np.diff(centres(m), axis=1)[:, 0]) < 0.8).mean() for k, m in meshes.items()}
    assert near[0] == pytest.approx(0.15, abs=0.05)
    assert near[1] > 0.45
    # at the middle of the band the slope is 1, where the width is 0.5: h = 0.2 / 2 of the range
    middle = sides_at(meshes[1], lambda x: np.abs(x[:, 0] - x[:, 1]) < 0.2)
    assert 0.08 < middle < 0.2
    change = np.ptp(band(meshes[1].x)[meshes[1].cells[:, :3]], axis=1)
    assert np.quantile(change, 0.99) < 0.25


def test_gradients_refine_no_further_than_a_quarter_of_the_mesh_size_unless_told_so():
    """A shear band of a rigid-plastic body has no width of its own."""
    old = first_body(scene_of(SQUARE, mesh_size=0.5))
    for least, expected in ((None, FINEST), (0.1, 0.1)):
        described = scene_of(SQUARE, remesh={"strain_rate": 50.0} | ({"min_size": least} if least else {}))
        sizes = adapted_sizes(described, known_tools(described), old, np.zeros(len(old.sides), int), {}, 1.0,
                              strain_rate=band(old.x))
        assert sizes(old.x[np.unique(old.cells[:, :3])]).min() == pytest.approx(expected)


def test_field_without_numbers_asks_for_nothing():
    """A flow that has broken down must not take the sizes of the next mesh with it."""
    old = first_body(scene_of(SQUARE))
    described = scene_of(SQUARE, remesh={"strain_rate": 1.0})
    field = band(old.x)
    for broken in (np.full(len(field), np.nan), np.where(old.x[:, 0] < 2, np.nan, field)):
        sizes = adapted_sizes(described, known_tools(described), old, np.zeros(len(old.sides), int), {}, 1.0,
                              strain_rate=broken)
        assert np.isfinite(sizes(old.x)).all()
        assert sizes(old.x).min() >= FINEST


def test_gradient_that_the_scene_does_not_name_is_not_read():
    old = first_body(scene_of(SQUARE))
    described = scene_of(SQUARE, remesh=True)
    sizes = adapted_sizes(described, known_tools(described), old, np.zeros(len(old.sides), int), {}, 1.0,
                          strain_rate=np.full(len(old.x), np.nan))
    assert sizes(np.array([[5.0, 5.0]])) == pytest.approx([1.0])


# ---------------------------------------------------------------------- contact
@pytest.mark.parametrize(("friction", "corners"), [
    (laws.Sticking(), 2), (laws.Siebel(factor=0.5), 2), (laws.NoFriction(), 0)])
def test_mesh_is_fine_where_the_contact_with_a_rough_tool_ends(friction, corners):
    """Finest where the body sticks and no slip softens the singularity."""
    body = first_body(scene_of(SQUARE))
    top = (body.x[body.sides[:, :2], 1] > 10 - 1e-9).all(axis=1)
    described = scene_of(SQUARE, remesh=True, platen=scene.Tool(shape=PLATEN.shape, friction=friction))
    tools = known_tools(described)
    ends = contact_edges(body, top.astype(int), [tool.has_friction for tool in tools])
    assert len(ends) == corners
    sizes = adapted_sizes(described, tools, body, top.astype(int), {}, 1.0)
    assert sizes(np.array([[0.0, 10.0], [10.0, 10.0], [5.0, 5.0]])) == pytest.approx(
        [EDGE_SIZE[friction.sticks], EDGE_SIZE[friction.sticks], 1.0] if corners else [1.0, 1.0, 1.0])


# ---------------------------------------------------------------------- first mesh
def test_same_scene_gives_the_same_refined_mesh():
    one, two = (first_body(everything(0.2)) for _ in range(2))
    assert np.array_equal(one.x, two.x) and np.array_equal(one.cells, two.cells)


def test_first_mesh_fits_what_is_wanted_on_it():
    """No cell is much larger than its corners want, and hardly any is half as large."""
    described = everything(0.2)
    body = first_body(described)
    sizes = body_sizes(described, known_tools(described), body, {}, 1.0)
    wanted = nodal_sizes(sizes, body, {}, thin=True)[body.cells[:, :3]].mean(axis=1)
    ratio = cell_sizes(body) / wanted
    assert ratio.max() < 1.6
    assert np.quantile(ratio, 0.02) > 0.5
    assert np.median(ratio) == pytest.approx(1.0, abs=0.15)


def test_refinement_keeps_the_body():
    """The same area to rounding, curved sides included: refined meshes lie on the same shape."""
    round_ = scene.Circle(centre=(5, 5), radius=5)
    domain = scene.NearSurface(distance=0.5, size=0.3)
    areas = []
    for refine in ((), (domain,)):
        mesh, _ = body_mesh(scene_of(round_, refine=refine), [], MPI.COMM_SELF)
        from dolfinx import fem
        areas.append(fem.assemble_scalar(fem.form(fem.Constant(mesh, 1.0) * _dx(mesh))))
    assert areas == pytest.approx([25 * np.pi] * 2, rel=1e-4)
    assert abs(areas[1] - 25 * np.pi) < abs(areas[0] - 25 * np.pi)


def _dx(mesh):
    import ufl

    return ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": 4})


def test_sizes_remembered_at_some_points_are_the_same_everywhere():
    rng = np.random.default_rng(5)
    sizes = AtPoints(rng.uniform(0, 1, (7, 2)), 0.1, 0.2, 1.0)
    points = rng.uniform(0, 1, (50, 2))
    remembered = Remembered(sizes, points[:30])
    assert np.array_equal(remembered(points), sizes(points))
    assert np.array_equal(remembered(points[40:]), sizes(points[40:]))
