"""Deformable tools in scenes: what is written, what is refused, and how they are meshed, held and loaded."""

import numpy as np
import pytest

from fenics_forming import scene
from fenics_forming.errors import SceneError
from fenics_forming.physics.contact.blocks import box_surface, cylinder_surface
from fenics_forming.physics.surface import facet_sides
from fenics_forming.process.tools.bodies import tool_body
from fenics_forming.scene import check

STEEL = {"young": "210 GPa", "poisson": 0.3}
RING = {"kind": "rectangle", "from": [20, 0], "to": [40, 10]}
OUTER = {"kind": "rectangle", "from": [40, 0], "to": [80, 10]}


def tools_alone(geometry="axisymmetric", contacts=(), points=None, **tools):
    return {"geometry": geometry, "materials": {"steel": STEEL}, "tools": tools, "contacts": list(contacts),
            "points": points or {}}


def ring(**more):
    return tools_alone(ring={"shape": RING, "material": "steel", "held": {"z_low": "z"}, **more})


def two_rings(**more):
    parts = {"insert": {"shape": RING, "material": "steel", "mesh_size": 4},
             "ring": {"shape": OUTER, "material": "steel", "mesh_size": 5}}
    return tools_alone(die={"parts": parts, "held": {"z_low": "z"}, **more},
                       contacts=[{"between": ["insert", "ring"], "interference": 0.04}])


def test_interference_that_is_not_the_drawn_overlap_is_said_to_take_its_place():
    for drawn, said in ((0.0, 0), (0.04, 0), (0.1, 1), (0.01, 1)):
        values = two_rings()
        values["tools"]["die"]["parts"]["insert"]["shape"] = RING | {"to": [RING["to"][0] + drawn, RING["to"][1]]}
        found = check(scene.Scene.read(values))
        assert len(found) == said, found
        assert all(s.startswith(f"contacts.0.interference: 0.04 mm takes the place of the overlap of {drawn} mm") for s
                   in found)
    del values["contacts"][0]["interference"]
    assert check(scene.Scene.read(values)) == []


def meshed(values, name):
    described = scene.Scene.read(values)
    check(described)
    return tool_body(described, name)


def test_scene_of_tools_alone_needs_no_steps_no_stop_and_no_workpieces():
    described = scene.Scene.read(ring())
    assert check(described) == [] and described.is_tools_alone
    assert scene.Scene.read(described.as_table()) == described


def test_held_faces_and_mesh_sizes_have_a_short_form():
    short = scene.Scene.read(ring(mesh_size=2)).tools["ring"]
    long = scene.Scene.read(ring(mesh_size={"contact": 2, "far": 2}, held={"z_low": {"z": 0.0}})).tools["ring"]
    assert short == long


REFUSED = [
    (ring(held={"z_lo": "z"}), "tools.ring.held.z_lo", "did you mean 'z_low'"),
    (ring(held={"z_low": "x"}), "tools.ring.held.z_low", "not an axis of 'axisymmetric'"),
    (ring(held={"z_low": []}), "tools.ring.held.z_low", "names no axis"),
    (ring(mesh_size={"contact": 3, "far": 2}), "tools.ring.mesh_size.contact", "larger than far"),
    (ring(loads={"r_low": {}}), "tools.ring.loads.r_low", "is empty"),
    (ring(loads={"r_low": {"traction": [1, 2, 3]}}), "tools.ring.loads.r_low.traction", "has 3 components"),
    (ring(stress_state="plane_stress"), "tools.ring.stress_state", "belongs to tools in the plane"),
    (ring(drive={"kind": "speed", "velocity": [0, 1]}), "tools.ring.drive", "nothing is formed"),
    (ring(material="stel"), "tools.ring.material", "did you mean 'steel'"),
    (ring(shape={"kind": "circle", "centre": [30, 5], "radius": 3, "hollow": True}), "tools.ring.shape", "is to deform"),
    (tools_alone(plate={"shape": RING}), "workpieces", "is missing"),
    (two_rings() | {"contacts": [{"between": ["insert", "rink"]}]}, "contacts.0.between", "did you mean 'ring'"),
    (two_rings() | {"contacts": [{"between": ["insert", "ring"], "conductance": 5}]}, "contacts.0.conductance",
     "between parts of a tool none is computed"),
    (two_rings(material="steel"), "tools.die.material", "belongs to the parts"),
    (ring() | {"points": {"p": {"body": "ring", "at": [50, 5]}}}, "points.p.at", "outside 'ring'"),
    (ring() | {"stop": {"stroke": 1}}, "stop", "something is formed"),
    (ring() | {"steps": {"stroke": 1}}, "steps.stroke", "the steps of tools alone are 'loads'"),
    (ring() | {"steps": {"loads": 4, "adaptive": True}}, "steps.adaptive", "something is formed"),
    (ring() | {"steps": {"loads": []}}, "steps.loads", "is no number of steps"),
    (ring() | {"steps": {"loads": 2, "time": 1}}, "steps.loads", "given together with 'time'"),
    (ring() | {"process": {"weight": True}}, "process.weight", "something is formed"),
    (ring() | {"output": {"strokes": [1]}}, "output.strokes", "a tool that moves"),
    (ring(heat_exchange={"kind": "constant", "temperature": 20, "coefficient": 1}), "tools.ring.heat_exchange", "none"),
]


@pytest.mark.parametrize(("values", "key", "words"), REFUSED, ids=[key for _, key, _ in REFUSED])
def test_bad_tool_is_refused_where_it_is_wrong(values, key, words):
    with pytest.raises(SceneError) as error:
        check(scene.Scene.read(values))
    found = {problem.key: str(problem) for problem in error.value.problems or [error.value]}
    assert key in found and words in found[key]


def test_load_steps_belong_to_tools_alone():
    values = {"geometry": "plane_strain", "materials": {"lead": {"flow_stress": {"law": "constant", "value": 10}}},
              "workpieces": {"b": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [1, 1]}, "material": "lead"}},
              "tools": {"t": {"shape": {"kind": "plane", "point": [0, 1], "normal": [0, -1]},
                              "drive": {"kind": "speed", "velocity": [0, -1]}}},
              "steps": {"loads": 3}, "stop": {"stroke": 0.1}}
    with pytest.raises(SceneError, match="tools alone"):
        check(scene.Scene.read(values))


def test_tool_is_fine_where_it_is_loaded_and_coarse_elsewhere():
    tool = meshed(ring(mesh_size={"contact": 0.5, "far": 4}, loads={"r_low": {"pressure": 100}}), "ring")
    x = tool.body.nodes.x[facet_sides(tool.body.nodes, tool.surface)]
    length = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    bore, outside = np.isclose(x[..., 0], 20).all(axis=1), np.isclose(x[..., 0], 40).all(axis=1)
    assert length[bore].max() < 0.7 and length[outside].min() > 1.5
    assert len(tool.loads) == 1


def test_tool_of_a_forming_scene_is_fine_where_it_faces_the_workpiece():
    """A punch of 100 mm above a strip of 10 mm: the facets that it may reach lie within half its width of it."""
    values = {"geometry": "plane_strain", "materials": {"steel": STEEL, "lead": {"flow_stress": {"law": "constant",
                                                                                                 "value": 10}}},
              "workpieces": {"strip": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 2]}, "material": "lead",
                                       "symmetry": ["x", "y"]}},
              "tools": {"punch": {"shape": {"kind": "rectangle", "from": [0, 2], "to": [100, 102]}, "material": "steel",
                                  "symmetry": ["x"], "mesh_size": {"contact": 1, "far": 30}, "held": {"y_high": ["x", "y"]},
                                  "drive": {"kind": "speed", "velocity": [0, -1]}}},
              "steps": {"stroke": 0.1}, "stop": {"stroke": 1}}
    tool = meshed(values, "punch")
    x = tool.body.nodes.x[facet_sides(tool.body.nodes, tool.facing)]
    assert np.allclose(x[..., 1], 2) and 14 < x[..., 0].max() < 17
    assert np.linalg.norm(x[:, 1] - x[:, 0], axis=1).max() < 1.2
    assert tool.mirrors == {0: 0.0} and tool.body.is_held[np.isclose(tool.body.nodes.x[:, 0], 0), 0].all()


def test_parts_touch_by_their_facing_surfaces_the_finer_one_holds_the_points():
    tool = meshed(two_rings(), "die")
    (contact,), nodes = tool.contacts, tool.body.nodes
    assert tool.contact_names == ("insert-ring",) and contact.interference == 0.04
    assert np.allclose(nodes.x[facet_sides(nodes, contact.slave)][..., 0], 40)
    assert tool.parts.names == ("insert", "ring") and len(contact.slave) == 3


def test_sides_of_polygons_are_counted_from_their_points():
    """The slope of a conical bore, from point 4 back to point 1."""
    bore = {"kind": "polygon", "points": [[20, 0], [60, 0], [60, 30], [26, 30]]}
    tool = meshed(ring(shape=bore, loads={"side_4": {"pressure": 50}}, mesh_size=5), "ring")
    x = tool.body.nodes.x[facet_sides(tool.body.nodes, tool.loads[0].facets)]
    assert np.allclose(x[..., 0], 20 + x[..., 1] / 5)


def test_boxes_and_cylinders_are_surfaces_of_known_gap():
    box = box_surface((0, 0, 0), (2, 4, 6))
    gap, normal = box.closest(np.array([[1.0, 2, 7], [1, 2, 5.5], [3, 2, 3]]))
    assert gap == pytest.approx([1, -0.5, 1]) and normal[0] == pytest.approx([0, 0, 1])
    punch = cylinder_surface((0, 0, 5), (0, 0, 1), 3.0, 10.0)
    gap, normal = punch.closest(np.array([[1.0, 1, 4], [4, 0, 8], [0, 0, 16]]))
    assert gap == pytest.approx([1, 1, 1], abs=1e-3) and normal[0] == pytest.approx([0, 0, -1])
