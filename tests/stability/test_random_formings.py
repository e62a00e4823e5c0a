"""Random forming operations: punches, grooves, closed dies, nozzles, tilted plates, rolls and balls.

As in `test_random_scenes`: a run ends in words or at its goal, and what it wrote breaks no law.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fenics_forming import simulate
from fenics_forming.errors import ConvergenceError
from fenics_forming.scene import Scene
from tests.stability import bounds
from tests.stability.scenes import balanced

pytestmark = pytest.mark.long

LAWS = st.sampled_from([
    {"law": "constant", "value": 120}, {"law": "linear", "initial": 250, "hardening": 200},
    {"law": "ludwik", "initial": 180, "K": 250, "n": 0.4}, {"law": "hollomon", "K": 530, "n": 0.25},
    {"law": "voce", "initial": 90, "saturation": 210, "rate": 8}, {"law": "norton_hoff", "K": 60, "m": 0.2},
    {"law": "power", "K": 140, "n": 0.1, "m": 0.12},
    {"law": "table", "strain": [0, 0.1, 0.5, 2], "stress": [200, 260, 330, 400]}])
FRICTION = st.one_of(
    st.just({"law": "none"}), st.just({"law": "sticking"}),
    st.fixed_dictionaries({"law": st.just("siebel"), "factor": st.floats(0.02, 1)}),
    st.fixed_dictionaries({"law": st.just("coulomb"), "coefficient": st.floats(0.02, 0.4)}),
    st.fixed_dictionaries({"law": st.just("levanov"), "factor": st.floats(0.05, 1)}))
LUBRICATED = st.one_of(
    st.just({"law": "none"}), st.fixed_dictionaries({"law": st.just("siebel"), "factor": st.floats(0.02, 0.4)}),
    st.fixed_dictionaries({"law": st.just("coulomb"), "coefficient": st.floats(0.02, 0.12)}))
PLANAR = st.sampled_from(["plane_strain", "axisymmetric"])
REMESH = st.sampled_from([True, True, {"every": 4}, {"min_quality": 0.4}])


def plate(point, normal, **keys):
    return {"shape": {"kind": "plane", "point": point, "normal": normal}, **keys}


def down(speed, dim=2):
    return {"kind": "speed", "velocity": [0.0] * (dim - 1) + [-speed]}


def block(draw, kind, width, height, **keys):
    """Right half of a body that stands on y = 0 (z = 0)."""
    return {"shape": {"kind": "rectangle", "from": [0, 0], "to": [width, height]}, "material": "m",
            "symmetry": ["x"] * (kind == "plane_strain"), "mesh_size": min(width, height) / draw(st.floats(4, 7)), **keys}


def punching(draw):
    """A round or square punch narrower than the block sinks in by up to a third."""
    kind, width, height = draw(PLANAR), draw(st.floats(8, 30)), draw(st.floats(6, 20))
    punch = width * draw(st.floats(0.25, 0.8))
    ball = {"kind": "circle", "centre": [0, height + punch], "radius": punch}
    stamp = {"kind": "rectangle", "from": [0, height], "to": [punch, 3 * height],
             "fillet": punch * draw(st.floats(0.08, 0.5))}
    shape, keys = draw(st.sampled_from([(ball, {}), (stamp, {"symmetry": ["x"] * (kind == "plane_strain")})]))
    tools = {"upper": {"shape": shape, "drive": down(10), "friction": draw(FRICTION), **keys},
             "lower": plate([0, 0], [0, 1], friction=draw(FRICTION))}
    return kind, block(draw, kind, width, height, remesh=draw(REMESH)), tools, height * draw(st.floats(0.05, 0.33))


def grooving(draw):
    """A plate presses a block into a groove, which opens by 60 to 150 degrees."""
    kind, width, height = draw(PLANAR), draw(st.floats(6, 15)), draw(st.floats(8, 20))
    mouth, slope = width * draw(st.floats(0.3, 0.8)), np.deg2rad(draw(st.floats(15, 60)))
    depth = mouth * np.tan(slope)
    die = {"kind": "polyline", "points": [[-1e-3 * mouth, -depth], [0, -depth], [mouth, 0], [5 * width, 0]],
           "fillet": [0, 0, 0.2 * mouth, 0]} if kind == "axisymmetric" else {
           "kind": "polyline", "points": [[-mouth, 0], [0, -depth], [mouth, 0], [5 * width, 0]],
           "fillet": [0, 0, 0.2 * mouth, 0]}
    tools = {"upper": plate([0, height], [0, -1], drive=down(5), friction=draw(FRICTION)),
             "die": {"shape": die, "friction": draw(FRICTION)}}
    return kind, block(draw, kind, width, height, remesh=draw(REMESH)), tools, height * draw(st.floats(0.05, 0.4))


def filling(draw):
    """A block is upset in a closed container until nine tenths of it are full."""
    kind, width, height = draw(PLANAR), draw(st.floats(5, 15)), draw(st.floats(6, 25))
    room = width * draw(st.floats(1.05, 1.5))
    full = height * (1 - (width / room) ** (2 if kind == "axisymmetric" else 1))
    tools = {"upper": plate([0, height], [0, -1], drive=down(20), friction=draw(FRICTION)),
             "lower": plate([0, 0], [0, 1], friction=draw(FRICTION)),
             "wall": plate([room, 0], [-1, 0], friction=draw(LUBRICATED))}
    return kind, block(draw, kind, width, height, remesh=draw(REMESH)), tools, full * draw(st.floats(0.3, 0.9))


def pressing_through(draw):
    """A bar is pressed through a conical (wedge-shaped) die."""
    kind, width = draw(PLANAR), draw(st.floats(5, 15))
    narrow = width * (1 - draw(st.floats(0.05, 0.4)))
    angle = np.deg2rad(draw(st.floats(10, 60)))
    cone = (width - narrow) / np.tan(angle)
    land = [narrow, -cone - 0.2 * width]
    points = [[2 * width, width / np.tan(angle)], [width, 0], [narrow, -cone], land, [2 * width, land[1] - 2 * width]]
    die = {"kind": "polyline", "side": "right", "points": points, "fillet": [0, 0.2 * width, 0.1 * width, 0, 0]}
    tools = {"ram": plate([0, 2 * width], [0, -1], drive=down(1)),
             "container": plate([width, 0], [-1, 0], friction=draw(LUBRICATED)),
             "die": {"shape": die, "friction": draw(LUBRICATED)}}
    bar = block(draw, kind, width, 2 * width, remesh={"every": 2})
    bar["shape"] = {"kind": "rectangle", "from": [0, 0], "to": [width, 2 * width]}
    return kind, bar, tools, width * draw(st.floats(0.1, 0.5))


def tilting(draw):
    """A plate that is not level, and does not come straight down, on a whole block."""
    width, height, tilt = draw(st.floats(6, 20)), draw(st.floats(6, 15)), np.deg2rad(draw(st.floats(-8, 8)))
    aslant = draw(st.floats(-0.3, 0.3))
    normal = [float(np.sin(tilt)), float(-np.cos(tilt))]
    corner = [0.0 if tilt > 0 else width, height]       # where it touches first
    body = {"shape": {"kind": "rectangle", "from": [0, 0], "to": [width, height]}, "material": "m",
            "mesh_size": min(width, height) / draw(st.floats(4, 6)), "remesh": draw(REMESH)}
    tools = {"upper": plate(corner, normal, drive={"kind": "speed", "velocity": [aslant * 5, -5]}, friction=draw(FRICTION)),
             "lower": plate([0, 0], [0, 1], friction=draw(st.sampled_from([
                 {"law": "sticking"}, {"law": "siebel", "factor": 0.6}, {"law": "coulomb", "coefficient": 0.3}])))}
    return "plane_strain", body, tools, width * abs(np.sin(tilt)) + height * draw(st.floats(0.03, 0.2))


def rolling(draw):
    """The front of a strip is drawn in by a roll, or pushed through below it."""
    radius, entry = draw(st.floats(20, 200)), draw(st.floats(2, 12))
    friction = draw(st.floats(0.1, 0.35))
    draft = min(0.5 * friction**2 * radius, 0.3 * entry)        # half of what the friction can bite
    leave = entry - draft
    arc = float(np.arccos(1 - draft / (2 * radius)))
    angle = np.linspace(arc, 0, 17)
    under = np.column_stack([-radius * np.sin(angle), leave / 2 + radius * (1 - np.cos(angle))])
    under[:, 1] -= 1.01 * radius * (arc / 16) ** 2 / 8          # between its points the strip is straight
    back, front = float(under[0, 0]) - 2 * entry, entry
    points = [[back, 0.0], [front, 0.0], [front, float(under[-1, 1])], *under[::-1].tolist(), [back, float(under[0, 1])]]
    centre = [0.0, radius + leave / 2]
    strip = {"shape": {"kind": "polygon", "points": points}, "material": "m", "symmetry": ["y"],
             "mesh_size": min(entry / draw(st.floats(3, 5)), radius * arc / 5)}
    drive = draw(st.sampled_from([{"speed": 1.0}, {}, {"speed": "20 rpm"}]))
    speed = {1.0: 1.0, "20 rpm": 2 * np.pi / 3}.get(drive.get("speed"), 1.0) * radius * 0.6
    tools = {"starter": plate([back, 0], [1, 0], drive={"kind": "speed", "velocity": [float(speed), 0]}),
             "roll": {"shape": {"kind": "circle", "centre": centre, "radius": radius}, "friction":
                      {"law": "coulomb", "coefficient": friction}, "drive": {"kind": "roll", "centre": centre, **drive}}}
    return "plane_strain", strip, tools, entry * draw(st.floats(0.2, 1.0))


def in_space(draw):
    """A quarter of a box, or an upright cylinder, under a plate, a ball or a roll that lies across it."""
    width, height = draw(st.floats(8, 20)), draw(st.floats(6, 16))
    radius = width * draw(st.floats(0.8, 3))
    box = {"kind": "box", "from": [0, 0, 0], "to": [width, draw(st.floats(0.6, 1.4)) * width, height]}
    round_ = {"kind": "cylinder", "base": [0, 0, 0], "axis": [0, 0, 1], "height": height, "radius": width}
    tool = draw(st.sampled_from([
        {"kind": "plane", "point": [0, 0, height], "normal": [0, 0, -1]},
        {"kind": "sphere", "centre": [0, 0, height + radius], "radius": radius},
        {"kind": "cylinder", "centre": [0, 0, height + radius], "axis": [0, 1, 0], "radius": radius}]))
    body = {"shape": draw(st.sampled_from([box, round_])), "material": "m", "symmetry": ["x", "y"],
            "mesh_size": min(width, height) / draw(st.floats(1.8, 2.6)), "remesh": draw(st.sampled_from([False, True]))}
    tools = {"upper": {"shape": tool, "drive": down(10, 3), "friction": draw(FRICTION)},
             "lower": plate([0, 0, 0], [0, 0, 1], friction=draw(FRICTION))}
    return "3d", body, tools, height * draw(st.floats(0.05, 0.3))


def twisting(draw):
    """A whole upright cylinder or bar between a plate that comes down turning, and one that holds."""
    width, height = draw(st.floats(5, 12)), draw(st.floats(5, 12))
    axis = {"speed": draw(st.floats(-2, 2)), "centre": [0, 0, 0], "axis": [0, 0, 1]}
    shape = draw(st.sampled_from([
        {"kind": "cylinder", "base": [0, 0, 0], "axis": [0, 0, 1], "height": height, "radius": width},
        {"kind": "box", "from": [-width, -0.7 * width, 0], "to": [width, 0.7 * width, height]}]))
    body = {"shape": shape, "material": "m", "mesh_size": min(width, height) / 1.5}
    tools = {"upper": plate([0, 0, height], [0, 0, -1], friction=draw(FRICTION),
                            drive={"kind": "speed", "velocity": [0, 0, -10], "rotation": axis}),
             "lower": plate([0, 0, 0], [0, 0, 1], friction={"law": "sticking"})}
    return "3d", body, tools, height * draw(st.floats(0.05, 0.2))


def from_both_sides(draw):
    """Two plates close on a block: in a fixed ratio of speeds, or one of them on a spring."""
    kind, width, height = draw(PLANAR), draw(st.floats(6, 20)), draw(st.floats(6, 20))
    area = 2 * width if kind == "plane_strain" else np.pi * width**2
    other = draw(st.sampled_from([{"kind": "ratio", "of": "upper", "ratio": draw(st.floats(0.2, 2)), "direction": [0, 1]},
                                  {"kind": "spring", "stiffness": 20 * 200 * area / height, "direction": [0, 1]},
                                  {"kind": "speed", "velocity": [0, draw(st.floats(-4, 8))]}]))
    tools = {"upper": plate([0, height], [0, -1], drive={"kind": "speed", "velocity": [0, -5]}, friction=draw(FRICTION)),
             "lower": plate([0, 0], [0, 1], drive=other, friction=draw(FRICTION))}
    return kind, block(draw, kind, width, height), tools, height * draw(st.floats(0.05, 0.15))


OPERATIONS = (from_both_sides, filling, punching, grooving, pressing_through, tilting, rolling, in_space, twisting)


@st.composite
def formings(draw, operations=OPERATIONS):
    operation = draw(st.sampled_from(operations))
    kind, body, tools, way = operation(draw)
    counts = draw(st.sampled_from([6, 10, 16]))
    first = next(iter(tools))
    steps = {"stroke": way / counts, "tool": first}
    law = draw(LAWS)
    if kind != "3d" and law["law"] != "constant" and draw(st.integers(0, 3)) == 0:     # else they follow each slip line
        steps["adaptive"] = True
    return {"title": operation.__name__, "geometry": kind, "materials": {"m": {"flow_stress": law}},
            "workpieces": {"b": body}, "tools": tools, "steps": steps, "stop": {"stroke": way},
            "process": {"shifting": draw(st.sampled_from(["midpoint", "midpoint", "etd2", "explicit", "trapezoid"]))}}


LOSSY = {"explicit": 0.1, "etd2": 0.03}      # of the volume, in six steps to a third of the height


def check_laws(scene: Scene, results) -> None:
    """Finite numbers; volume, power; strains that grow; tools that push, metal and friction that take power; forces between
    their bounds where those are known."""
    history = results.history
    forces = np.array([history.column(name) for name in history.columns if name.startswith("force_")])
    # of a tool that does not press there is no power to balance: a bar that is only on its way
    balanced(results, LOSSY.get(scene.scheme, 0.01), pushed=forces[0] > 1e-3 * forces.max())
    assert forces.min() > -1e-6 * forces.max(), "tools push"
    strain = history.column("max_effective_strain")
    assert (np.diff(strain) > -0.2 - 0.3 * strain[:-1]).all(), "strain gathers; new meshes blunt its peak"
    for name, power in results.summary["ledger"]["power"]["last_mW"].items():
        if name in ("plastic", "friction"):
            assert power >= -1e-9 * abs(results.summary["ledger"]["power"]["last_mW"]["tools"]), f"{name} takes power"
    if (known := force_bounds(scene)) is not None:
        tool, least, most = known
        force = next(history.column(name) for name in history.columns if name.startswith(f"force_{tool}_"))[0]
        assert least < force < most, "of the first flow: between the bounds"


def force_bounds(scene: Scene) -> tuple[str, float, float] | None:
    """A tool and the bounds of its force in the first flow; None where none are known.

    Points that land in the first step, on the fillet of a stamp or at the ends of an arc, add to the force: of a stamp only
    the bound from below is told. A roll presses on an arc that its strip follows in chords.
    """
    body, tools = scene.workpieces["b"], scene.tools
    if bounds.yield_stress(scene) is None:
        return None
    if scene.title == "rolling":
        (_, entry), radius = np.max(body.shape.points, axis=0), tools["roll"].shape.radius
        draft = 2 * entry - 2 * body.shape.points[2][1]
        least, most = bounds.of_rolling(scene, np.sqrt(radius * draft), 2 * entry - draft / 2)
        return "roll", 0.95 * least, most
    if body.shape.kind not in ("rectangle", "box") or \
            scene.title not in ("from_both_sides", "filling", "punching", "in_space"):
        return None
    upper, lower = tools["upper"], tools["lower"]
    if scene.title == "punching":
        flat = upper.shape.to[0] - upper.shape.fillet if upper.shape.kind == "rectangle" else 0.0
        return "upper", 0.995 * bounds.of_stamping(scene, flat), np.inf
    square = len({*body.shape.to[:-1]}) == 1
    if upper.shape.kind != "plane" or not square or lower.drive is not None and lower.drive.kind == "spring":
        return None
    width, height = body.shape.to[0], body.shape.to[-1]
    least, most = bounds.of_upsetting(scene, width, height, bounds.factor(upper) + bounds.factor(lower))
    return "upper", 0.995 * least, 1.005 * most


@settings(max_examples=16, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(formings())
def test_random_forming_keeps_its_laws_or_says_why_it_cannot_go_on(values):
    scene = Scene.read(values)
    try:
        results = simulate(scene)
    except ConvergenceError as failure:
        assert failure.sentence and failure.advice
        return
    check_laws(scene, results)
