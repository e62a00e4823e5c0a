"""Absent, not zero (DESIGN 3.3): what a scene does not name is not built, evaluated, tracked or even imported."""

import json
import subprocess
import sys
import textwrap

import numpy as np
import pytest

from fenics_forming import laws, scene
from fenics_forming.physics import newton
from fenics_forming.physics.contact import point_law
from fenics_forming.physics.workpiece import Workpiece
from fenics_forming.results.recording.recorder import Recorder
from fenics_forming.simulation import Simulation, simulate


def upsetting(flow_stress=None, friction=None, temperature=None, points=None, travel=0.5):
    """A coarse billet between a mirror plane and a platen, one step."""
    tool = {} if friction is None else {"friction": friction}
    return scene.Scene(
        geometry="axisymmetric", materials={"m": scene.Material(flow_stress=flow_stress or laws.Constant(value=100))},
        workpieces={"billet": scene.Workpiece(shape=scene.Rectangle(from_=(0, 0), to=(10, 10)), material="m",
                                              symmetry=["z"], mesh_size=4, temperature=temperature)},
        tools={"upper": scene.Tool(shape=scene.Plane(point=(0, 10), normal=(0, -1)),
                                   drive=laws.SpeedDrive(velocity=(0, -1)), **tool)},
        points=points or {}, steps=scene.Steps(stroke=travel), stop=scene.Stop(stroke=travel))


@pytest.fixture
def calls(monkeypatch):
    """Counts calls of the functions that belong to one part each, and what they were given."""
    counted = {}

    def count(owner, name, note=lambda *a, **k: True):
        original = getattr(owner, name)
        counted[name] = []

        def counting(*args, **more):
            counted[name].append(note(*args, **more))
            return original(*args, **more)

        monkeypatch.setattr(owner, name, counting)

    for name in ("friction_response", "update_friction_stress", "slip_velocity"):
        count(point_law, name)
    original = newton.FlowSolver._nodal_flow_stress

    def answered(self, *args, **more):
        found = original(self, *args, **more)
        counted["flow stress at contact"].append(found is not None)
        return found

    counted["flow stress at contact"] = []
    monkeypatch.setattr(newton.FlowSolver, "_nodal_flow_stress", answered)
    count(Workpiece, "body_force_power", lambda self: self._force_power is not None)
    return counted


def test_scene_without_friction_builds_and_evaluates_none(calls):
    results = simulate(upsetting())
    parts = results.summary["parts_built"]
    assert parts == ["term plastic", "term incompressibility", "term contact", "scheme midpoint"]
    assert not any(calls[name] for name in ("friction_response", "update_friction_stress", "slip_velocity"))
    assert not any(calls["flow stress at contact"]), "the flow stress at the contact serves friction only"
    assert not any(calls["body_force_power"])


@pytest.mark.parametrize("friction", [laws.Siebel(factor=0.1), laws.Coulomb(coefficient=0.1), laws.Sticking()],
                         ids=lambda f: f.law)
def test_scene_with_friction_builds_it_and_says_so(friction, calls):
    """The other side of the test above: the counters do count."""
    results = simulate(upsetting(friction=friction))
    assert f"friction upper: {friction.law}" in results.summary["parts_built"]
    assert calls["friction_response"] and calls["slip_velocity"] and any(calls["flow stress at contact"])


def test_friction_none_is_no_friction(calls):
    """`friction = { law = "none" }` is the same as no key."""
    results = simulate(upsetting(friction=laws.NoFriction()))
    assert not any("friction" in part for part in results.summary["parts_built"])
    assert not calls["friction_response"]


class Remembering(laws.NortonHoff):
    """Norton's law that notes the temperatures it is asked with."""

    law: str = "norton_hoff"

    def __call__(self, strain, rate, temperature=None):
        ASKED.append(temperature)
        return super().__call__(strain, rate, temperature)


ASKED: list = []


@pytest.mark.parametrize("temperature", [None, 900.0])
def test_temperature_is_known_to_laws_and_columns_only_where_the_scene_has_one(temperature):
    ASKED.clear()
    points = {"p": scene.TrackedPoint(body="billet", at=(0, 5))}
    run = Simulation(upsetting(Remembering(K=100, m=0.1), temperature=temperature, points=points))
    results = run.run()
    column = "p_temperature_degC"
    assert ASKED, "the law was asked"
    if temperature is None:
        assert run.body.temperature is None and all(t is None for t in ASKED)
        assert column not in results.history.columns
    else:
        assert all(np.allclose(t, 900.0, rtol=1e-12) for t in ASKED)
        assert results.history.column(column)[-1] == 900.0


def test_isothermal_scene_computes_no_heat_whatever_is_known_of_its_material(monkeypatch):
    """Density, conductivity, specific heat and a temperature are there, and nothing asks for heat: no field, no form."""
    known = {"density": 7.85e-9, "conductivity": 40.0, "specific_heat": 4.6e8}
    described = upsetting(Remembering(K=100, m=0.1), temperature=900.0)
    described = described.replaced(materials={"m": described.materials["m"].replaced(**known)})
    results = simulate(described)
    assert not any("heat" in part for part in results.summary["parts_built"])
    assert "heat" not in results.summary["ledger"] and "heat" not in results.summary["wall_s_by_part"]
    assert not any("heat" in column or "temperature" in column for column in results.history.columns)
    warm = simulate(described.replaced(process=scene.Process(heat=True)))
    assert "heat conduction" in warm.summary["parts_built"] and "heat" in warm.summary["wall_s_by_part"]


def test_scene_without_points_tracks_none(monkeypatch):
    """No search in the mesh, no columns."""
    from fenics_forming.physics import tracking

    searched = []
    original = tracking.Locator
    monkeypatch.setattr(tracking, "Locator", lambda x, cells: searched.append(x) or original(x, cells))
    none = simulate(upsetting())
    assert not searched
    one = simulate(upsetting(points={"p": scene.TrackedPoint(body="billet", at=(0, 5))}))
    assert len(searched) == 1, "once, not at every step"
    assert set(one.history.columns) - set(none.history.columns) == {
        "p_r_mm", "p_z_mm", "p_effective_strain", "p_mean_stress_MPa"}


def test_run_without_a_folder_writes_nothing(tmp_path, monkeypatch):
    """No frame is prepared either: the fields of a frame are evaluated only when it is due."""
    monkeypatch.chdir(tmp_path)
    framed = []
    monkeypatch.setattr(Recorder, "_frame", lambda *a: framed.append(a))
    simulate(upsetting())
    assert not framed and not list(tmp_path.iterdir())


def test_law_without_rate_is_not_asked_for_its_rate_derivative(monkeypatch):
    asked = []
    for law in (laws.FlowStress, laws.NortonHoff):
        def counting(self, *args, original=law.rate_derivative):
            asked.append(type(self))
            return original(self, *args)

        monkeypatch.setattr(law, "rate_derivative", counting)
    simulate(upsetting(laws.Constant(value=100)))
    assert not asked
    simulate(upsetting(laws.NortonHoff(K=100, m=0.1)))
    assert asked


# ---------------------------------------------------------------------- imports
SCENE = """
    import json, sys
    import fenics_forming as ff
    from fenics_forming import laws, scene

    def loaded(*names):
        return [n for n in names if n in sys.modules]

    described = scene.Scene(
        geometry="axisymmetric", materials={"m": scene.Material(flow_stress=laws.Constant(value=100))},
        workpieces={"b": scene.Workpiece(shape=scene.Rectangle(from_=(0, 0), to=(10, 10)), material="m",
                                         symmetry=["z"], mesh_size=5)},
        tools={"upper": scene.Tool(shape=scene.Plane(point=(0, 10), normal=(0, -1)),
                                   drive=laws.SpeedDrive(velocity=(0, -1)))},
        steps=scene.Steps(stroke=0.5), stop=scene.Stop(stroke=0.5))
    read = scene.Scene.read(__import__("tomllib").loads(described.to_toml()))
    warnings = ff.check(read)
    answer = {"described": loaded("dolfinx", "ufl", "basix", "petsc4py", "mpi4py", "gmsh", "numba", "pyvista",
                                  "matplotlib", "meshio", "rich", "fenics_forming.physics", "fenics_forming.results",
                                  "fenics_forming.simulation")}
    results = ff.simulate(read)
    answer["run"] = loaded("pyvista", "vtk", "matplotlib", "meshio", "rich", "scipy.spatial",
                           "fenics_forming.physics.contact.bvh", "fenics_forming.physics.contact.triangulated",
                           "fenics_forming.results.pictures.in_space")
    answer["remeshing"] = [name for name in sys.modules if name == "mmgpy" or name.startswith("fenics_forming.") and
                           name.endswith((".meshes.keeper", ".triggers", ".transfer", ".adaptation", ".plane", ".solid",
                                          ".mmg", ".assembling", ".interfaces", ".mass", ".inertia"))]
    answer["heat"] = [name for name in sys.modules if name.startswith("fenics_forming.") and
                      (".thermal" in name or name.split(".")[1] not in ("laws", "scene") and "heat" in name)
                      and not name.endswith("tool_body.heating")]
    answer["dolfinx"] = "dolfinx" in sys.modules
    answer["steps"] = len(results.history)
    print(json.dumps(answer))
"""


def test_run_without_output_imports_no_drawing_library_no_remeshing_and_compiles_no_search_tree():
    """And describing, reading and checking a scene imports no dolfinx.

    numba itself cannot be kept out: dolfinx imports it.  What the package compiles with it, the search trees of
    profiles with many pieces and of triangulated tools, lies in ``bvh``.
    """
    run = subprocess.run([sys.executable, "-c", textwrap.dedent(SCENE)], capture_output=True, text=True, timeout=900)
    assert run.returncode == 0, run.stderr
    answer = json.loads(run.stdout.splitlines()[-1])
    assert answer == {"described": [], "run": [], "remeshing": [], "heat": [], "dolfinx": True, "steps": 2}
