"""A bar is dropped into a groove, finds its place by its own weight, and is pressed there.

At first nothing touches the bar, 3 mm beside the middle of the groove: it falls, lands on one flank, slides down, meets the
other and comes to rest between both. Only then the punch comes down and presses it into the groove, with forces of 100 000
times its weight. All in one run: inertia keeps the free bar from being moved without resistance.

    python3 demos/drop_and_rest.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fenics_forming as ff
from demos.comparison import Compared, compare
from fenics_forming.results import Progress

SCENE = Path(__file__).parent / "scenes" / "drop_and_rest.toml"
RADIUS, HALF_ANGLE = 10.0, np.radians(50)       # of the bar, mm; of the groove
WEIGHT = 7.85e-9 * np.pi * RADIUS**2 * 9806.65      # N/mm
FREE, WAITS = 0.024, 0.16       # s: surely still in the air; when the punch starts
SHOWN = (0.0, 0.04, 0.16, 0.32)


def main(coarse: bool = False, out: str | Path = "results/drop_and_rest", quiet: bool = False) -> ff.Results:
    """Drop and press the bar, compare, draw.

    Parameters
    ----------
    coarse : larger elements, and twice the tolerance where they matter
    out : folder for the results
    quiet : print nothing
    """
    scene = ff.read_scene(SCENE, set=["workpieces.bar.mesh_size='3 mm'"] if coarse else [])
    with Progress(total=scene.stop.time, quiet=quiet) as progress:
        results = ff.simulate(scene, out, observer=progress)
    picture(results, Path(out) / "drop_and_rest.png")
    compare(compared(results, slack=2.0 if coarse else 1.0), quiet=quiet)
    return results


def compared(results: ff.Results, slack: float) -> list[Compared]:
    """Ours beside what must be."""
    time, x, y = (results.history.column(name) for name in ("time_s", "centre_x_mm", "centre_y_mm"))
    free, resting = np.argmin(np.abs(time - FREE)), np.argmin(np.abs(time - WAITS))
    ledger = results.summary["ledger"]
    die, punch = (results.history.column(f"force_{tool}_N_per_mm") for tool in ("die", "punch"))
    lying = (time > WAITS - 0.05) & (time < WAITS)
    return [
        Compared("fall in the first 24 ms, mm", y[0] - y[free], 0.5 * 9806.65 * time[free] ** 2, 1e-9, "Galilei"),
        Compared("way to the middle of the groove, mm", x[0] - x[resting], 3.0, 0.02 * slack, "geometry"),
        Compared("height of the centre at rest, mm", y[resting], RADIUS / np.sin(HALF_ANGLE), 0.005 * slack, "geometry"),
        Compared("force of the die meanwhile, N/mm", die[lying].mean(), WEIGHT, 0.05 * slack, "weight"),
        Compared("strain by falling and lying", results.history.column("max_effective_strain")[resting], 0, 1e-4,
                 "it is hard", relative=False),
        Compared("force of die less punch at the end, N/mm", die[-1] - punch[-1], WEIGHT, 0.1 * slack, "weight",
                 relative=False),
        Compared("energy imbalance at worst, %", 100 * ledger["energy"]["worst_relative_imbalance"], 0, 1.0, "first law",
                 relative=False),
    ]


def picture(results: ff.Results, path: Path) -> None:
    """The bar at four times, its way and its kinetic energy, and the forces."""
    figure, axes = plt.subplots(1, 7, figsize=(16.5, 3.8), width_ratios=[1, 1, 1, 1, 0.45, 1.2, 1.2], layout="constrained")
    *shapes, between, way, force = axes
    between.set_axis_off()         # room for the scale of colours
    times = np.array([time for time, _ in results.frames])
    for ax, shown in zip(shapes, SHOWN, strict=True):
        frame = int(np.argmin(np.abs(times - shown)))
        ff.plot_fields(results, "effective_strain", frame, ax=ax, mesh=False, limits=(0, 1), view=((-15, -1), (15, 36)))
        ax.set_title(f"{1e3 * times[frame]:.0f} ms", fontsize="medium")
        if ax is not shapes[0]:
            ax.set_ylabel("")
        if ax is not shapes[-1]:
            figure.axes[-1].remove()        # one scale of colours is enough
    time = 1e3 * results.history.column("time_s")
    height = results.history.column("centre_y_mm")
    way.plot(results.history.column("centre_x_mm"), height, ".-", markersize=4, linewidth=0.8)
    way.plot(0, RADIUS / np.sin(HALF_ANGLE), "ks", markerfacecolor="none", label="place of rest")
    way.set(xlabel="x of the centre (mm)", ylabel="y of the centre (mm)", title="way of the bar")
    way.legend(frameon=False, fontsize="small")
    for tool in ("die", "punch"):
        values = results.history.column(f"force_{tool}_N_per_mm")
        force.semilogy(time, np.where(values > 1e-4, values, np.nan), label=tool)
    force.axhline(WEIGHT, color="0.4", linewidth=0.8, linestyle=":", label="weight of the bar")
    force.set(xlabel="time (ms)", ylabel="force (N/mm)", title="forces")
    force.legend(frameon=False, fontsize="small")
    for ax in (way, force):
        ax.grid(True, linewidth=0.5, alpha=0.4)
    figure.savefig(path, dpi=85)
    plt.close(figure)


if __name__ == "__main__":
    main()
