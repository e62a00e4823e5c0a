"""Homogeneous compression through scene files: REFERENCES.md 1.1 and 1.2, all laws, at three heights."""

import numpy as np
import pytest

from fenics_forming import read_scene, simulate
from fenics_forming.scene import Scene

LAWS = {
    "perfect": {"law": "constant", "value": 100.0},
    "swift": {"law": "swift", "K": 100.0 * 5**0.3, "prestrain": 0.2, "n": 0.3},
    "linear": {"law": "linear", "initial": 100.0, "hardening": 50.0},
    "power": {"law": "power", "K": 200.0, "n": 0.2, "m": 0.1},
    "norton": {"law": "norton_hoff", "K": 150.0, "m": 0.15},
}
CYLINDER = {  # N at h = 15, 10, 6
    "perfect": (41887.90, 62831.85, 104719.76), "swift": (54729.40, 98434.60, 187900.19),
    "linear": (47913.10, 84607.71, 167759.62), "power": (49807.19, 92763.04, 181704.98),
    "norton": (41856.82, 66722.32, 120059.68),
}
PLANE_STRAIN = {  # N/mm
    "perfect": (3079.201, 4618.802, 7698.004), "swift": (4129.983, 7486.340, 14338.606),
    "linear": (3590.636, 6467.195, 13048.994), "power": (3822.807, 7119.758, 13946.240),
    "norton": (3144.026, 5011.769, 9018.142),
}
STROKES = (5.0, 10.0, 14.0)


def compressed(law, geometry, *, steps=70, stop=14.0):
    """Half of a body 20 mm high between a mirror plane and a smooth platen at 1 mm/s."""
    scene = Scene.read({
        "geometry": geometry, "materials": {"m": {"flow_stress": LAWS[law]}},
        "workpieces": {"b": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 20]}, "material": "m",
                             "mesh_size": 5.0, "symmetry": ["x"] if geometry == "plane_strain" else []}},
        "tools": {"upper": {"shape": {"kind": "plane", "point": [0, 20], "normal": [0, -1]},
                            "drive": {"kind": "speed", "velocity": [0, -1]}},
                  "lower": {"shape": {"kind": "plane", "point": [0, 0], "normal": [0, 1]}}},
        "steps": {"stroke": 14.0 / steps}, "stop": {"stroke": stop}, "output": {"strokes": list(STROKES)}})
    return simulate(scene)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("geometry", "reference"), [("axisymmetric", CYLINDER), ("plane_strain", PLANE_STRAIN)])
def test_the_force_of_homogeneous_compression_is_within_a_tenth_of_a_per_cent(law, geometry, reference, verified):
    results = compressed(law, geometry)
    unit = "N_per_mm" if geometry == "plane_strain" else "N"
    for stroke, exact in zip(STROKES, reference[law], strict=True):
        verified("1.1" if geometry == "axisymmetric" else "1.2", f"force, {law}, h = {20 - stroke:g} mm",
                 results.at(stroke=stroke)[f"force_upper_{unit}"], exact, within=1e-3,
                 unit=unit.replace("_per_", "/"))
    opposite = results.history.column(f"force_lower_{unit}") / results.history.column(f"force_upper_{unit}")
    assert opposite == pytest.approx(np.ones_like(opposite), rel=1e-6)      # what one platen gives the other takes


def test_strain_and_radius_of_the_cylinder_follow_from_its_height(verified):
    results = compressed("perfect", "axisymmetric")
    last = results.at(stroke=14.0)
    verified("1.1", "effective strain, h = 6 mm", last["max_effective_strain"], np.log(20 / 6), within=1e-3)
    verified("1.1", "radius, h = 6 mm", results.summary["extents_mm"]["b"]["r"][1], 18.257419, within=5e-4, unit="mm")
    assert abs(last["volume_error_b"]) < 1e-3


def cube(law, walls, linear, *, steps):
    """One eighth of a 20 mm cube, h 20 → 10, its platen at 0.5 mm/s; between walls it flows in one direction only."""
    values = {
        "geometry": "3d", "materials": {"m": {"flow_stress": LAWS[law]}},
        "workpieces": {"b": {"shape": {"kind": "box", "from": [0, 0, 0], "to": [10, 10, 10]}, "material": "m",
                             "mesh_size": 8.0, "symmetry": ["x", "y", "z"]}},
        "tools": {"upper": {"shape": {"kind": "plane", "point": [0, 0, 10], "normal": [0, 0, -1]},
                            "drive": {"kind": "speed", "velocity": [0, 0, -0.5]}}},
        "solver": {"linear": linear}, "steps": {"stroke": 5.0 / steps}, "stop": {"stroke": 5.0}}
    if walls:
        values["tools"]["wall"] = {"shape": {"kind": "plane", "point": [0, 10, 0], "normal": [0, -1, 0]}}
    return simulate(Scene.read(values)).history.rows[-1]["force_upper_N"]


@pytest.mark.parametrize("linear", ["direct", "iterative"])
@pytest.mark.parametrize(("walls", "exact"), [(True, 4618.802 / 20), (False, 200.0)])
def test_a_cube_gives_the_plane_strain_force_between_walls_and_the_uniaxial_one_without(walls, exact, linear, verified):
    """Per area of the undeformed platen, 2/sqrt(3) or 1 times sigma h0/h; forces are those of the whole cube."""
    verified("1.2" if walls else "1.1", f"cube in 3-D, {'two walls' if walls else 'free sides'}, h = 10 mm, {linear}",
             cube("perfect", walls, linear, steps=20) / 400.0, exact, within=1e-3, unit="MPa")


@pytest.mark.parametrize("law", [law for law in LAWS if law != "perfect"])
def test_a_cube_between_walls_follows_every_law_by_iterations(law, verified):
    """REFERENCES 1.2 in space, at h = 10 mm; both platens at 0.5 mm/s are one at 1 mm/s."""
    verified("1.2", f"cube in 3-D, two walls, {law}, h = 10 mm, iterative", cube(law, True, "iterative", steps=40) / 400.0,
             PLANE_STRAIN[law][1] / 20, within=1e-3, unit="MPa")


def test_the_scene_file_gives_the_same_run_as_the_same_scene_from_python(tmp_path):
    scene = compressed("perfect", "axisymmetric", steps=4).scene
    path = tmp_path / "scene.toml"
    path.write_text(scene.to_toml())
    assert read_scene(path) == scene
