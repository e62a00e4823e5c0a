"""Heat in the network of the nodes: bounds, balance, transfer, and what a scene must say for it."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_forming import SceneError, check
from fenics_forming.laws.heat_exchange import Air, ConstantExchange
from fenics_forming.physics import meshing
from fenics_forming.physics.contact.facets import ContactFacets
from fenics_forming.physics.contact.rigid import KnownTool, ToolMotion
from fenics_forming.physics.contact.surfaces import Plane
from fenics_forming.physics.kinematics import KINDS
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.thermal.bed import Bed
from fenics_forming.physics.thermal.field import HeatField
from fenics_forming.physics.thermal.network import Network
from fenics_forming.process.heat.heating import BodyHeat, ToolExchange
from fenics_forming.scene import Scene

CONDUCTIVITY, CAPACITY = 25.0, 7500e-12 * 650e6


def sheared(dim):
    """A body whose cells are long, thin and obtuse, as after a large shear."""
    if dim == 2:
        mesh, kin = meshing.rectangle((0, 0), (10, 10), (8, 8)), "plane_strain"
    else:
        mesh, kin = meshing.box((0, 0, 0), (10, 10, 10), (4, 4, 4)), "3d"
    x = mesh.geometry.x
    x[:, 0] += 2.5 * x[:, dim - 1]
    return Nodes(mesh), KINDS[kin]


def on_cold_plane(dim):
    """Heat of the sheared body with its low face on a die at 20 degC, well conducting."""
    nodes, kin = sheared(dim)
    field = HeatField(nodes, kin, conductivity=CONDUCTIVITY, volumetric_capacity=CAPACITY)
    low = meshing.boundary_facets(nodes.mesh, lambda x: np.isclose(x[dim - 1], 0))
    up = np.zeros(dim)
    up[-1] = 1.0
    tool = KnownTool("die", Plane(np.zeros(dim), up), None, ToolMotion(np.zeros(dim), np.zeros(dim)))
    exchange = ToolExchange(ConstantExchange(temperature=20.0, coefficient=100.0))
    return BodyHeat(field, ContactFacets(nodes, kin, low), effusivity=11.0, exchanges={"die": exchange}), tool


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("dt", [1e-4, 1.0, 1e4])
def test_nothing_is_hotter_or_colder_than_what_it_touches_on_any_mesh_in_any_step(dim, dt):
    """The maximum principle, on obtuse cells where linear elements do not have it by themselves; heat balances to 1e-8."""
    body, tool = on_cold_plane(dim)
    _, pairs, conductance = body.field.network()
    assert conductance.min() < -0.05 * conductance.max(), "the mesh is bad enough"
    history, state = {"temperature": np.full(body.field.nodes.count, 1200.0)}, body.first()
    for _ in range(5):
        history, state = body.advance(history, history, state, [tool], dt)
        temperature = history["temperature"]
        assert temperature.min() >= 20.0 - 1e-5 and temperature.max() <= 1200.0 + 1e-5
        assert abs(state.imbalance) < 1e-8
    content = body.field.content(np.full(body.field.nodes.count, 1200.0)) - body.field.content(temperature)
    assert content > 0


def test_pairs_are_cut_only_where_they_do_harm():
    """A smooth temperature spreads on the same bad mesh as linear elements have it, but in its two sharp corners."""
    nodes, kin = sheared(2)
    field = HeatField(nodes, kin, conductivity=CONDUCTIVITY, volumetric_capacity=CAPACITY)
    x, y = nodes.x[:, 0] - 2.5 * nodes.x[:, 1], nodes.x[:, 1]
    smooth = nodes.with_mids(600.0 + 300.0 * np.sin(np.pi * x / 10) * np.sin(np.pi * y / 10))
    network = Network(*field.network())
    assert (network.conductance < 0).sum() > 50
    found = network.step(field.gathered(smooth), np.zeros(nodes.is_vertex.sum()), 0.1)
    assert found.cut_pairs <= 2 and abs(found.imbalance) < 1e-10
    assert found.temperature.max() < smooth.max() - 10


def test_heat_content_is_met_within_the_range_of_the_temperatures():
    """The hottest stay the hottest; an even temperature stays even."""
    nodes, kin = sheared(2)
    field = HeatField(nodes, kin, conductivity=CONDUCTIVITY, volumetric_capacity=CAPACITY)
    temperature = nodes.with_mids(1000.0 - 8.0 * nodes.x[:, 1] ** 2)
    for factor in (1.001, 0.999, 1.0):
        corrected = field.with_content(temperature, factor * field.content(temperature))
        assert field.content(corrected) == pytest.approx(factor * field.content(temperature), rel=1e-13)
        assert corrected.max() <= temperature.max() and corrected.min() >= temperature.min()
        assert np.abs(corrected - temperature).max() < 3.0
    even = np.full(nodes.count, 700.0)
    assert (field.with_content(even, field.content(even)) == even).all()


# ---------------------------------------------------------------------- columns of a tool
def test_a_patch_that_slides_leaves_warm_columns_behind_and_comes_upon_cold_ones():
    """Flux q on a patch of width w at speed u: without heat along the surface the rise grows from its front to its end as
    2 q/e √(t/π), t = (distance from the front)/u (Jaeger 1942), and fades behind as 2 q/e (√t - √(t - w/u)) / √π."""
    width, speed, flux, effusivity, steps = 5.0, 100.0, 1e3, 12.0, 200
    along, dt = (np.arange(400) + 0.5) / 400 * width, width / speed / 50
    bed = Bed.untouched(2)
    for step in range(1, steps + 1):
        places = np.column_stack([along + speed * dt * step, np.full(400, 3.0)])
        bed, below, shares = bed.touched(places, np.full(400, width / 400), 0.2)
        bed = bed.advanced(np.bincount(below.ravel(), (shares * flux * width / 400 * dt).ravel(), len(bed.area)), dt)
    x, rise = bed.corners[:, 0] * bed.spacing, bed.rise(effusivity, 0.0)
    front = width + speed * dt * steps
    since = (front - x) / speed
    exact = 2 * flux / effusivity / np.sqrt(np.pi) * (np.sqrt(np.maximum(since, 0)) -
                                                      np.sqrt(np.maximum(since - width / speed, 0)))
    passed = since * speed / width      # the sharp end of the patch falls off by a tenth in half a column
    middle = (passed > 0.1) & (np.abs(passed - 1.0) > 0.06) & (x > width + 1)
    assert np.abs(rise - exact)[middle].max() < 0.02 * exact.max()
    assert x[middle].size > 50 and rise[x > front + 0.2].max(initial=0.0) == 0.0
    given = steps * dt * flux * width
    assert bed.area @ bed.modes[:, 0] == pytest.approx(given, rel=1e-12), "the slowest mode does not fade: it counts heat"


@pytest.mark.parametrize("dim", [2, 3])
def test_the_surface_of_a_tool_belongs_to_its_columns_once(dim):
    """Points on a round tool: their whole area is that of the columns, touched again nothing is new, and the columns that
    were there first keep their numbers."""
    rng = np.random.default_rng(3)
    places = rng.normal(size=(3000, dim))
    places *= 10 / np.linalg.norm(places, axis=1, keepdims=True)
    area = np.full(3000, 0.01)
    first, _, _ = Bed.untouched(dim).touched(places[:500], area[:500], 4.0)
    bed, below, shares = first.touched(places, area, 9.0)
    assert bed.spacing == first.spacing == 2.0 and bed.area.sum() == pytest.approx(30.0)
    assert (bed.corners[: len(first.corners)] == first.corners).all()
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    assert np.abs(np.einsum("nk,nkd->nd", shares, bed.spacing * bed.corners[below]) - places).max() < 0.01
    again, _, _ = bed.touched(places[::2], area[::2], 1.0)
    assert len(again.area) == len(bed.area) and (again.area == bed.area).all()


# ---------------------------------------------------------------------- scenes
HOT = {"density": "7500 kg/m^3", "conductivity": "28 W/m/K", "specific_heat": "650 J/kg/K"}
AIR = {"temperature": "20 degC", "coefficient": "20 W/m^2/K"}


def scene(material=HOT, body=None, tool=None, **more):
    return {"geometry": "axisymmetric",
            "materials": {"steel": {"flow_stress": {"law": "constant", "value": 100}, **material}, "bare": {}},
            "workpieces": {"billet": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 10]}, "material": "steel",
                                      "symmetry": ["z"], "mesh_size": 5, "temperature": 1000, **(body or {})}},
            "tools": {"upper": {"shape": {"kind": "plane", "point": [0, 10], "normal": [0, -1]},
                                "drive": {"kind": "speed", "velocity": [0, -1]}, **(tool or {})}},
            "steps": {"stroke": 0.5}, "stop": {"stroke": 0.5}, **more}


COLUMN = {"kind": "column", "temperature": 200, "coefficient": "10000 W/m^2/K"}
WITHOUT = {"process": {"flow": False}, "steps": {"time": 1}, "stop": {"time": 2}}


@pytest.mark.parametrize(("given", "key", "words"), [
    (scene(material={}, body={"air": AIR}), "materials.steel.density", "workpieces.billet.air asks for temperatures"),
    (scene(body={"air": AIR, "temperature": None}), "workpieces.billet.temperature", "is missing"),
    (scene(tool={"heat_exchange": COLUMN}), "tools.upper.heat_exchange.material", "needs the material"),
    (scene(tool={"heat_exchange": {**COLUMN, "material": "stele"}}), "tools.upper.heat_exchange.material", "'steel'"),
    (scene(tool={"heat_exchange": {**COLUMN, "material": "bare"}}), "materials.bare.density", "takes up heat"),
    (scene(tool={"heat_exchange": {**COLUMN, "kind": "coupled", "material": "steel"}}), "tools.upper.shape", "no volume"),
    (scene(process={"cooling": [{"time": 1, "on": ["uper"]}]}), "process.cooling.0.on", "did you mean 'upper'?"),
    (scene(tool={"heat_exchange": {"kind": "colum"}}), "tools.upper.heat_exchange.kind", "did you mean 'column'?"),
    (scene(body={"air": {"temperature": 20}}), "workpieces.billet.air.coefficient", "emissivity"),
    (scene(**WITHOUT), "tools.upper.drive", "nothing is formed"),
    (scene(tool={"drive": None}, **{**WITHOUT, "stop": {"stroke": 2}}), "stop", "stops at a time"),
    (scene(tool={"drive": None}, **{**WITHOUT, "steps": {"stroke": 2}}), "steps.stroke", "steps.time"),
], ids=lambda value: value if isinstance(value, str) and "." in value else "")
def test_a_scene_that_cannot_compute_its_temperatures_is_refused_where_it_is_wrong(given, key, words):
    given["tools"]["upper"] = {k: v for k, v in given["tools"]["upper"].items() if v is not None}
    given["workpieces"]["billet"] = {k: v for k, v in given["workpieces"]["billet"].items() if v is not None}
    with pytest.raises(SceneError) as raised:
        check(Scene.read(given))
    problems = {problem.key: str(problem) for problem in raised.value.problems or [raised.value]}
    assert key in problems and words in problems[key], problems


def test_a_scene_computes_heat_only_where_something_asks_for_it():
    assert not Scene.read(scene()).computes_heat, "a temperature alone is that of the flow stress"
    assert Scene.read(scene(material={**HOT, "plastic_heat_fraction": 0.9})).computes_heat
    assert Scene.read(scene(body={"air": AIR})).computes_heat
    assert Scene.read(scene(process={"heat": True})).computes_heat
    switched_off = Scene.read(scene(body={"air": AIR}, process={"heat": False}))
    assert not switched_off.computes_heat
    assert "workpieces.billet.air: has no effect, process.heat is false" in check(switched_off)
    assert Scene.read(scene(process={"cooling": {"time": 2}})).computes_heat
    assert Air(emissivity=0.8).temperature == 20
