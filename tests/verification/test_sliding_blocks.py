"""A block that slides under its weight, by Coulomb friction on a rigid slope (REFERENCES.md 7), whatever its elements."""

import numpy as np
import pytest

from fenics_forming import simulate
from fenics_forming.scene import Scene

GRAVITY = 9806.65


def sliding(slope, coefficient, *, time, steps=50, size=10.0, speed=0.0):
    """A block 20 x 20 mm on a slope, in degrees; way of its middle along it, mm, and the times, s."""
    c, s = np.cos(np.deg2rad(slope)), np.sin(np.deg2rad(slope))
    turn = np.array([[c, s], [-s, c]])
    corners = np.array([[0, 0], [20, 0], [20, 20], [0, 20]]) @ turn
    body = {"shape": {"kind": "polygon", "points": corners.tolist()}, "material": "steel", "mesh_size": size}
    if speed:
        body["initial_velocity"] = [-speed * c, -speed * s]
    results = simulate(Scene.read({
        "geometry": "plane_strain", "workpieces": {"block": body}, "process": {"inertia": True, "weight": True},
        "materials": {"steel": {"flow_stress": {"law": "constant", "value": 100}, "density": 7.85e-9}},
        "tools": {"slope": {"shape": {"kind": "plane", "point": [0, 0], "normal": [-s, c]},
                            "friction": {"law": "coulomb", "coefficient": coefficient}}},
        "points": {"middle": {"body": "block", "at": (np.array([10, 10]) @ turn).tolist()}},
        "steps": {"time": time / steps}, "stop": {"time": time}}))
    history = results.history
    x, y = (history.column(f"middle_{axis}_mm") for axis in "xy")
    return history.column("time_s"), (x[0] - x) * c + (y[0] - y) * s


@pytest.mark.parametrize("size", [10.0, 4.0])
@pytest.mark.parametrize(("coefficient", "acceleration"), [(0.2, 3.204763), (0.3, 2.355483)])
def test_a_block_on_a_slope_of_thirty_degrees_accelerates(coefficient, acceleration, size, verified):
    """g (sin - mu cos). The friction of the contact is mu times its force also where only some points of an element press,
    as the friction tilts the block: what the element loses would show in proportion to its size."""
    time, way = sliding(30, coefficient, time=0.1, size=size)
    ours = np.diff(np.diff(way) / np.diff(time))[-1] / (time[-1] - time[-2]) / 1e3
    verified("7", f"incline of 30 degrees, coefficient {coefficient}, elements of {size:g} mm", ours, acceleration,
             within=1e-3, unit="m/s²")


def test_a_block_that_is_pushed_off_on_the_level_comes_to_rest(verified):
    """From 1 m/s with the coefficient 0.2: v²/(2 mu g) in v/(mu g); then it holds."""
    time, way = sliding(0, 0.2, time=0.6, steps=120, speed=1000.0)
    verified("7", "way to rest from 1 m/s, coefficient 0.2", way[-1], 254.929, within=0.01, unit="mm")
    stopped = time[np.flatnonzero(np.diff(way) > 1e-2 * way[-1] / 120)[-1] + 1]
    verified("7", "time to rest from 1 m/s, coefficient 0.2", stopped, 0.509858, within=0.01, unit="s")
