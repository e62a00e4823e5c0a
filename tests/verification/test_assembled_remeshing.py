"""New meshes and restored volumes of several workpieces: they meet again where they pressed on one another."""

from pathlib import Path

import numpy as np
import pytest

from fenics_forming import scene
from fenics_forming.simulation import Simulation, simulate

from .test_assembled_workpieces import SCENES, command, differing, settings

RIVET = Path(__file__).parents[2] / "demos" / "scenes" / "riveting.toml"
SIZES = ["workpieces.rivet.mesh_size=0.9", "workpieces.lower.mesh_size=0.8", "workpieces.upper.mesh_size=0.85",
         "steps.stroke=0.1"]
EVERY = ["workpieces.core.remesh={ every = 3 }", "workpieces.sleeve.remesh={ every = 4 }"]


def test_rivet_is_closed_beyond_what_its_first_mesh_can_follow():
    """To 3 mm, with new meshes of the rivet where they are due: the force goes on rising, that of the demo (24.5 kN at
    2.2 mm with the first mesh) is kept within 2 %, and the plates, which have no ``remesh``, keep their meshes."""
    run = Simulation(scene.read_scene(RIVET, set=[*SIZES, "stop.stroke=3", "workpieces.rivet.remesh=true"]))
    plates = run.body.parts.counts[1:]
    results = run.run()
    history, summary = results.history, results.summary
    assert summary["stopped"] == "stroke 3 mm reached" and summary["remeshings"] >= 1
    assert run.body.parts.counts[1:] == plates
    assert all(record["reason"].startswith("'rivet'") for record in summary["remeshed"])
    assert results.at(stroke=2.2)["force_snap_N"] == pytest.approx(24.5e3, rel=0.02)
    late = history.column("stroke_snap_mm") > 2.2
    assert (np.diff(history.column("force_snap_N")[late]) > 0).all()
    # a coarse mesh of 0.9 mm on a shank of 3 mm; 4 % while surfaces met node by node, as overlaps of the new ones pushed
    for record in summary["remeshed"]:
        assert record["forces"][1][0] == pytest.approx(record["forces"][0][0], rel=0.01)
    for name in ("rivet", "lower", "upper"):
        assert np.abs(history.column(f"volume_error_{name}")).max() < 1e-12
    # the head that clamps the plates presses on them as the snap presses on it
    assert history.column("contact_force_rivet_upper_N")[-1] == pytest.approx(history.column("force_snap_N")[-1], rel=0.06)


@pytest.mark.long
def test_new_meshes_of_core_and_sleeve_change_the_force_little():
    """Bimetal, coarse, a new mesh of either body every third or fourth step: force within 1 % of that with the first
    meshes, forces between the bodies within 10 % of their largest; nothing of the volume is lost."""
    base = ["workpieces.core.mesh_size=1.5", "workpieces.sleeve.mesh_size=1.3", "steps.stroke=0.2", "stop.stroke=3",
            "points.in_core={ body = 'core', at = [3, 5] }", "points.in_sleeve={ body = 'sleeve', at = [8, 5] }"]
    whole, renewed = (simulate(scene.read_scene(SCENES / "bimetal_upsetting.toml", set=[*base, *more]))
                      for more in ([], EVERY))
    assert renewed.summary["remeshings"] >= 5
    force = [found.history.column("force_upper_N") for found in (whole, renewed)]
    assert force[1] == pytest.approx(force[0], rel=0.01)
    between = [found.history.column("contact_force_core_sleeve_N") for found in (whole, renewed)]
    assert between[1][-1] == pytest.approx(between[0][-1], abs=0.1 * between[0].max())
    for name in ("core", "sleeve"):
        assert np.abs(renewed.history.column(f"volume_error_{name}")).max() < 1e-12
        strain = [found.history.column(f"in_{name}_effective_strain")[-1] for found in (whole, renewed)]
        assert strain[1] == pytest.approx(strain[0], rel=0.03)


def test_volume_of_several_bodies_is_given_back_in_each_step():
    """The force is that without within 0.5 %, and the ledger says what was done. The core, which is pressed all around,
    gives and takes at the surface to its sleeve."""
    base = ["workpieces.core.mesh_size=1.5", "workpieces.sleeve.mesh_size=1.3", "steps.stroke=0.25", "stop.stroke=2.5"]
    plain, kept = (simulate(scene.read_scene(SCENES / "bimetal_upsetting.toml", set=[*base, *more]))
                   for more in ([], ["process.volume_constancy='each_step'"]))
    assert kept.history.column("force_upper_N") == pytest.approx(plain.history.column("force_upper_N"), rel=5e-3)
    for name in ("core", "sleeve"):
        assert np.abs(plain.history.column(f"volume_error_{name}")).max() > 1e-6
        assert np.abs(kept.history.column(f"volume_error_{name}")).max() < 1e-12
        by = kept.summary["ledger"]["volume"][name]["by"]
        assert by["given back"] == pytest.approx(-by["integration"] - by["corners"], abs=1e-12) and by["given back"] != 0


def test_run_with_new_meshes_is_resumed_as_if_it_had_not_stopped(tmp_path):
    """Stopped right before and right after a new mesh; points stay in their bodies."""
    whole = command(tmp_path / "whole", *settings(*EVERY, "stop.stroke=1.5"))
    command(tmp_path / "cut", *settings(*EVERY, "stop.stroke=0.75"))
    again = command(tmp_path / "cut", *settings(*EVERY, "stop.stroke=1.5"), "--resume")
    assert differing(whole, again) < 1e-9
    at = [whole.column(f"{point}_r_mm")[-1] for point in ("middle", "side")]
    assert at[0] == pytest.approx(at[1], abs=0.02)


@pytest.mark.mpi
def test_new_meshes_do_not_depend_on_the_number_of_ranks(tmp_path):
    found = [command(tmp_path / str(ranks), *settings(*EVERY, "stop.stroke=1"), ranks=ranks) for ranks in (1, 2)]
    assert differing(*found) < 1e-6     # of a mesh made anew from positions that differ by rounding
