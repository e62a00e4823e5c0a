"""Random valid scenes: whatever the body, law, friction, drive and scheme, a run ends in words and breaks no law.

Hypothesis draws the scenes, the same ones each time. A run may end in a `ConvergenceError`, where a coarse mesh meets a
sharp punch and is never renewed; it may not end in another error, hang, or go on silently with wrong balances.
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

STRENGTH = st.floats(20, 800)
EXPONENT = st.floats(0.02, 0.4)


def law_of(name, **parameters):
    return st.fixed_dictionaries({"law": st.just(name), **parameters})


LAWS = st.one_of(
    law_of("constant", value=STRENGTH), law_of("linear", initial=STRENGTH, hardening=st.floats(0, 500)),
    law_of("hollomon", K=STRENGTH, n=EXPONENT), law_of("swift", K=STRENGTH, prestrain=st.floats(1e-3, 0.1), n=EXPONENT),
    law_of("norton_hoff", K=STRENGTH, m=EXPONENT), law_of("power", K=STRENGTH, n=EXPONENT, m=EXPONENT))
FRICTION = st.one_of(
    law_of("none"), law_of("sticking"), law_of("siebel", factor=st.floats(0.01, 1)),
    law_of("coulomb", coefficient=st.floats(0.01, 0.4)), law_of("levanov", factor=st.floats(0.01, 1)))
LOSSY = {"explicit": 0.08, "substeps": 0.08}       # of the volume, in eight steps to 40 %; the others are of second order


@st.composite
def upsettings(draw):
    """A block, cylinder or ring between plates, or under a punch narrower or wider than itself."""
    kind = draw(st.sampled_from(["plane_strain", "axisymmetric", "3d"]))
    width, height = draw(st.floats(3, 30)), draw(st.floats(3, 30))
    bore = draw(st.sampled_from([0.0, 0.6])) * width if kind == "axisymmetric" else 0.0
    up = [0.0] * (2 if kind == "3d" else 1) + [1.0]
    down = [-c for c in up]
    half = draw(st.booleans())
    if kind == "3d":
        width = min(max(width, 0.5 * height), 2 * height)
        shape = {"kind": "box", "from": [0, 0, 0], "to": [width, width, height]}
    else:
        shape = {"kind": "rectangle", "from": [bore, 0], "to": [bore + width, height]}
    symmetry = {"plane_strain": ["x"], "axisymmetric": [], "3d": ["x", "y"]}[kind] + \
        [{"plane_strain": "y"}.get(kind, "z")] * half
    speed = 10 ** draw(st.floats(-2, 3))
    drive = draw(st.sampled_from([
        {"kind": "speed", "velocity": [speed * c for c in down]}, {"kind": "hydraulic", "speed": speed, "direction": down},
        {"kind": "crank_press", "radius": 100, "rod": 600, "speed": 5, "direction": down, "dead_centre": 0.5 * height}]))
    top = {"kind": "plane", "point": [height * c for c in up], "normal": down}
    if kind == "plane_strain" and draw(st.integers(0, 3)) == 0:
        top = {"kind": "rectangle", "from": [0, height], "to": [draw(st.floats(0.4, 1.2)) * width, 2 * height],
               "fillet": 0.1 * min(width, height)}
    tools = {"upper": {"shape": top, "drive": drive, "friction": draw(FRICTION),
                       "symmetry": ["x"] if top["kind"] == "rectangle" else []}}
    if not half:
        tools["lower"] = {"shape": {"kind": "plane", "point": [0.0] * len(up), "normal": up}, "friction": draw(FRICTION)}
    stroke, steps = draw(st.floats(0.05, 0.4)) * height, draw(st.sampled_from([8, 14, 20]))
    size = min(width, height) / (2 if kind == "3d" else draw(st.floats(3, 7)))
    return {"geometry": kind, "materials": {"m": {"flow_stress": draw(LAWS)}},
            "workpieces": {"b": {"shape": shape, "material": "m", "mesh_size": size, "symmetry": symmetry}}, "tools": tools,
            "process": {"shifting": draw(st.sampled_from(["midpoint", "trapezoid", "etd2", "explicit", "substeps"]))},
            "steps": {"stroke": stroke / steps}, "stop": {"stroke": stroke}}


def check_laws(scene: Scene, results) -> None:
    """Finite numbers, volume, power, forces that push and, without weight and inertia, balance each other."""
    balanced(results, LOSSY.get(scene.scheme, 0.01))
    history = results.history
    upper, *lower = (history.column(name) for name in history.columns if name.startswith("force_"))
    assert upper.min() > -1e-6 * upper.max()
    for other in lower:
        assert np.abs(upper - other)[1:].max() < 0.03 * upper.max(), "the plates feel the same force"
    powers = results.summary["ledger"]["power"]["last_mW"]
    for name in ("plastic", "friction"):
        assert powers[name] > -1e-9 * powers["tools"], f"{name} takes power"
    if (bounds := first_force(scene)) is not None:
        least, most = bounds
        assert 0.995 * least < upper[0] < 1.005 * most, "of the first flow, on parallel sides: between the bounds"


def first_force(scene: Scene) -> tuple[float, float] | None:
    """Bounds of the force at the start on a block or cylinder between plates, for metals with a yield stress."""
    body, plates = scene.workpieces["b"], list(scene.tools.values())
    low, high = np.array(body.shape.from_), np.array(body.shape.to)
    if bounds.yield_stress(scene) is None or low[0] > 0 or any(tool.shape.kind != "plane" for tool in plates):
        return None
    both = 2 if len(plates) == 1 else 1
    return bounds.of_upsetting(scene, high[0], high[-1] * both, sum(map(bounds.factor, plates)) * both)


@settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(upsettings())
def test_random_upsetting_keeps_its_laws_or_says_why_it_cannot_go_on(values):
    scene = Scene.read(values)
    try:
        results = simulate(scene)
    except ConvergenceError as failure:
        assert failure.sentence and failure.advice
        return
    check_laws(scene, results)
