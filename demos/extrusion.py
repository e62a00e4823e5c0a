r"""A bar is extruded: a ram pushes a billet of 20 mm diameter through a conical die to half of its cross-section.

The flat end of the billet first fills the cone; then the bar comes out at twice the speed of the ram. From there on the
force falls as the billet, and with it the friction in the container, gets shorter. The mesh is renewed all the way.

The reference is an upper bound: the metal is taken to flow towards the tip of the cone, :math:`v=-A\cos\theta/\rho^2`
between two spheres, and as a rigid body before and behind. What is dissipated inside, where the velocity jumps at the two
spheres, and by friction, needs at least the true force (Avitzur, *Metal Forming: Processes and Analysis*, McGraw-Hill
1968). At the angle of 30° the true flow needs about a tenth less; uniform stretching, a lower bound, a third less.

    python3 demos/extrusion.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fenics_forming as ff
from demos.comparison import Compared, compare
from fenics_forming.results import Progress

SCENE = Path(__file__).parent / "scenes" / "extrusion.toml"
FLOW_STRESS, FRICTION = 100.0, 0.1              # MPa; factor m of the shear yield stress
BILLET, BAR, LENGTH, LAND = 10.0, 7.0711, 30.0, 1.0       # radii, length of the billet and of the land, mm
ANGLE = np.radians(30.0)
STEADY = 9.0       # stroke from which the bar comes out steadily, mm


def main(coarse: bool = False, out: str | Path = "results/extrusion", quiet: bool = False) -> ff.Results:
    """Extrude the bar, compare, draw.

    Parameters
    ----------
    coarse : larger elements and steps, a shorter way
    out : folder for the results
    quiet : print nothing
    """
    changes = ["steps.stroke='0.2 mm'", "stop.stroke='13 mm'", "workpieces.billet.refine=[{kind='box', from=[0, -7], "
               "to=[10, 2], size='1.2 mm'}]"] if coarse else []
    scene = ff.read_scene(SCENE, set=changes)
    with Progress(total=scene.stop.stroke, quiet=quiet) as progress:
        results = ff.simulate(scene, out, observer=progress)
    picture(results, Path(out) / "extrusion.png")
    compare(compared(results, coarse), quiet=quiet)
    return results


def angle_factor(angle: float) -> float:
    r"""f of the bound: the mean of the strain rate in converging flow over that of uniform stretching.

    .. math:: f=\frac{2}{\sin^2\alpha}\int_0^\alpha\sqrt{1-\tfrac{11}{12}\sin^2\theta}\,\sin\theta\,d\theta,
              \qquad\text{in closed form.}
    """
    a, cosine = 11 / 12, np.cos(angle)
    root = np.sqrt(1 - a * np.sin(angle) ** 2)
    logarithm = np.log((1 + np.sqrt(a)) / (np.sqrt(a) * cosine + root)) / np.sqrt(11 * 12)
    return (1 - cosine * root + logarithm) / np.sin(angle) ** 2


def upper_bound(stroke: np.ndarray) -> np.ndarray:
    """Ram force, N: deformation, the jumps at both spheres, friction on cone, land and container."""
    logarithm, shear = np.log(BILLET / BAR), 2 / np.sqrt(3)
    cone = 2 * angle_factor(ANGLE) * logarithm + shear * (
        ANGLE / np.sin(ANGLE) ** 2 - 1 / np.tan(ANGLE) + FRICTION * logarithm / np.tan(ANGLE) + FRICTION * LAND / BAR)
    return np.pi * BILLET**2 * FLOW_STRESS * (cone + shear * FRICTION * (LENGTH - stroke) / BILLET)


def uniform_work(stroke: np.ndarray) -> np.ndarray:
    """Ram force, N, if the metal were only stretched and rubbed nowhere but in the container."""
    work = 2 * np.log(BILLET / BAR) + 2 / np.sqrt(3) * FRICTION * (LENGTH - stroke) / BILLET
    return np.pi * BILLET**2 * FLOW_STRESS * work


def compared(results: ff.Results, coarse: bool) -> list[Compared]:
    """The force between its bounds, its ripple, and where points inside come out."""
    steady = results.stroke() >= STEADY
    stroke, force = results.stroke()[steady], results.force()[steady]
    ratio = force / upper_bound(stroke)
    half = 0.5 * (1 + (uniform_work(stroke) / upper_bound(stroke)).mean())
    last = results.history.rows[-1]
    return [
        Compared("force over the upper bound, mean", ratio.mean(), 1.0, 0.12, "Avitzur, an upper bound"),
        Compared("force over the upper bound, highest", ratio.max(), half, 1 - half, "between both bounds", relative=False),
        Compared("ripple of the force, peak to peak", np.ptp(ratio) / ratio.mean(), 0.0, 0.08 if coarse else 0.05, "steady",
                 relative=False),
        Compared("radius at which a point from r = 5 mm comes out, mm", last["inside_r_mm"], 5 * BAR / BILLET, 0.02,
                 "equal flow within"),
        Compared("volume error", results.history.rows[-1]["volume_error_billet"], 0.0, 1e-9, "constant", relative=False)]


def picture(results: ff.Results, path: Path) -> None:
    """Lines that were a grid in the billet, beside the force over the stroke with its bounds."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.5, 6.4), width_ratios=[1, 1.4], layout="constrained")
    ff.plot_fields(results, None, ax=left)
    left.set_title("what was a grid in the billet", fontsize="medium")
    ff.plot_force_stroke(results, ax=right)
    right.get_lines()[0].set(marker="", label="fenics_forming")
    stroke = np.array([STEADY - 2, results.stroke()[-1]])
    right.plot(stroke, upper_bound(stroke) / 1e3, "C1--", label="upper bound (Avitzur)")
    right.plot(stroke, uniform_work(stroke) / 1e3, "C2:", label="uniform work")
    right.legend(frameon=False, fontsize="small")
    right.set(title="", xlabel="stroke of the ram (mm)", ylabel="force of the ram (kN)", ylim=(0, 50))
    figure.savefig(path, dpi=85)
    plt.close(figure)


if __name__ == "__main__":
    main()
