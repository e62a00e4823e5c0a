"""Discrete laws of the time schemes (REFERENCES 2) on real meshes that flow by a given velocity field.

Everything between the field and the moved mesh is the package's own: sub-steps interpolate in the frozen mesh, spins and
gradients are recovered from nodal velocities. What needs a solve is in tests/unit/test_shifting.py.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from demos import ring_rolling_rotation
from fenics_forming import meshing
from fenics_forming.physics.nodes import Nodes
from fenics_forming.process.integration import Etd2, Explicit, Midpoint, Rotation, Trapezoid
from fenics_forming.process.meshes.transfer import integral
from fenics_forming.process.prescribed import PrescribedFlow, carry
from fenics_forming.process.substeps import Substeps

from .shapes import ring_sector

QUARTER_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


def converged(rotation=False):
    return Trapezoid(passes=100, tolerance=1e-15, rotation=rotation)


# ---------------------------------------------------------------------- 2.1 volume drift
def under_a_platen(kind):
    """A body 20 mm high that is compressed at 1 mm/s by the homogeneous field; what lay on the platen stays on it."""
    nodes = Nodes(meshing.box((0, 0, 0), (10, 10, 20), (1, 1, 2)) if kind == "3d" else
                  meshing.rectangle((0, 0), (10, 20), (2, 3)))
    top = np.isclose(nodes.x[:, -1], 20)
    share = 1.0 if kind == "plane_strain" else 0.5

    def velocity(x, time):
        v = share * x / (20 - time)
        v[:, -1] = -x[:, -1] / (20 - time)
        return v

    def follow(x, time):
        x[top, -1] = 20 - time

    return PrescribedFlow(nodes, velocity, kinematics=kind, follow=follow)


def volume(body):
    whole = SimpleNamespace(x=body.x, cells=body.nodes.cells)
    return integral(whole, np.ones(len(body.x)), axisymmetric=body.kinematics.name == "axisymmetric")


def ratios(scheme, steps, kind, travel=10.0):
    """Volume over that of the start after each step."""
    body, volumes = under_a_platen(kind), []
    start = volume(body)
    carry(body, scheme, travel, steps, after=lambda time: volumes.append(volume(body) / start))
    return np.array(volumes)


def law(growth, steps, kind, travel=10.0):
    """Volume ratios where a lateral length grows by ``growth``(rate dt of the lateral direction at start, at end)."""
    share, power = (1.0, 1) if kind == "plane_strain" else (0.5, 2)
    h = 20 - travel / steps * np.arange(steps + 1)
    at = share * travel / steps / h
    return np.cumprod(h[1:] / h[:-1] * growth(at[:-1], at[1:]) ** power)


def at_middle(d, e):
    """Lateral rate times dt half-way, where the height is the mean: harmonic mean of the ends."""
    return 2 / (1 / d + 1 / e)


LAWS = {  # scheme, lateral growth in a step
    "explicit": (Explicit, lambda d, e: 1 + d),
    "rotation": (Rotation, lambda d, e: 1 + d + d**2 / 2),
    "midpoint": (Midpoint, lambda d, e: 1 + at_middle(d, e) * (1 + d / 2)),
    "heun": (lambda: Trapezoid(passes=1), lambda d, e: 1 + (d + e * (1 + d)) / 2),
    "trapezoid": (converged, lambda d, e: (1 + d / 2) / (1 - e / 2)),
    "three sub-steps": (lambda: Substeps(3), lambda d, e: (1 + d / 3) ** 3),
    "seven sub-steps": (lambda: Substeps(7), lambda d, e: (1 + d / 7) ** 7),
    "midpoint, rotation": (lambda: Midpoint(rotation=True), lambda d, e: 1 + at_middle(d, e) * (1 + d / 2 + d**2 / 8)),
    "three sub-steps, rotation": (lambda: Substeps(3, rotation=True), lambda d, e: (1 + d / 3 + d**2 / 18) ** 3),
}


@pytest.mark.parametrize("kind", ["axisymmetric", "plane_strain", "3d"])
@pytest.mark.parametrize("name", LAWS)
def test_the_volume_follows_the_discrete_law_of_the_scheme(name, kind):
    """REFERENCES 2.1, in every step: without spin only the lateral growth and the exact place of the platen count."""
    make, growth = LAWS[name]
    assert ratios(make(), 10, kind) == pytest.approx(law(growth, 10, kind), abs=1e-12)


TABLE = {  # change of volume for h 20 to 10, by number of steps
    "explicit": {10: -3.507e-2, 20: -1.813e-2, 50: -7.398e-3, 100: -3.724e-3},
    "trapezoid": {10: 1.172e-3, 20: 2.930e-4, 50: 4.688e-5, 100: 1.172e-5},
    "heun": {10: 4.548e-4, 20: 1.155e-4, 50: 1.864e-5, 100: 4.674e-6},
    "midpoint": {10: -8.955e-4, 20: -2.292e-4, 50: -3.717e-5, 100: -9.334e-6},
    "three sub-steps": {10: -2.782e-2, 20: -1.424e-2, 50: -5.778e-3},
}
ORDER = {"explicit": 1, "three sub-steps": 1}


@pytest.mark.parametrize("name", TABLE)
def test_the_volume_drift_of_a_whole_stroke_is_that_of_the_table(name, verified):
    found = {steps: ratios(LAWS[name][0](), steps, "axisymmetric")[-1] - 1 for steps in TABLE[name]}
    # four digits are given
    verified("2.1", f"volume drift, {name}", found.values(), TABLE[name].values(), within=4.5e-4,
             at=[f"{steps} steps" for steps in found])
    assert np.log2(found[10] / found[20]) == pytest.approx(ORDER.get(name, 2), abs=0.06)


def test_the_volume_drift_of_larger_strokes_and_of_plane_strain_is_that_of_the_table():
    assert ratios(Explicit(), 20, "axisymmetric", 14.0)[-1] - 1 == pytest.approx(-5.663e-2, abs=1e-5)
    assert ratios(Explicit(), 100, "axisymmetric", 14.0)[-1] - 1 == pytest.approx(-1.205e-2, abs=1e-5)
    assert ratios(converged(), 20, "axisymmetric", 14.0)[-1] - 1 == pytest.approx(1.937e-3, abs=1e-6)
    assert ratios(Explicit(), 50, "plane_strain")[-1] - 1 == pytest.approx(-9.804e-3, abs=1e-6)
    assert ratios(Explicit(), 100, "plane_strain")[-1] - 1 == pytest.approx(-4.950e-3, abs=1e-6)


@pytest.mark.parametrize("make", [Etd2, lambda: Substeps(1, "midpoint"), lambda: Substeps(2, "midpoint")],
                         ids=["etd2", "one midpoint sub-step", "two midpoint sub-steps"])
def test_the_unsteady_term_makes_one_solve_a_step_second_order(make):
    drift = [ratios(make(), steps, "axisymmetric")[-1] - 1 for steps in (10, 20, 40)]
    assert np.log2(np.divide(drift[:-1], drift[1:])) == pytest.approx(2, abs=0.15)
    assert abs(drift[1]) < 0.1 * abs(TABLE["explicit"][20])


# ---------------------------------------------------------------------- 2.2 stagnation flow
def stagnation():
    nodes = Nodes(meshing.rectangle((0.5, 0.5), (1.5, 1.5), (2, 2)))
    return PrescribedFlow(nodes, lambda x, time: x * [1.0, -1.0])


@pytest.mark.parametrize(("steps", "count", "drift"), [
    (10, 1, -0.095618), (10, 2, -0.048830), (10, 3, -0.032802), (10, 10, -0.009951), (20, 1, -0.048830),
    (20, 3, -0.016531)])
def test_sub_steps_drift_off_the_streamlines_of_a_stagnation_flow_by_their_law(steps, count, drift, verified):
    """REFERENCES 2.2: psi = x y changes by the factor 1 - h² a sub-step, at every node, in the mesh and beyond it."""
    body = stagnation()
    before = body.x.prod(axis=1)
    carry(body, Substeps(count), 1.0, steps)
    ratio = body.x.prod(axis=1) / before
    assert ratio == pytest.approx((1 - 1 / (steps * count) ** 2) ** (steps * count), abs=1e-12)
    verified("2.2", f"drift of the stream function, {steps} steps of {count}", ratio.max() - 1, drift, within=5e-7,
             absolute=True)      # digits of the table
    assert np.ptp(ratio) < 1e-12


def test_midpoint_sub_steps_follow_a_stagnation_flow_with_their_own_law():
    """1 ± h + h²/2 a sub-step; the field is steady, so the unsteady term is nothing but rounding."""
    body = stagnation()
    before = body.x.copy()
    carry(body, Substeps(4, "midpoint"), 1.0, 5)
    h = 1 / 20
    assert body.x / before == pytest.approx(np.tile([(1 + h + h**2 / 2) ** 20, (1 - h + h**2 / 2) ** 20], (len(before), 1)),
                                            abs=1e-11)


# ---------------------------------------------------------------------- 2.3 extrusion
def half_gap(x):
    """Height of the channel, and its slope: from 1 to 1/2 between x = 0 and 2."""
    s = np.clip(x / 2, 0, 1)
    return 1 - 0.5 * (3 * s**2 - 2 * s**3), -0.25 * (6 * s - 6 * s**2)


def extruded(scheme, steps, size=0.025):
    """Place x and stream function U y/H at the end, less that of the start, of the node that starts at (-0.2, 0.8).

    A strip of the billet around it, in order-2 cells of the given size, moves with it into the die.
    """
    nodes = Nodes(meshing.rectangle((-0.6, 0.6), (0.4, 1), (round(1 / size), round(0.4 / size))))
    nodes.x[:, 1] *= half_gap(nodes.x[:, 0])[0]
    follow = np.argmin(np.linalg.norm(nodes.x - [-0.2, 0.8], axis=1))
    assert nodes.x[follow] == pytest.approx([-0.2, 0.8])

    def velocity(x, time):
        H, slope = half_gap(x[:, 0])
        return np.column_stack([1 / H, x[:, 1] * slope / H**2])

    carry(PrescribedFlow(nodes, velocity), scheme, 1.8, steps)
    x, y = nodes.x[follow]
    return x, y / half_gap(x)[0] - 0.8


@pytest.mark.parametrize(("steps", "count", "error"), [
    (10, 1, -0.062112), (10, 2, -0.031323), (10, 3, -0.021092), (10, 10, -0.006140),
    (20, 1, -0.031323), (20, 2, -0.015197), (20, 3, -0.009948),
    (40, 1, -0.015197), (40, 3, -0.005152)])
def test_sub_steps_divide_the_error_of_the_explicit_shift_through_a_die(steps, count, error, verified):
    """REFERENCES 2.3. One sub-step is exact to the digits; in the frozen field the interpolation in cells that the flow
    has sheared adds up to 1e-4 (measured: 8e-5)."""
    x, found = extruded(Substeps(count), steps, 0.05 if count in (1, 10) else 0.025)
    verified("2.3", f"change of the stream function, {steps} steps of {count}", found, error,
             within=6e-7 if count == 1 else 1e-4, absolute=True)


def test_midpoint_sub_steps_and_etd2_pass_the_die_far_more_exactly():
    for scheme, better in ((Substeps(3, "midpoint"), 100), (Substeps(1, "midpoint"), 4), (Etd2(), 10)):
        x, found = extruded(scheme, 20)
        assert abs(found) < 0.009948 / better          # against three plain sub-steps
        assert x == pytest.approx(2.2, abs=2e-3)       # the exact arrival


# ---------------------------------------------------------------------- 2.4 rotation
SAFE = {"rotation": Rotation, "etd2": Etd2, "midpoint": lambda: Midpoint(rotation=True),
        "trapezoid": lambda: converged(True), "plain sub-steps": lambda: Substeps(3, rotation=True),
        "midpoint sub-steps": lambda: Substeps(3, "midpoint", rotation=True)}


def ring(divisions=(2, 4)):
    return Nodes(ring_sector(50.0, 100.0, *divisions))


def spinning(nodes, angle, steps, scheme, *, stretch=0.0):
    """Radii over those of the start after a turn by ``angle`` in a second; a uniform stretch on top."""
    start = np.linalg.norm(nodes.x, axis=1)
    carry(PrescribedFlow(nodes, lambda x, time: angle * x @ QUARTER_TURN.T + stretch * x), scheme, 1.0, steps)
    return np.linalg.norm(nodes.x, axis=1) / start


@pytest.mark.parametrize(("degrees", "count", "growth"), [
    (1, None, 1.056353), (2, None, 1.115827), (5, None, 1.314054), (10, None, 1.716223),
    (2, 3, 1.037228), (5, 3, 1.095649), (10, 3, 1.200168)])
def test_explicit_shift_blows_up_a_spinning_ring_and_sub_steps_only_divide_that(degrees, count, growth, verified):
    """REFERENCES 2.4, per revolution: the root of 1 + angle² a sub-step."""
    scheme = Explicit() if count is None else Substeps(count)
    found = spinning(ring(), 2 * np.pi, 360 // degrees, scheme)
    assert np.ptp(found) < 1e-9
    verified("2.4", f"explicit growth of a ring, {degrees}° a step{f', {count} sub-steps' if count else ''}", found.mean(),
             growth, within=6e-7, absolute=True)


@pytest.mark.parametrize("name", SAFE)
def test_ten_revolutions_of_five_degrees_a_step_leave_the_ring_as_it_is(name, verified):
    """REFERENCES 2.4: rigid rotation is exact; 720 steps of rounding (of sub-steps 72, each as exact as any other)."""
    turns = 1 if "sub-steps" in name else 10
    found = spinning(ring(), turns * 2 * np.pi, turns * 72, SAFE[name]())
    verified("2.4", f"rigid rotation, revolutions: {turns}, {name}", found[np.abs(found - 1).argmax()], 1.0, within=1e-12,
             absolute=True)


@pytest.mark.parametrize("name", ["rotation", "midpoint", "midpoint sub-steps"])
@pytest.mark.parametrize("degrees", [30, 90, 179])
def test_the_angle_of_a_step_does_not_matter(name, degrees):
    nodes = ring()
    before = nodes.x.copy()
    assert spinning(nodes, np.deg2rad(degrees), 1, SAFE[name]()) == pytest.approx(1.0, abs=1e-13)
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    assert nodes.x == pytest.approx(before @ [[c, s], [-s, c]], abs=1e-10)


@pytest.mark.parametrize("name", SAFE)
def test_a_block_in_space_turns_about_any_axis_and_flies_along_it(name):
    """A screw motion: the part of the velocity along the axis is not bent."""
    nodes = Nodes(meshing.box((0, 0, 0), (2, 3, 4), (1, 1, 2)))
    axis, start = np.array([0.6, 0.0, 0.8]), nodes.x.copy()
    carry(PrescribedFlow(nodes, lambda x, time: np.cross(axis, x) + 2 * axis), SAFE[name](), np.pi, 12)
    along = np.outer(start @ axis, axis)
    assert nodes.x == pytest.approx(2 * along - start + 2 * np.pi * axis, abs=1e-11)     # half a turn


@pytest.mark.parametrize("name", SAFE)
def test_a_spinning_body_is_stretched_as_if_it_stood_still(name):
    """REFERENCES 2.4: radii exp(e t) to the second order in e dt whatever the spin, here none or five revolutions."""
    growth, errors = np.exp(0.3), []
    for steps in (24, 48):
        still, turning = (spinning(ring(), angle, steps, SAFE[name](), stretch=0.3) for angle in (0.0, 4 * np.pi))
        # (e dt)² angle²/24 of a step, summed up: at the coarser step 0.3 x 0.3/24 x 0.52² / 24 = 4e-5
        assert turning == pytest.approx(still, abs=6e-5)
        errors.append(np.abs(still / growth - 1).max())
    assert name == "etd2" or np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.05)
    assert errors[0] < 2e-5


@pytest.mark.parametrize("name", SAFE)
def test_a_spinning_ring_grows_inwards_by_volume(name):
    """REFERENCES 2.4: v_r = -c/r over a revolution gives r² = r0² - 2 c T, at the bore 17 % less than r0."""
    c = 400.0

    def error(steps, divisions=(3, 8)):
        nodes = ring(divisions)
        start = np.linalg.norm(nodes.x, axis=1)
        body = PrescribedFlow(nodes, lambda x, time: 2 * np.pi * x @ QUARTER_TURN.T - c * x / (x**2).sum(1, keepdims=True))
        carry(body, SAFE[name](), 1.0, steps)
        return np.abs(np.linalg.norm(nodes.x, axis=1) / np.sqrt(start**2 - 2 * c) - 1).max()

    coarse, fine = error(36), error(72)
    assert fine < 1.5e-3
    if name == "rotation":      # so exact that the error of the recovered gradient is left, of second order in the cells
        assert error(36, (6, 16)) < 0.35 * coarse < 5e-4
    else:
        assert np.log2(coarse / fine) > 1.7, (coarse, fine)


# ---------------------------------------------------------------------- observed orders
def swirl(x, time):
    """An unsteady vortex with a sink: neither steady, nor linear, nor rigid."""
    return (2 + 3 * time) * x @ QUARTER_TURN.T - 0.4 * (1 + time) * x / (x**2).sum(axis=1, keepdims=True)


def swirled(x, time):
    """Where the points x of time 0 are."""
    radius = np.sqrt((x**2).sum(axis=1) - 0.8 * (time + time**2 / 2))
    angle = np.arctan2(x[:, 1], x[:, 0]) + 2 * time + 1.5 * time**2
    return radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


ORDERS = {"explicit": (Explicit, 1), "rotation": (Rotation, 1), "plain sub-steps": (lambda: Substeps(3), 1),
          "plain sub-steps, rotation": (lambda: Substeps(3, rotation=True), 1),
          "etd2": (Etd2, 2), "midpoint": (Midpoint, 2), "trapezoid": (converged, 2),
          "midpoint, rotation": (lambda: Midpoint(rotation=True), 2), "trapezoid, rotation": (lambda: converged(True), 2),
          "midpoint sub-steps": (lambda: Substeps(3, "midpoint"), 2),
          "midpoint sub-steps, rotation": (lambda: Substeps(3, "midpoint", rotation=True), 2)}


@pytest.mark.parametrize("name", ORDERS)
def test_the_order_of_a_scheme_in_an_unsteady_vortex(name):
    make, order = ORDERS[name]
    errors = []
    for steps in (20, 40):
        nodes = Nodes(ring_sector(1.0, 2.0, 4, 8))
        exact = swirled(nodes.x, 0.5)
        carry(PrescribedFlow(nodes, swirl), make(), 0.5, steps)
        errors.append(np.abs(nodes.x - exact).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1), errors


@pytest.mark.parametrize("name", ORDERS)
def test_the_strain_gathers_with_the_order_of_the_scheme(name):
    """ln 2 under the platen, in unsteady flow; explicit sums of the rates at the starts of the steps fall short."""
    make, order = ORDERS[name]
    errors = []
    for steps in (20, 40):
        strain = carry(under_a_platen("axisymmetric"), make(), 10.0, steps)["effective_strain"]
        assert np.ptp(strain) < 1e-12
        errors.append(strain[0] - np.log(2))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.15), errors


def test_a_rolled_ring_grows_by_its_volume(verified):
    """REFERENCES.md 12.3, over six revolutions in steps of 5 degrees with the scheme that turns exactly."""
    run = ring_rolling_rotation.roll(ring_rolling_rotation.SCHEMES["rotation"](), 20.0)
    for wall, diameters in ring_rolling_rotation.WALLS.items():
        verified("12.3", f"ring at a wall of {wall:g} mm", run.at_wall(wall), diameters, within=5e-3, unit="mm",
                 at=("outer diameter", "inner diameter"))
