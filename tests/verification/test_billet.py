"""The sticking billet upset by 60 %: REFERENCES.md 3.3, the scene file as it stands."""

from pathlib import Path

import numpy as np
import pytest

from fenics_forming import read_scene, simulate

SCENE = Path(__file__).parents[2] / "demos" / "scenes" / "billet_upsetting.toml"
# reduction: force in kN and its band (elastic-plastic reference), converged rigid-plastic force
TABLE = {0.1: (261, 1, 261.6), 0.2: (306, 1, 307.5), 0.3: (364, 3, 366), 0.4: (448, 5, 450), 0.5: (582, 6, 588),
         0.6: (854, 15, 865)}


@pytest.fixture(scope="module")
def billet():
    return simulate(read_scene(SCENE, set=["output.strokes=[1.5, 3, 4.5, 6, 7.5]"]))


@pytest.mark.parametrize("reduction", TABLE)
def test_the_force_lies_in_the_band_of_the_reference(billet, reduction, verified):
    """The band plus 1 %, since the reference is elastic-plastic."""
    reference, band, _ = TABLE[reduction]
    verified("3.3", f"elastic-plastic reference, {reduction:.0%}", billet.at(stroke=15 * reduction)["force_upper_N"] / 1e3,
             reference, within=band + 0.01 * reference, unit="kN", absolute=True)


@pytest.mark.parametrize("reduction", TABLE)
def test_the_force_is_that_of_the_converged_rigid_plastic_billet(billet, reduction, verified):
    verified("3.3", f"rigid-plastic force, {reduction:.0%}", billet.at(stroke=15 * reduction)["force_upper_N"] / 1e3,
             TABLE[reduction][2], within=0.01, unit="kN")


def test_the_equator_bulges_to_the_reference_radius(billet, verified):
    verified("3.3", "radius of the equator, 60 %", billet.history.rows[-1]["equator_r_mm"], 16.54, within=2e-3, unit="mm")
    verified("3.3", "radius of the equator, 30 %", billet.at(stroke=4.5)["equator_r_mm"], 12.55, within=0.01, unit="mm")


def test_volume_is_kept_without_compensation(billet):
    assert np.abs(billet.history.column("volume_error_billet")).max() < 1e-3


def test_power_balances_in_every_step(billet):
    assert np.abs(billet.history.column("power_imbalance")).max() < 1e-3


def test_newton_needs_no_more_than_five_iterations_a_solve(billet):
    assert billet.summary["newton_iterations_per_solve"] <= 5.0


@pytest.fixture(scope="module")
def deviations():
    """Mean deviation from the converged forces, with meshes of 1.5, 1.0, 0.6 mm and as many steps."""
    errors = []
    for size in (1.5, 1.0, 0.6):
        results = simulate(read_scene(SCENE, set=[f"workpieces.billet.mesh_size={size}", f"steps.stroke={size / 4}",
                                                  "output.strokes=[1.5, 3, 4.5, 6, 7.5]"]))
        errors.append(np.mean([abs(results.at(stroke=15 * q)["force_upper_N"] / 1e3 / TABLE[q][2] - 1) for q in TABLE]))
    return errors


@pytest.mark.long
def test_the_force_of_a_fine_mesh_is_the_converged_one(deviations):
    assert deviations[2] < 0.006


@pytest.mark.long
def test_the_force_converges_with_mesh_and_step(deviations):
    assert deviations[2] < deviations[0]
