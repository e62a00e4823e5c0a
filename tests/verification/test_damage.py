"""Cockcroft-Latham damage: the largest principal stress over the flow stress, gathered with the strain."""

import meshio
import numpy as np
import pytest

from fenics_forming import FixedVelocity, NewtonSettings, kinematics, laws, meshing, read_scene, simulate
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.workpiece import Workpiece
from fenics_forming.process.body import FlowingBody
from fenics_forming.process.integration import Midpoint
from fenics_forming.results.progress import Silent
from tests.stability.scenes import BILLET, COARSE_BILLET

from .shapes import held, ring_sector, side

TIGHT = NewtonSettings(velocity_tolerance=1e-10, force_tolerance=1e-9)
STRESS = 100.0
LAW = laws.CockcroftLatham()


def body_of(mesh, kind, fixed, *, law=None, speed=1.0):
    """A body without tools that flows by the velocities given on its sides."""
    workpiece = Workpiece(Nodes(mesh), kinematics=kinematics.KINDS[kind], fixed=fixed, settings=TIGHT,
                          flow_stress=law or laws.Constant(value=STRESS))
    body = FlowingBody(workpiece, drives={}, boundary=np.empty(0, np.int32), damage=LAW,
                       working_direction=np.eye(workpiece.nodes.dim)[-1])
    body.speed = speed
    return body


def pulled(kind, speed, *, law=None):
    """An upright bar, held on its mirror planes, whose top face moves with ``speed``; its sides are free."""
    dim = 3 if kind == "3d" else 2
    mesh = meshing.box((0, 0, 0), (1, 1, 2), (1, 1, 2)) if dim == 3 else meshing.rectangle((0, 0), (1, 2), (2, 3))
    fixed = [FixedVelocity(side(mesh, axis, 0.0), axis) for axis in range(dim)]
    return body_of(mesh, kind, [*fixed, FixedVelocity(side(mesh, dim - 1, 2.0), dim - 1, speed)], law=law)


def gathered(body, steps=8, dt=0.05):
    """Effective strain and damage after some steps."""
    history = body.new_history()
    for k in range(steps):
        history = Midpoint().advance(body, body.solve(k * dt, history, dt), k * dt, history, dt).history
    return history["effective_strain"], history["damage"]


# stress over flow stress in the direction of the pull: 1, or that of plane strain
RATIO = {"axisymmetric": 1.0, "3d": 1.0, "plane_strain": 2 / np.sqrt(3)}


@pytest.mark.parametrize(("kind", "law"), [*((kind, None) for kind in RATIO),
                                           ("axisymmetric", laws.Linear(initial=STRESS, hardening=300.0))])
def test_damage_of_a_pulled_bar_is_the_strain_times_the_stress_ratio(kind, law):
    """Only the regularisation of the rate, (1.5e-3)²/2 of it, stands between the stress and the flow stress."""
    strain, damage = gathered(pulled(kind, 1.0, law=law))
    assert strain == pytest.approx(np.log(1.2) * RATIO[kind], rel=1e-4)    # midpoint rule, 8 steps: 4.4e-5
    assert damage == pytest.approx(RATIO[kind] * strain, rel=2e-6)


@pytest.mark.parametrize("kind", RATIO)
def test_compression_does_no_damage(kind):
    strain, damage = gathered(pulled(kind, -1.0))
    assert strain.min() > 0.2
    assert damage.max() < 1e-9 * strain.max()          # the lateral stress is zero but for the solver
    assert damage.min() >= 0.0


def expanding(kind, divisions):
    """A thick tube, radii 1 to 4, that is widened from within (v = 1/r) and free outside, in plane strain."""
    if kind == "plane_strain":
        mesh = ring_sector(1.0, 4.0, divisions, divisions)
        inside = meshing.boundary_facets(mesh, lambda x: np.hypot(x[0], x[1]) < 1 + 1e-9)
        fixed = [FixedVelocity(side(mesh, 0, 0.0), 0), FixedVelocity(side(mesh, 1, 0.0), 1),
                 *(FixedVelocity(inside, i, lambda x, i=i: x[:, i]) for i in (0, 1))]
    else:
        mesh = meshing.rectangle((1, 0), (4, 1), (3 * divisions, divisions))
        fixed = [FixedVelocity(side(mesh, 1, 0.0), 1), FixedVelocity(side(mesh, 1, 1.0), 1),
                 FixedVelocity(side(mesh, 0, 1.0), 0, 1.0)]
    return body_of(mesh, kind, fixed)


@pytest.mark.parametrize("kind", ["axisymmetric", "plane_strain"])
def test_damage_of_a_widened_tube_comes_from_its_hoop_stress(kind):
    """hoop stress = 2 k (1 - ln(b/r)), pressed together within r = b/e: out of the plane of the mesh in one kind, in it
    in the other; rates of the strain are (2/sqrt 3)/r²."""
    errors = []
    for divisions in (4, 8):
        body = expanding(kind, divisions)
        flow = body.solve(0.0, body.new_history(), 1e-3)
        r = body.x[:, 0] if kind == "axisymmetric" else np.hypot(*body.x.T)
        exact = 4 / 3 * np.maximum(1 - np.log(4 / r), 0.0) / r**2
        vertex = body.nodes.is_vertex
        errors.append(np.abs(flow.rates["damage"] - exact)[vertex].max() / exact.max())
    assert errors[1] < 0.01
    assert np.log2(errors[0] / errors[1]) > 1.7, errors     # pressure and rate are of order 2


@pytest.mark.parametrize("divisions", [8, 16])
def test_damage_at_a_notch_stays_below_the_slip_line_bound(divisions):
    """A deep notch raises the largest stress to (2 + pi) k at most, however sharp it is and however fine the mesh."""
    mesh = meshing.rectangle((0, 0), (4, 4), (divisions, divisions))
    ligament = side(mesh, 1, 0.0, within=(0.0, 1.0))
    fixed = [FixedVelocity(side(mesh, 0, 0.0), 0), FixedVelocity(ligament, 1), *held(side(mesh, 1, 4.0), (0.0, 1.0))]
    body = body_of(mesh, "plane_strain", fixed)
    flow = body.solve(0.0, body.new_history(), 1e-3)
    flows = flow.rate > 0.01 * flow.rate.max()
    ratio = flow.rates["damage"][flows] / flow.rate[flows]
    assert 1.5 < ratio.max() < (2 + np.pi) / np.sqrt(3)      # 1.15 in a plain bar


class Listener(Silent):
    def __init__(self):
        self.notes = []

    def note(self, sentence):
        self.notes.append(sentence)


@pytest.fixture(scope="module")
def barrelled(tmp_path_factory):
    folder = tmp_path_factory.mktemp("billet")
    (folder / "scene.toml").write_text(BILLET, encoding="utf-8")
    material = BILLET.split("[materials.")[1].split("]")[0]
    scene = read_scene(folder / "scene.toml", set=[*COARSE_BILLET, "stop.stroke='6 mm'",
                       f"materials.{material}.damage={{law='cockcroft_latham', critical=0.02}}"])
    listener = Listener()
    return simulate(scene, folder / "out", observer=listener), listener.notes


def test_a_barrelling_billet_gathers_damage_and_passes_the_critical_value_once(barrelled):
    results, notes = barrelled
    damage = results.history.column("max_damage")
    assert damage[0] == 0.0 and (np.diff(damage) >= 0).all()
    assert 0.02 < damage[-1] < results.history.column("max_effective_strain")[-1]
    first = int(results.history.column("step")[np.argmax(damage >= 0.02)])
    assert [n for n in notes if "damage" in n] == [n for n in notes if f"critical value 0.02 in step {first}" in n]
    assert results.summary["ledger"]["damage"] == {"largest": damage[-1], "critical": 0.02, "passed_at_step": first}
    assert "damage cockcroft_latham" in results.summary["parts_built"]


def test_damage_is_written_with_the_fields_and_the_points(barrelled):
    results, _ = barrelled
    last, frame = results.history.rows[-1], meshio.read(results.frames[-1][1])
    assert frame.point_data["damage"].max() == last["max_damage"]
    assert 0.0 < last["equator_damage"] <= last["max_damage"]


def test_a_material_without_a_damage_law_has_none():
    body = pulled("plane_strain", 1.0)
    plain = FlowingBody(body.workpiece, drives={}, boundary=np.empty(0, np.int32), working_direction=(0, 1))
    plain.speed = 1.0
    flow = plain.solve(0.0, plain.new_history(), 0.05)
    assert set(plain.new_history()) == set(flow.rates) == {"effective_strain"}
