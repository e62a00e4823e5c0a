r"""A strip of 2 mm is rolled to 1.6 mm between driven rolls of 200 mm diameter: force, torque and the neutral point.

At the entry the rolls are faster than the strip and drag it in, at the exit the strip is faster; in between, at the neutral
point, friction turns round. The strip starts in the shape that it has in steady rolling; a plate behind it starts it off
and is left behind as soon as the rolls draw.

The reference is the slab solution of von Kármán with :math:`p=2k+q`, q the mean stress along the strip (compressive),

.. math:: \frac{d(hq)}{d\varphi} = 2Rp\,(\sin\varphi \pm \mu\cos\varphi),\qquad h=h_1+2R(1-\cos\varphi),

+ from the exit, - from the entry, which meet at the neutral point. It leaves the shear inside the strip out, so that the
two differ by several per cent at high friction, where the pressure of the slab has its peak and the strip sticks.

    python3 demos/flat_rolling.py
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fenics_forming as ff
from demos.comparison import Compared, compare
from fenics_forming.results import Progress

RADIUS, ENTRY, EXIT, FLOW_STRESS = 100.0, 2.0, 1.6, 100.0     # mm; MPa
ROLL_SPEED, ENDS = 1.0, 4.0                                   # rad/s; mm of strip before and behind the rolls
ARC = np.arccos(1 - (ENTRY - EXIT) / (2 * RADIUS))            # angle of contact, rad
FRICTIONS = (0.05, 0.1, 0.2)


def main(frictions=FRICTIONS, coarse: bool = False, out: str | Path = "results/flat_rolling", quiet: bool = False):
    """Roll a strip for every friction coefficient, compare, draw.

    Parameters
    ----------
    frictions : Coulomb coefficients; above 0.0316, for the rolls to draw the strip at all
    coarse : larger elements, a shorter way
    out : folder for the results
    quiet : print nothing

    Returns
    -------
    Results of the last friction.
    """
    rows, arcs = [], {}
    for friction in frictions:
        scene = rolling(friction, coarse)
        with Progress(total=scene.stop.time, quiet=quiet) as progress:
            results = ff.simulate(scene, Path(out) / f"friction_{friction:g}", observer=progress)
        arcs[friction] = Arc.of(results)
        rows += compared(results, arcs[friction], friction)
    picture(results, arcs, Path(out) / "flat_rolling.png")
    compare(rows, quiet=quiet)
    return results


def rolling(friction: float, coarse: bool = False, *, steps: dict | None = None, **drive) -> ff.Scene:
    """The upper half of a strip that is as long as the gap and a little more.

    steps : instead of 2 ms · drive : keys of the drive of the roll instead of its speed
    """
    centre = [0.0, RADIUS + EXIT / 2]
    return ff.Scene.read({
        "title": f"Flat rolling, friction {friction:g}", "geometry": "plane_strain",
        "materials": {"strip": {"flow_stress": {"law": "constant", "value": FLOW_STRESS}}},
        "workpieces": {"strip": {"shape": {"kind": "polygon", "points": outline()}, "material": "strip", "symmetry": ["y"],
                                 "mesh_size": 0.4 if coarse else 0.2}},
        "tools": {
            "roll": {"shape": {"kind": "circle", "centre": centre, "radius": RADIUS},
                     "drive": {"kind": "roll", "centre": centre, **(drive or {"speed": ROLL_SPEED})},
                     "friction": {"law": "coulomb", "coefficient": friction}},
            "starter": {"shape": {"kind": "plane", "point": [outline()[0][0], 0], "normal": [1, 0]},
                        "drive": {"kind": "speed", "velocity": [0.6 * ROLL_SPEED * RADIUS, 0]}}},
        "steps": steps or {"time": 2e-3, "tool": "starter" if drive else "roll"},
        "stop": {"time": 0.01 if coarse else 0.02}, "output": {"fields_every": 0}})


def outline() -> list[list[float]]:
    """Corners of the upper half, from the back; the arc runs a hair below the roll, which its chords must not cut."""
    angle = np.linspace(ARC, 0.0, 25)
    sagitta = 1.01 * RADIUS * (angle[0] - angle[1]) ** 2 / 8
    arc = np.column_stack([-RADIUS * np.sin(angle), EXIT / 2 + RADIUS * (1 - np.cos(angle)) - sagitta])
    back, front = arc[0, 0] - ENDS, ENDS
    return [[back, 0.0], [front, 0.0], [front, EXIT / 2], *arc[::-1].tolist(), [back, ENTRY / 2]]


@dataclass
class Arc:
    """What happens along the arc of contact: angles before the exit, rad, pressure, MPa, slip of the strip, mm/s."""

    angle: np.ndarray
    pressure: np.ndarray
    slip: np.ndarray

    @classmethod
    def of(cls, results: ff.Results) -> Arc:
        """From the last frame of a run."""
        import pyvista
        frame = pyvista.read(results.frames[-1][1])
        velocity = frame.point_data["velocity_mm_per_s"][:, :2]
        arm = frame.points[:, :2] - [0.0, RADIUS + EXIT / 2]
        distance = np.hypot(*arm.T)
        pressed = (distance < RADIUS + 2e-3) & (frame.point_data["contact_pressure_MPa"] > 0)
        order = np.flatnonzero(pressed)[np.argsort(-arm[pressed, 0])]
        along = np.column_stack([-arm[:, 1], arm[:, 0]]) / distance[:, None]
        slip = np.einsum("ni,ni->n", velocity, along) - ROLL_SPEED * RADIUS
        return cls(np.arctan2(-arm[order, 0], -arm[order, 1]), frame.point_data["contact_pressure_MPa"][order], slip[order])

    @property
    def neutral(self) -> float:
        """Angle at which the strip is as fast as the roll, degrees: faster before the exit, slower before that."""
        first = np.flatnonzero((self.slip[:-1] > 0) & (self.slip[1:] <= 0))[0]
        (a, b), (s, t) = self.angle[first:first + 2], self.slip[first:first + 2]
        return float(np.degrees(a + (b - a) * s / (s - t)))


def slab(friction: float, points: int = 4000) -> tuple[np.ndarray, np.ndarray, int]:
    """Angles (points,), rad, pressures there, MPa, and the number of the neutral one, by the slab equation."""
    angle, shear = np.linspace(0.0, ARC, points), 2 * FLOW_STRESS / np.sqrt(3)
    height = EXIT + 2 * RADIUS * (1 - np.cos(angle))

    def from_end(sign, order):
        force = np.zeros(points)
        for i, j in zip(order[:-1], order[1:], strict=True):        # the midpoint rule along the arc
            step = angle[j] - angle[i]
            middle = 0.5 * (angle[i] + angle[j])
            way = 2 * RADIUS * (np.sin(middle) + sign * friction * np.cos(middle))
            half = force[i] + 0.5 * step * way * (shear + force[i] / height[i])
            force[j] = force[i] + step * way * (shear + 2 * half / (height[i] + height[j]))
        return shear + force / height

    forward, backward = from_end(1, np.arange(points)), from_end(-1, np.arange(points)[::-1])
    return angle, np.minimum(forward, backward), int(np.argmin(np.abs(forward - backward)))


def compared(results: ff.Results, arc: Arc, friction: float) -> list[Compared]:
    """Force of a roll, torque of both, neutral point, from the middle of the run on."""
    angle, pressure, neutral = slab(friction)
    sense = np.where(np.arange(len(angle)) < neutral, -1.0, 1.0)
    force = RADIUS * np.trapezoid(pressure, angle)
    torque = 2 * RADIUS**2 * friction * np.trapezoid(pressure * sense, angle)
    half = len(results.history) // 2
    ours = [results.history.column(name)[half:].mean() for name in ("force_roll_N_per_mm", "torque_roll_Nmm")]
    what = f"friction {friction:g}: "
    return [Compared(what + "force, N/mm", ours[0], force, 0.08, "slab (von Kármán)"),
            Compared(what + "torque of both rolls, N", ours[1], torque, 0.08, "slab (von Kármán)"),
            Compared(what + "neutral angle, degrees", arc.neutral, np.degrees(angle[neutral]), 0.3, "slab (von Kármán)",
                     relative=False)]


def picture(results: ff.Results, arcs: dict[float, Arc], path: Path) -> None:
    """Pressure and slip along the arc of contact, over the strip in the last gap."""
    figure, axes = plt.subplot_mosaic([["pressure", "slip"], ["strip", "strip"]], figsize=(10, 7.2), layout="constrained",
                                      height_ratios=[3, 2.2])
    for k, (friction, arc) in enumerate(arcs.items()):
        angle, pressure, neutral = slab(friction)
        colour = f"C{k}"
        axes["pressure"].plot(np.degrees(angle), pressure, "--", color=colour, lw=1)
        axes["pressure"].plot(np.degrees(arc.angle), arc.pressure, color=colour, label=rf"$\mu$ = {friction:g}")
        axes["slip"].plot(np.degrees(arc.angle), arc.slip, color=colour)
        axes["slip"].axvline(np.degrees(angle[neutral]), color=colour, ls="--", lw=1)
    axes["pressure"].set(xlabel="angle before the exit (°)", ylabel="pressure on the roll (MPa)", ylim=(0, None))
    axes["pressure"].legend(frameon=False, title="dashed: slab theory", fontsize="small", title_fontsize="small")
    axes["slip"].axhline(0, color="0.6", lw=0.8)
    axes["slip"].set(xlabel="angle before the exit (°)", ylabel="strip faster than the roll by (mm/s)")
    for name in ("pressure", "slip"):
        axes[name].set_xlim(np.degrees(ARC) + 0.2, -0.3)      # as the strip runs, from left to right
    ff.plot_fields(results, "mean_stress_MPa", mesh=False, ax=axes["strip"])
    axes["strip"].set_title(rf"$\mu$ = {list(arcs)[-1]:g}: mean stress in the strip", fontsize="medium")
    figure.savefig(path, dpi=85)
    plt.close(figure)


if __name__ == "__main__":
    main()
