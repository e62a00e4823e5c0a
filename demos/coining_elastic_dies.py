r"""A thin strip, as for a blade, is coined from 2.2 mm to 1.72 mm between flat dies: what it gets is thicker, and not flat.

The pressure rises from the edges of the strip to its middle, a friction hill, and dents the dies. So the strip is thicker
than the press was set to, and thickest in its middle. How much of that a run shows depends on the mode of coupling:

- ``stress_only``: nothing; the strip has the thickness that the press was set to. The dies' stresses are still there.
- ``separate``: after every step the surface of the strip is put onto the deformed dies. That makes volume: here a fifth.
- ``coupled``: the dies go on with their last velocity of deformation; guarded, since while the dies are loaded that is
  not stable.
- ``iterated``: the dies deform within every velocity solve. The default.

The reference is the slab equation :math:`dp/dx=-2mk/h`, p = 2k at the edge, between elastic half-planes (Flamant), solved
for the width and the edge thickness of each run.

    python3 demos/coining_elastic_dies.py
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fenics_forming as ff
from demos.comparison import Compared, compare
from fenics_forming.results import Progress
from fenics_forming.results.surface import contact_pressure

SCENE = Path(__file__).parent / "scenes" / "coining_elastic_dies.toml"
MODES = ("stress_only", "separate", "coupled", "iterated")
FLOW_STRESS, FRICTION, YOUNG, POISSON = 200.0, 0.2, 210e3, 0.3      # MPa; of die steel
SET = 2 * (1.1 - 0.24)                                              # mm, the thickness that the press is set to


def main(coarse: bool = False, out: str | Path = "results/coining_elastic_dies",
         quiet: bool = False) -> dict[str, ff.Results]:
    """Coin the strip in every mode, compare, draw.

    Parameters
    ----------
    coarse : larger elements and steps
    out : folder for the results
    quiet : print nothing

    Returns
    -------
    Results by mode.
    """
    changes = ["workpieces.strip.mesh_size=0.4", "tools.upper.mesh_size.contact=0.8", "steps.stroke=0.02"] if coarse else []
    runs, strips = {}, {}
    for mode in MODES:
        scene = ff.read_scene(SCENE, set=[*changes, f"process.tool_deformation={mode}"])
        with Progress(total=scene.stop.stroke, quiet=quiet) as progress:
            runs[mode] = ff.simulate(scene, Path(out) / mode, observer=progress)
        strips[mode] = Strip.of(runs[mode])
    picture(runs, strips, Path(out) / "coining_elastic_dies.png")
    compare(compared(strips, coarse), quiet=quiet)
    return runs


# ---------------------------------------------------------------------- the strip as it came out
@dataclass(frozen=True)
class Strip:
    """The upper surface of the strip from its middle to where it leaves the die.

    x, thickness : (n,) mm · pressure : (n,) MPa · force : N/mm, on the whole strip · volume_error : relative
    """

    x: np.ndarray
    thickness: np.ndarray
    pressure: np.ndarray
    force: float
    volume_error: float

    @classmethod
    def of(cls, results: ff.Results) -> Strip:
        """From the last frame and row of a run; the edge is where the pressure begins to fall to nothing."""
        (curve,), end = contact_pressure(results), results.history.rows[-1]
        on = curve.values > 0.8 * 2 * FLOW_STRESS / np.sqrt(3)
        order = np.argsort(curve.points[on, 0])
        x, y = curve.points[on][order].T
        return cls(x, 2 * y, curve.values[on][order], end["force_upper_N_per_mm"], end["volume_error_strip"])

    @property
    def crown(self) -> float:
        """Thickness in the middle minus that at the edge, mm."""
        return float(self.thickness[0] - self.thickness[-1])


def slab(strip: Strip, elastic: bool = True, points: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places, mm, thickness, mm, and pressure, MPa, of the slab with the width and the edge thickness of a strip."""
    x = np.linspace(0.0, strip.x[-1], points + 1)
    k, step = FLOW_STRESS / np.sqrt(3), x[1]

    def integral(from_, to):        # of ln|x - s| over pieces with constant pressure
        part = lambda t: t * np.log(np.abs(t) + 1e-300) - t  # noqa: E731
        return part(x[:, None] - from_) - part(x[:, None] - to)

    dent = -2 * (1 - POISSON**2) / (np.pi * YOUNG) * (integral(x[:-1], x[1:]) + integral(-x[1:], -x[:-1]))
    h = np.full(points + 1, strip.thickness[-1])
    for _ in range(60 if elastic else 1):
        slope = 2 * FRICTION * k / h
        p = 2 * k + np.append(np.cumsum((0.5 * (slope[1:] + slope[:-1]) * step)[::-1])[::-1], 0.0)
        if elastic:
            u = dent @ (0.5 * (p[1:] + p[:-1]))
            h = 0.5 * h + 0.5 * (strip.thickness[-1] + 2 * (u - u[-1]))
    return x, h, p


def compared(strips: dict[str, Strip], coarse: bool) -> list[Compared]:
    """Crowns and forces of every mode against the slab of its own width and edge."""
    rows, source = [], "slab between half-planes"
    for mode, strip in strips.items():
        x, h, p = slab(strip, elastic=mode != "stress_only")
        force = 2 * np.trapezoid(p, x)
        rows.append(Compared(f"{mode}: force, N/mm", strip.force, force, 0.05, source))
        if mode == "stress_only":
            rows.append(Compared("stress_only: thickness, mm", strip.thickness.mean(), SET, 1e-3, "setting of the press"))
        else:
            rows.append(Compared(f"{mode}: crown, mm", strip.crown, h[0] - h[-1], 0.1 if coarse else 0.05, source))
    last = strips["iterated"]
    rows.append(Compared("coupled: edge thickness, mm", strips["coupled"].thickness[-1], last.thickness[-1], 5e-3,
                         "iterated"))
    rows.append(Compared("iterated: volume, relative", 1 + last.volume_error, 1.0, 1e-3, "incompressible"))
    rows.append(Compared("separate: volume made", strips["separate"].volume_error, 0.185, 0.1,
                         "prototype, notes/coupling.md 1"))
    return rows


# ---------------------------------------------------------------------- picture
def picture(runs: dict[str, ff.Results], strips: dict[str, Strip], path: Path) -> None:
    """Thickness in every mode, pressure on the die, and what the die bears."""
    figure, axes = plt.subplots(1, 3, figsize=(15.5, 4.6), layout="constrained", width_ratios=[1.15, 1, 1.1])
    x, h, p = slab(strips["iterated"])
    styles = {"separate": ("-.", "C3"), "iterated": ("-", "C0"), "coupled": ("--", "C1"), "stress_only": (":", "0.45")}
    for mode, (line, colour) in styles.items():
        axes[0].plot(strips[mode].x, strips[mode].thickness, line, color=colour, lw=1.8, label=mode.replace("_", " "))
    axes[0].plot(x, h, color="k", lw=0.9, dashes=(1, 2), label="slab theory")
    axes[0].set(xlabel="from the middle of the strip (mm)", ylabel="thickness (mm)", xlim=(0, None),
                title="what the strip gets")
    axes[0].legend(frameon=False, fontsize="small", loc="center left")
    axes[1].plot(strips["iterated"].x, strips["iterated"].pressure, color="C0", lw=1.8, label="iterated")
    axes[1].plot(x, p, color="k", lw=0.9, dashes=(1, 2), label="slab theory")
    axes[1].set(xlabel="from the middle of the strip (mm)", ylabel="pressure (MPa)", xlim=(0, None), ylim=(0, None),
                title="friction hill")
    axes[1].legend(frameon=False, fontsize="small")
    ff.plot_fields(runs["iterated"], "von_mises", tool="upper", ax=axes[2], mesh=False)
    axes[2].set(xlim=(-32, 32), ylim=(3, 42), title="stress in the upper die, its dent magnified")
    figure.savefig(path, dpi=85, bbox_inches="tight", pad_inches=0.1)
    plt.close(figure)


if __name__ == "__main__":
    main()
