"""Scenes: the same from Python and TOML, round trips, repr, schema, shapes without a mesh, warnings."""

import copy
import json
import math
import pickle
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fenics_forming import laws, scene
from fenics_forming.errors import SceneError
from fenics_forming.scene import check, read_scene, write_scene
from fenics_forming.scene.printing import broken

DEMOS = Path(__file__).parents[2] / "demos" / "scenes"
THIS_ROUND = ("billet_upsetting", "ring_compression")


def billet(**changes):
    """The scene of billet_upsetting.toml, written in Python."""
    parts = {
        "title": "Upsetting of a cylindrical billet between rough dies (REFERENCES.md 3.3)",
        "geometry": "axisymmetric",
        "materials": {"billet": scene.Material(flow_stress=laws.Linear(initial="0.7 GPa", hardening=300))},
        "workpieces": {
            "billet": scene.Workpiece(
                shape=scene.Rectangle(from_=(0, 0), to=(10, "1.5 cm")), symmetry=["z"], material="billet", mesh_size=1
            )
        },
        "tools": {
            "upper": scene.Tool(
                shape=scene.Plane(point=(0, 15), normal=(0, -1)),
                drive=laws.SpeedDrive(velocity=(0, -1)),
                friction=laws.Sticking(),
            )
        },
        "points": {"equator": scene.TrackedPoint(body="billet", at=(10, 0))},
        "steps": scene.Steps(stroke="0.25 mm", scheme="implicit"),
        "stop": scene.Stop(stroke="9 mm"),
    }
    return scene.Scene(**parts | changes)


def test_scene_from_python_equals_scene_from_toml():
    assert billet() == read_scene(DEMOS / "billet_upsetting.toml")
    assert hash(billet()) == hash(read_scene(DEMOS / "billet_upsetting.toml"))


@pytest.mark.parametrize("name", THIS_ROUND)
def test_demo_scene_survives_toml_copy_and_pickle(name, tmp_path):
    read = read_scene(DEMOS / f"{name}.toml")
    write_scene(read, tmp_path / "copy.toml")
    assert read_scene(tmp_path / "copy.toml") == read
    assert scene.Scene.read(tomllib.loads(read.to_toml())) == read
    assert copy.deepcopy(read) == read == pickle.loads(pickle.dumps(read))


def test_demo_scenes_are_in_order():
    assert check(read_scene(DEMOS / "billet_upsetting.toml")) == []
    assert check(read_scene(DEMOS / "ring_compression.toml")) == []


LENGTHS = st.floats(1e-3, 1e4)
SHAPES = st.one_of(
    st.builds(lambda w, h: scene.Rectangle(from_=(0, 0), to=(w, h)), LENGTHS, LENGTHS),
    st.builds(lambda r: scene.Circle(centre=(0, r), radius=r), LENGTHS),
    st.builds(lambda w, h: scene.Polygon(points=[(0, 0), (0, h), (w, 0)], fillet=0.01 * min(w, h)), LENGTHS, LENGTHS),
)
FLOW = st.one_of(
    st.builds(lambda k: laws.Constant(value=k), LENGTHS),
    st.builds(lambda k, n: laws.Power(K=k, n=n, m=1 - n), LENGTHS, st.floats(0, 1)),
    st.builds(lambda k, n: laws.HenselSpittel(A=k, m1=-n, m4=n), LENGTHS, st.floats(0, 1)),
    st.builds(lambda k: laws.Table(strain=[0, 1], rate=[1], stress=[[k], [2 * k]]), LENGTHS),
)
DRIVES = st.one_of(
    st.builds(lambda v: laws.SpeedDrive(velocity=(0, -v)), LENGTHS),
    st.builds(lambda v: laws.TableDrive(direction=(0, -1), times=(0, 1), displacement=(0, v)), LENGTHS),
    st.builds(lambda v: laws.RotationDrive(speed=v, centre=(1, v)), LENGTHS),
    st.none(),
)
STEPS = st.builds(lambda s, a: scene.Steps(time=s, adaptive=a), LENGTHS, st.booleans())
OUTPUT = st.builds(lambda n, s: scene.Output(fields_every=n, strokes=s), st.integers(0, 9), st.lists(LENGTHS))


@settings(max_examples=60, deadline=None, derandomize=True)
@given(SHAPES, FLOW, DRIVES, STEPS, OUTPUT, st.text(max_size=20))
def test_any_scene_survives_its_toml(shape, flow, drive, steps, output, title):
    tool = scene.Tool(shape=scene.Plane(point=(0, 5), normal=(0, -1)), drive=drive, friction=laws.Siebel(factor=0.1))
    built = billet(
        title=title,
        materials={"m": scene.Material(flow_stress=flow, density="7.8 g/cm^3")},
        workpieces={"b": scene.Workpiece(shape=shape, material="m", temperature=900)},
        tools={"t": tool},
        points={},
        steps=steps,
        output=output,
        solver=scene.Solver(augmented=True),
    )
    assert scene.Scene.read(tomllib.loads(built.to_toml())) == built


def test_set_changes_a_key_before_the_scene_is_read():
    read = read_scene(
        DEMOS / "billet_upsetting.toml",
        set=["workpieces.billet.mesh_size=2 mm", "steps.scheme=etd2", "output.fields_every=3", 'title="x"'],
    )
    assert read.workpiece.mesh_size == 2
    assert (read.scheme, read.output.fields_every, read.title) == ("etd2", 3, "x")


def test_files_are_relative_to_the_scene_file(tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "flow.csv").write_text("strain,stress\n0,100\n1,200\n")
    text = (DEMOS / "billet_upsetting.toml").read_text()
    law = '{ law = "linear", initial = "700 MPa", hardening = "300 MPa" }'
    (tmp_path / "s.toml").write_text(text.replace(law, '{ law = "table", file = "data/flow.csv" }'))
    read = read_scene(tmp_path / "s.toml")
    assert read.materials["billet"].flow_stress(0.5, 1.0) == 150
    write_scene(read, tmp_path / "again.toml")
    assert '"data/flow.csv"' in (tmp_path / "again.toml").read_text()
    assert read_scene(tmp_path / "again.toml") == read


def test_scene_prints_as_a_tree_with_units():
    text = repr(billet())
    assert "│       └── mesh_size: 1 mm" in text
    assert "flow_stress: Linear(initial=700 MPa, hardening=300 MPa)" in text
    assert "SpeedDrive(velocity=(0, -1) mm/s)" in text


def test_scene_is_frozen():
    built = billet()
    with pytest.raises(ValueError, match="frozen"):
        built.title = "x"
    with pytest.raises(TypeError, match="frozen"):
        built.tools["lower"] = built.tools["upper"]
    assert built.replaced(title="x").title == "x"


def test_json_schema_lists_every_key():
    schema = json.loads(json.dumps(scene.Scene.json_schema()))
    assert set(schema["properties"]) == set(scene.Scene.key_names())
    assert schema["$defs"]["Rectangle"]["required"] == ["from", "to"]
    assert schema["additionalProperties"] is False
    remesh = schema["$defs"]["Workpiece"]["properties"]["remesh"]["anyOf"]
    assert {"type": "boolean"} in remesh
    assert {"$ref": "#/$defs/Remesh"} in remesh
    assert len(schema["$defs"]["Workpiece"]["properties"]["refine"]["items"]["oneOf"]) == 5
    assert {"$ref": "#/$defs/Shifting"} in schema["$defs"]["Process"]["properties"]["shifting"]["anyOf"]


def test_scheme_has_one_meaning():
    assert billet().scheme == "midpoint"
    assert billet(steps=scene.Steps(stroke=1), process=scene.Process(shifting="explicit")).scheme == "explicit"
    same = billet(steps=scene.Steps(stroke=1, scheme="implicit"), process=scene.Process(shifting="midpoint"))
    assert same.scheme == "midpoint"


def test_shifting_may_be_a_word_a_table_or_a_number_of_substeps():
    def shifting(**process):
        return billet(steps=scene.Steps(stroke=1), process=scene.Process(**process)).shifting

    assert billet().shifting == scene.Shifting(scheme="midpoint")
    assert shifting(shifting="etd2") == scene.Shifting(scheme="etd2")
    assert shifting(substeps=4) == scene.Shifting(scheme="substeps", substeps=4)
    assert shifting(shifting="substeps") == scene.Shifting(scheme="substeps", substeps=3, rule="plain")
    assert shifting(shifting="substeps", substeps=4) == shifting(substeps=4)
    finer = shifting(shifting={"scheme": "substeps", "rule": "midpoint", "rotation": True}, substeps=2)
    assert (finer.substeps, finer.rule, finer.turns_exactly) == (2, "midpoint", True)
    turned = shifting(shifting={"scheme": "implicit", "rotation": True})
    assert (turned.scheme, turned.turns_exactly) == ("midpoint", True)
    assert [shifting(shifting=word).turns_exactly for word in ("rotation", "explicit")] == [True, False]


def test_remesh_may_be_a_word_or_a_table():
    def remesh(value):
        return billet().workpiece.replaced(remesh=value).remesh

    assert remesh(True) == remesh({}) == scene.Remesh()
    assert remesh(False) is None is billet().workpiece.remesh
    assert remesh({"chord": "20 um"}).chord == 0.02
    assert [remesh(True).quality_limit(dimension) for dimension in (2, 3)] == [0.3, 0.2]
    assert remesh({"min_quality": 0.2}).quality_limit(3) == 0.2


EVERYTHING = '''
[process]
volume_constancy = "each_step"
shifting = { scheme = "substeps", substeps = 2, rule = "midpoint", rotation = true }
[materials.billet]
damage = { law = "cockcroft_latham", critical = 0.5 }
[workpieces.billet]
refine = [ { kind = "box", from = [0, 0], to = ["1 cm", 3], size = "0.3 mm" },
           { kind = "sphere", centre = [5, 5], radius = 2, size = 0.4 },
           { kind = "near_tool", tool = "upper", distance = "2 mm", size = 0.5 },
           { kind = "near_surface", distance = 1, size = 0.6 } ]
[workpieces.billet.remesh]
min_quality = 0.2
chord = "20 um"
max_size = 2
min_size = 0.1
growth = 0.3
every = 20
penetration = 0.2
neighbour_ratio = 5
least_steps = 2
engine = "gmsh"
strain_rate = 1
temperature = 2
[flow_lines.middle]
body = "billet"
from = [0, 1]
to = [10, 1]
points = 30
'''


def test_everything_about_meshes_survives_toml():
    changes = tomllib.loads(EVERYTHING)
    values = tomllib.loads((DEMOS / "billet_upsetting.toml").read_text())
    del values["steps"]["scheme"]
    for group in ("materials", "workpieces"):
        values[group]["billet"] |= changes[group]["billet"]
    built = scene.Scene.read(values | {key: changes[key] for key in ("process", "flow_lines")})
    text = built.to_toml()
    assert tomllib.loads(text)["workpieces"]["billet"]["refine"][0] == {
        "kind": "box", "from": [0, 0], "to": [10, 3], "size": 0.3,
    }
    assert scene.Scene.read(tomllib.loads(text)) == built == pickle.loads(pickle.dumps(built))
    keys = [warning.partition(":")[0] for warning in check(built)]
    assert keys == ["workpieces.billet.remesh.temperature"]
    assert "NearTool(size=0.5 mm, tool='upper', distance=2 mm)" in repr(built)


def test_domain_that_is_not_finer_is_pointed_out():
    coarse = scene.NearSurface(distance=1, size=1)
    warnings = check(billet(workpieces={"billet": billet().workpiece.replaced(refine=[coarse])}))
    assert warnings == ["workpieces.billet.refine.0.size: has no effect, it is not below mesh_size"]


def test_adaptive_may_be_a_word_or_a_table():
    assert scene.Steps(stroke=1, adaptive=True).adaptive == scene.Adaptive()
    assert scene.Steps(stroke=1, adaptive=False).adaptive is None
    assert scene.Steps(stroke=1, adaptive={"tolerance": 1e-2}).adaptive.tolerance == 1e-2


def test_the_first_travelling_tool_counts():
    roll = scene.Tool(
        shape=scene.CircleTool(centre=(0, 50), radius=10), drive=laws.RotationDrive(speed=1, centre=(0, 50))
    )
    ram = billet().tools["upper"]
    both = billet(tools={"roll": roll, "upper": ram})
    assert both.driven_tools == ["roll", "upper"]
    assert both.counting_tool == "upper"
    assert billet(tools={"roll": roll}).counting_tool == "roll"


def test_a_body_that_flies_needs_no_table_of_tools():
    """Free fall (REFERENCES.md 8.2) has none; a body without inertia and tools stays where it is, which is refused."""
    table = {"geometry": "plane_strain",
             "materials": {"steel": {"flow_stress": {"law": "constant", "value": 100}, "density": "7850 kg/m^3"}},
             "workpieces": {"block": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [2, 1]}, "material": "steel"}},
             "process": {"inertia": True, "weight": True}, "steps": {"time": 0.01}, "stop": {"time": 0.1}}
    falling = scene.Scene.read(table)
    check(falling)
    assert falling == scene.Scene.read(table | {"tools": {}}) == scene.Scene.read(tomllib.loads(falling.to_toml()))
    for process in ({"inertia": False}, {}):
        with pytest.raises(SceneError, match="tools"):
            scene.Scene.read(table | {"process": process})


def test_a_law_of_ones_own_goes_into_a_scene():
    class Mine(laws.FlowStress):
        law: str = "mine"

        def __call__(self, strain, rate, temperature=None):
            return 42.0

    built = billet(materials={"billet": scene.Material(flow_stress=Mine())})
    assert built.materials["billet"].flow_stress(0, 1) == 42
    assert check(built) == []


SQUARE = [(0, 0), (10, 0), (10, 10), (0, 10)]


@pytest.mark.parametrize(
    ("shape", "measure", "low", "high"),
    [
        (scene.Rectangle(from_=(1, 2), to=(4, 7)), 15, (1, 2), (4, 7)),
        (scene.Rectangle(from_=(0, 0), to=(4, 4), fillet=1), 16 - (4 - math.pi), (0, 0), (4, 4)),
        (scene.Polygon(points=SQUARE), 100, (0, 0), (10, 10)),
        (scene.Polygon(points=SQUARE[::-1], fillet=[1, 0, 0, 0]), 100 - (1 - math.pi / 4), (0, 0), (10, 10)),
        (
            scene.Polygon(points=[(0, 0), (10, 0), (10, 5), (5, 5), (5, 10), (0, 10)], fillet=1),
            75 - 4 * (1 - math.pi / 4),
            (0, 0),
            (10, 10),
        ),
        (scene.Circle(centre=(3, 0), radius=2), 4 * math.pi, (1, -2), (5, 2)),
        (scene.Box(from_=(0, 0, 0), to=(1, 2, 3)), 6, (0, 0, 0), (1, 2, 3)),
        (scene.Cylinder(base=(0, 0, 1), radius=2, height=3), 12 * math.pi, (-2, -2, 1), (2, 2, 4)),
    ],
    ids=lambda value: value.kind if isinstance(value, scene.Shape) else "",
)
def test_body_shape_knows_its_size_boundary_and_inside(shape, measure, low, high):
    assert shape.volume_or_area() == pytest.approx(measure, rel=1e-12)
    np.testing.assert_allclose(shape.bounds(), [low, high], atol=1e-12)
    samples = shape.boundary_points(0.1)
    # 72 sides a turn leave arcs by less than 1e-3 of the radius
    np.testing.assert_allclose([samples.min(axis=0), samples.max(axis=0)], [low, high], atol=1e-2)
    centre = samples.mean(axis=0)
    assert shape.contains(centre + 0.98 * (samples - centre)).mean() > 0.97
    assert not shape.contains([np.add(high, 1)])[0]


def test_outline_polygon_has_the_area_of_the_rounded_shape():
    shape = scene.Polygon(points=[(0, 0), (10, 0), (10, 5), (5, 5), (5, 10), (0, 10)], fillet=1)
    x, y = shape.outline.T
    area = np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2
    assert area == pytest.approx(shape.volume_or_area(), rel=1e-3)


def test_polygon_is_kept_counter_clockwise_with_its_radii():
    given_clockwise = scene.Polygon(points=SQUARE[::-1], fillet=[4, 3, 2, 1])
    assert given_clockwise == scene.Polygon(points=SQUARE, fillet=[1, 2, 3, 4])


@pytest.mark.parametrize(
    ("tool", "inside", "outside"),
    [
        (scene.Plane(point=(0, 15), normal=(0, -3)), (2, 16), (2, 13)),
        (scene.Plane(point=(0, 0, 1), normal=(0, 0, -1)), (5, 5, 3), (5, 5, -1)),
        (scene.CircleTool(centre=(0, 0), radius=5), (0, 4), (0, 7)),
        (scene.CircleTool(centre=(0, 0), radius=5, hollow=True), (0, 7), (0, 4)),
        (scene.SphereTool(centre=(0, 0, 0), radius=5), (0, 0, 4), (0, 0, 7)),
        (scene.CylinderTool(centre=(0, 0, 9), axis=(0, 0, 1), radius=5), (4, 0, 0), (7, 0, 0)),
        (scene.Rectangle(from_=(0, 0), to=(2, 2)), (1, 1), (3, 1)),
        (scene.Polyline(points=[(5, 40), (5, 15), (0, 15)]), (2, 16), (2, 13)),
        (scene.Polyline(points=[(0, 15), (5, 15), (5, 40)], side="right"), (2, 16), (2, 13)),
        (scene.Polyline(points=[(5, 40), (5, 15), (0, 15)], fillet=2), (2, 16), (4.9, 15.1)),
    ],
    ids=lambda value: value.kind if isinstance(value, scene.Shape) else "",
)
def test_tool_shape_knows_its_sides(tool, inside, outside):
    assert tool.depth([inside])[0] > 0
    assert tool.depth([outside])[0] < 0


def test_polyline_does_not_reach_beyond_its_ends():
    ledge = scene.Polyline(points=[(10, 0), (0, 0)], side="left")
    depth = ledge.depth([(5, 1), (5, -1), (12, 1), (-2, 1)])
    assert (depth > 0).tolist() == [True, False, False, False]


def test_warnings_name_what_has_no_effect():
    material = scene.Material(flow_stress=laws.Constant(value=100), conductivity=28, young="210 GPa")
    warnings = check(
        billet(
            materials={"billet": material, "spare": scene.Material()},
            workpieces={"billet": billet().workpiece.replaced(temperature=20, symmetry=[])},
        )
    )
    keys = [warning.partition(":")[0] for warning in warnings]
    assert keys == [
        "materials.billet.conductivity",
        "materials.billet.young",
        "materials.spare",
        "workpieces.billet.temperature",
        "workpieces.billet",
    ]


def test_several_problems_come_together_one_a_line():
    with pytest.raises(SceneError) as error:
        read_scene(DEMOS / "billet_upsetting.toml", set=["steps.stroke=-1", "stop.stroke=2 kN", "output.field_every=2"])
    assert [problem.key for problem in error.value.problems] == ["steps.stroke", "stop.stroke", "output.field_every"]
    assert str(error.value).count("\n") == 2


SPACE = """
geometry = "3d"
[materials.lead]
flow_stress = { law = "constant", value = 20 }
[workpieces.block]
shape = { kind = "cylinder", base = [0, 0, 0], axis = [0, 0, 1], radius = 10, height = 20 }
material = "lead"
symmetry = ["z"]
[tools.ball]
shape = { kind = "sphere", centre = [0, 0, 35], radius = 15 }
drive = { kind = "speed", velocity = [0, 0, "-1 mm/s"] }
[tools.container]
shape = { kind = "cylinder", centre = [0, 0, 0], axis = [0, 0, 1], radius = 10.001, hollow = true }
[steps]
stroke = 0.5
[stop]
stroke = 5
height = 15
"""


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("", "", None),
        ("[0, 0, 35]", "[0, 0, 34]", "tools.ball.shape"),
        ("10.001", "9.9", "tools.container.shape"),
        ("axis = [0, 0, 1], radius = 10, height", "axis = [0, 1, 1], radius = 10, height", "workpieces.block.symmetry"),
        ('kind = "sphere"', 'kind = "stl", path = "ball.stl"', "tools.ball.shape.centre"),
        ("axis = [0, 0, 1], radius = 10,", "axis = [0, 0, 0], radius = 10,", "workpieces.block.shape.axis"),
        ('material = "lead"', 'material = "lead"\nmesh_size = 0.05', "workpieces.block.mesh_size"),
    ],
)
def test_scene_in_space_is_checked_too(old, new, key):
    values = tomllib.loads(SPACE.replace(old, new, 1) if old else SPACE)
    if key is None:
        assert check(scene.Scene.read(values)) == []
        return
    with pytest.raises(SceneError) as error:
        check(scene.Scene.read(values))
    assert error.value.key == key


def test_a_tree_is_broken_below_the_names_of_its_branches():
    text = "├── tools\n│   ├── ram\n│   │   ├── drive: HammerDrive(direction=(0, -1), mass=1 t, energy=(2e7) mJ)\n└── stop"
    lines = broken(text, 40).splitlines()
    assert max(map(len, lines)) <= 40 and lines[0] == "├── tools" and lines[-1] == "└── stop"
    assert all(line.startswith("│   │   │     ") for line in lines[3:-1])
    assert "".join(text.split()).replace("│", "") == "".join("".join(lines).split()).replace("│", "")
