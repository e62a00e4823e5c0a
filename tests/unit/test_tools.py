"""From the tools of a scene to their contact surfaces: side, fillets, mirrored outlines, files."""

import numpy as np
import pytest

from fenics_forming import laws, scene
from fenics_forming.errors import SceneError
from fenics_forming.physics.tools import known_tools, surface_of

DOWN = laws.SpeedDrive(velocity=(0, -1))


def scene_with(geometry="plane_strain", **tools):
    """A block under the given tools; only the tools matter here."""
    flat = geometry != "3d"
    body = scene.Rectangle(from_=(0, 0), to=(10, 10)) if flat else scene.Box(from_=(0, 0, 0), to=(10, 10, 10))
    return scene.Scene(geometry=geometry, materials={"m": scene.Material(flow_stress=laws.Constant(value=100))},
                       workpieces={"b": scene.Workpiece(shape=body, material="m")}, tools=tools,
                       steps=scene.Steps(time=1), stop=scene.Stop(time=1))


def surface(shape, geometry="plane_strain", **more):
    tool = scene.Tool(shape=shape, **more)
    return surface_of(tool, scene_with(geometry, t=tool))


def gap(surface, *points):
    return surface.closest(np.array(points, float))[0]


def normal(surface, *point):
    return surface.closest(np.array([point], float))[1][0]


def test_plane_has_its_gap_along_a_normal_of_any_length():
    found = surface(scene.Plane(point=(0, 10), normal=(0, -3)))
    assert gap(found, (4, 9), (-7, 11)) == pytest.approx([1, -1])
    assert normal(found, 4, 9) == pytest.approx([0, -1])


ROUND = [(scene.CircleTool, "plane_strain", {"centre": (1, 2)}), (scene.SphereTool, "3d", {"centre": (1, 2, 3)}),
         (scene.CylinderTool, "3d", {"centre": (1, 2, 3), "axis": (0, 0, 2)})]


@pytest.mark.parametrize(("kind", "geometry", "place"), ROUND, ids=["circle", "sphere", "cylinder"])
def test_round_tools_are_outside_or_around_the_body(kind, geometry, place):
    """Gap |x - c| - R, of the opposite sign when hollow, and the normal turned with it."""
    point = np.array(place["centre"]) + [3, *([0] * (len(place["centre"]) - 1))]
    solid, hollow = (surface(kind(radius=2, hollow=h, **place), geometry) for h in (False, True))
    assert gap(solid, point) == pytest.approx([1]) and gap(hollow, point) == pytest.approx([-1])
    assert normal(solid, *point)[0] == pytest.approx(1) and normal(hollow, *point)[0] == pytest.approx(-1)


def test_cylinder_is_endless_along_its_axis():
    found = surface(scene.CylinderTool(centre=(0, 0, 0), axis=(0, 1, 1), radius=1), "3d")
    along = np.array([0, 1, 1]) / np.sqrt(2)
    assert gap(found, 100 * along + [3, 0, 0]) == pytest.approx([2])


STEP = [(0, 0), (10, 0), (10, 10)]      # corner at (10, 0) turns to the left


@pytest.mark.parametrize("side", ["left", "right"])
def test_polyline_has_the_body_on_the_side_that_is_named(side):
    """Above the floor and left of the wall, or the other way round."""
    found = surface(scene.Polyline(points=STEP, side=side))
    sign = 1 if side == "left" else -1
    assert gap(found, (5, 1), (5, -1), (9, 5), (11, 5)) == pytest.approx([sign, -sign, sign, -sign])
    assert normal(found, 5, 1) == pytest.approx([0, sign])


@pytest.mark.parametrize("side", ["left", "right"])
def test_polyline_rounds_each_corner_by_its_own_radius(side):
    """Radii follow their points also where the walking sense is turned: 2 mm at (10, 0), 1 mm at (10, 10)."""
    points = [*STEP, (20, 10)]
    found = surface(scene.Polyline(points=points, side=side, fillet=[0, 2, 1, 0]))
    sign = 1 if side == "left" else -1
    corner = np.sqrt(2) - 1
    # the sharp corners lie this far off their arcs, the first inside the tool, the second outside
    assert gap(found, (10, 0), (10, 10)) == pytest.approx([-sign * 2 * corner, sign * corner])
    assert len(found.corners()) == 0


def test_closed_shapes_are_solid_whichever_way_their_points_run():
    square = [(0, 10), (4, 10), (4, 14), (0, 14)]
    for points in (square, square[::-1]):
        found = surface(scene.Polygon(points=points))
        assert gap(found, (2, 9), (2, 11), (5, 12)) == pytest.approx([1, -1, 1])
        assert len(found.corners()) == 4
    found = surface(scene.Rectangle(from_=(0, 10), to=(4, 14)))
    assert gap(found, (2, 9), (2, 11), (5, 12)) == pytest.approx([1, -1, 1])


def test_rectangle_rounds_each_corner_by_its_own_radius():
    """From the lower left counter-clockwise: 0, 1, 2, 0.5 mm."""
    found = surface(scene.Rectangle(from_=(0, 0), to=(10, 10), fillet=[0, 1, 2, 0.5]))
    corners = [(0, 0), (10, 0), (10, 10), (0, 10)]
    assert gap(found, *corners) == pytest.approx((np.sqrt(2) - 1) * np.array([0, 1, 2, 0.5]), abs=1e-12)
    assert found.corners() == pytest.approx(np.array([[0.0, 0.0]]))


def test_polygon_rounds_each_corner_by_its_own_radius_whichever_way_its_points_run():
    corners, radii = [(0, 0), (10, 0), (10, 10), (0, 10)], [0, 1, 2, 0.5]
    for sense in (1, -1):
        found = surface(scene.Polygon(points=corners[::sense], fillet=radii[::sense]))
        assert gap(found, *corners) == pytest.approx((np.sqrt(2) - 1) * np.array(radii), abs=1e-12)


# ---------------------------------------------------------------------- mirror planes
def test_half_a_punch_goes_on_beyond_its_mirror_plane():
    """With symmetry x the left side of the outline is no surface: below the punch the gap is to its face."""
    shape = scene.Rectangle(from_=(0, 10), to=(4, 20))
    whole, half = surface(shape), surface(shape, symmetry=["x"])
    # just inside the mirror plane, in the material of the punch: the way out is down, not sideways
    assert gap(half, (0.1, 11), (0, 11), (0.1, 9)) == pytest.approx([-1, -1, 1])
    assert normal(half, 0, 10) == pytest.approx([0, -1])
    assert gap(whole, (0.1, 11)) == pytest.approx([-0.1]), "without symmetry it is the side"
    # its corners near the body: only the outer one, and those of the far side are beyond the mirror
    near = half.corners()[half.corners()[:, 0] >= 0]
    assert near == pytest.approx(np.array([[4, 20], [4, 10]]))
    assert len(whole.corners()) == 4


def test_half_a_punch_is_that_half_of_the_whole_one():
    half = surface(scene.Rectangle(from_=(0, 10), to=(4, 20), fillet=[0, 1, 1, 0]), symmetry=["x"])
    whole = surface(scene.Rectangle(from_=(-4, 10), to=(4, 20), fillet=1))
    x = np.random.default_rng(1).uniform((0, 5), (8, 25), (300, 2))
    for one, other in zip(half.closest(x), whole.closest(x), strict=True):
        assert one == pytest.approx(other, abs=1e-12)


@pytest.mark.parametrize("reach", [0.0, 3.0])
def test_axis_of_rotation_is_a_mirror_by_itself(reach):
    """A punch that reaches the axis goes on beyond it; a ring-shaped one has an inner side."""
    found = surface(scene.Rectangle(from_=(reach, 10), to=(6, 20)), "axisymmetric")
    expected = -1.0 if reach == 0 else -0.1
    assert gap(found, (reach + 0.1, 11)) == pytest.approx([expected])


def test_quarter_of_a_tool_goes_on_beyond_both_mirror_planes():
    """A mandrel of square section, mirrored on x and y: its only surface is the outer one."""
    found = surface(scene.Rectangle(from_=(0, 0), to=(4, 6)), symmetry=["x", "y"])
    assert gap(found, (0.1, 0.1), (0, 5), (5, 0.1)) == pytest.approx([-3.9, -1, 1])


def test_cone_that_ends_on_the_axis_has_no_surface_along_it():
    """Its mantle is at 45°: near the axis the way out is to the mantle."""
    found = surface(scene.Polygon(points=[(0, 0), (4, 4), (0, 4)]), "axisymmetric")
    assert gap(found, (1, 0), (0.1, 1)) == pytest.approx([np.sqrt(0.5), -0.9 / np.sqrt(2)])


def test_side_of_several_points_on_the_mirror_plane_is_no_surface_either():
    """The same half punch with points in between on the mirror plane."""
    corners = [(0, 10), (4, 10), (4, 20), (0, 20), (0, 17), (0, 13)]
    plain, pointed = (surface(scene.Polygon(points=p), symmetry=["x"]) for p in (corners[:4], corners))
    x = np.random.default_rng(2).uniform((0, 5), (8, 25), (300, 2))
    assert gap(pointed, *x) == pytest.approx(gap(plain, *x), abs=1e-12)


# ---------------------------------------------------------------------- files
TETRAHEDRON = """solid t
facet normal 0 0 -1
outer loop
vertex 0 0 0
vertex 0 1 0
vertex 1 0 0
endloop
endfacet
facet normal 0 -1 0
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 0 1
endloop
endfacet
facet normal -1 0 0
outer loop
vertex 0 0 0
vertex 0 0 1
vertex 0 1 0
endloop
endfacet
facet normal 1 1 1
outer loop
vertex 1 0 0
vertex 0 1 0
vertex 0 0 1
endloop
endfacet
endsolid t
"""


def test_stl_is_scaled_first_and_shifted_then(tmp_path):
    path = tmp_path / "t.stl"
    path.write_text(TETRAHEDRON)
    found = surface(scene.Stl(path=str(path), scale=10, offset=(1, 2, 3)), "3d")
    low, high = found.bounds()
    assert low == pytest.approx([1, 2, 3]) and high == pytest.approx([11, 12, 13])
    # below its floor z = 3, and inside it
    assert gap(found, (3, 4, 2), (2, 4, 3.5)) == pytest.approx([1, -0.5])
    plain = surface(scene.Stl(path=str(path)), "3d")
    assert plain.bounds()[1] == pytest.approx([1, 1, 1])


def test_file_that_is_no_stl_is_refused_at_its_key_said_once(tmp_path):
    path = tmp_path / "bad.stl"
    path.write_text("no surface here")
    shape = scene.Stl(path=str(path))
    with pytest.raises(SceneError) as refused:
        known_tools(scene_with("3d", punch=scene.Tool(shape=shape)))
    assert str(refused.value).startswith("tools.punch.shape.")
    assert refused.value.key.startswith("tools.punch.shape.")
    last_word = refused.value.key.rsplit(".", 1)[1]
    assert f"{last_word}: {last_word}:" not in str(refused.value)
    assert "is not an STL file" in str(refused.value)


# ---------------------------------------------------------------------- all tools of a scene
def test_tools_keep_their_order_names_and_friction():
    plane = scene.Plane(point=(0, 10), normal=(0, -1))
    tools = known_tools(scene_with(upper=scene.Tool(shape=plane, drive=DOWN, friction=laws.Sticking()),
                                   lower=scene.Tool(shape=scene.Plane(point=(0, 0), normal=(0, 1))),
                                   side=scene.Tool(shape=scene.Plane(point=(10, 0), normal=(-1, 0)),
                                                   friction=laws.Siebel(factor=0.2))))
    assert [t.name for t in tools] == ["upper", "lower", "side"]
    assert [t.has_friction for t in tools] == [True, False, True]
    assert [t.sticks for t in tools] == [True, False, False]
    assert tools[1].friction is None, "absent, not zero"


@pytest.mark.parametrize("dim", [2, 3])
def test_body_from_a_file_is_met_at_its_outer_sides(tmp_path, dim):
    """A plate that gmsh has written: the gaps above and beside it; its mirror plane is no surface."""
    import gmsh
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    if dim == 3:
        gmsh.model.occ.addBox(0, 0, 0, 10, 10, 4)
    else:
        gmsh.model.occ.addRectangle(0, 0, 0, 10, 4)
    gmsh.model.occ.synchronize()
    gmsh.write(str(tmp_path / "plate.brep"))
    gmsh.finalize()
    tool = scene.Tool(shape=scene.BodyFile(path=str(tmp_path / "plate.brep")), material="m", mesh_size=3, symmetry=["x"])
    found = surface_of(tool, scene_with("plane_strain" if dim == 2 else "3d", t=tool))
    high = [[5.0, 6.0], [0.0, 5.0], [12.0, 2.0], [0.5, 2.0]] if dim == 2 else \
        [[5.0, 5, 6], [0.0, 5, 5], [12.0, 5, 2], [0.5, 5, 2]]
    assert gap(found, *high) == pytest.approx([2, 1, 2, -2])
    assert normal(found, *high[0])[-1] == pytest.approx(1)


def test_outline_of_a_body_with_a_hole_is_refused():
    from fenics_forming.physics.file_surfaces import outline_of
    square = np.array([[0, 0], [4, 0], [4, 4], [0, 4]], float)
    sides = np.array([[a, b, (a + b) / 2] for a, b in zip(square, np.roll(square, -1, axis=0), strict=True)])
    assert outline_of(sides) == pytest.approx(square)
    with pytest.raises(SceneError, match="several outlines"):
        outline_of(np.concatenate([sides, 0.25 * sides[:, [1, 0, 2]] + 1]))
