"""A copper rod hits a rigid wall at 227 m/s: Taylor's test, the benchmark of impact codes.

Nothing drives the rod but its own inertia. Its foot spreads on the smooth wall, mesh after mesh, until the 240 J that it
came with are plastic work; the tail has hardly been touched. The reference is an explicit elastic-plastic computation
(REFERENCES.md 8.4). Ours has no elasticity: the rod slows down from the first instant on, where the real one has to wait
for a wave that takes 9 µs to its tail, and 3 % of the energy go in the instant in which an incompressible rod meets the
wall.

    python3 demos/taylor_impact.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fenics_forming as ff
from demos.comparison import Compared, compare
from fenics_forming.results import Progress

SCENE = Path(__file__).parent / "scenes" / "taylor_impact.toml"
LENGTHS = [30.14, 28.08, 26.22, 24.60, 23.27, 22.27, 21.64, 21.466]      # mm, after every 10 µs
FOOT, ENERGY = 7.341, 239810      # greatest radius, mm; kinetic energy at the start, mJ
SHOWN = (0.0, 20e-6, 40e-6, 80e-6)


def main(coarse: bool = False, out: str | Path = "results/taylor_impact", quiet: bool = False) -> ff.Results:
    """Let the rod fly, compare, draw.

    Parameters
    ----------
    coarse : larger elements and steps
    out : folder for the results
    quiet : print nothing
    """
    changes = ["workpieces.rod.mesh_size='1 mm'", "steps.time='1 us'", "output.fields_every=10"] if coarse else []
    scene = ff.read_scene(SCENE, set=changes)
    with Progress(total=scene.stop.time, quiet=quiet) as progress:
        results = ff.simulate(scene, out, observer=progress)
    picture(results, Path(out) / "taylor_impact.png")
    compare(compared(results), quiet=quiet)
    return results


def compared(results: ff.Results) -> list[Compared]:
    """Ours beside the references."""
    extents = results.summary["extents_mm"]["rod"]
    energy = results.summary["ledger"]["energy"]["mJ"]
    left_over = energy["start"] - energy["plastic"] - energy["first impact"]
    return [
        Compared("length at the end, mm", float(np.ptp(extents["z"])), LENGTHS[-1], 0.01, "explicit, elastic-plastic"),
        Compared("radius of the foot, mm", extents["r"][1], FOOT, 0.03, "explicit, elastic-plastic"),
        *(Compared(f"length after {10 * k} µs, mm", length_at(results, k * 1e-5), LENGTHS[k - 1], 0.015, "explicit")
          for k in (2, 4, 6)),
        Compared("kinetic energy at the start, J", energy["start"] / 1e3, ENERGY / 1e3, 1e-3, "mass and speed"),
        Compared("energy taken by neither metal nor impact, %", 100 * left_over / energy["start"], 0, 1.0, "first law",
                 relative=False),
        Compared("momentum that the wall does not account for, %",
                 100 * results.summary["ledger"]["momentum_Ns"]["z"]["relative_error"], 0, 0.2, "Newton", relative=False),
    ]


def length_at(results: ff.Results, time: float) -> float:
    """Distance of the tail from the wall, mm."""
    return float(np.interp(time, results.history.column("time_s"), results.history.column("tail_z_mm")))


def picture(results: ff.Results, path: Path) -> None:
    """The rod at four times with its strain, its length, and what is left of its energy and momentum."""
    figure, axes = plt.subplots(1, 7, figsize=(15, 4.2), width_ratios=[1, 1, 1, 1, 0.45, 1.9, 1.9], layout="constrained")
    *shapes, between, length, energy = axes
    between.set_axis_off()         # room for the scale of colours
    times = np.array([time for time, _ in results.frames])
    view = ((-8.0, -0.8), (8.0, 33.5))
    for ax, shown in zip(shapes, SHOWN, strict=True):
        frame = int(np.argmin(np.abs(times - shown)))
        ff.plot_fields(results, "effective_strain", frame, ax=ax, mesh=False, limits=(0, 2.5), view=view)
        ax.set_title(f"{1e6 * times[frame]:.0f} µs", fontsize="medium")
        if ax is not shapes[0]:
            ax.set_ylabel("")
        if ax is not shapes[-1]:
            figure.axes[-1].remove()        # one scale of colours is enough
    microseconds = 1e6 * results.history.column("time_s")
    length.plot(microseconds, results.history.column("tail_z_mm"), label="this run, rigid-plastic")
    length.plot(10 * np.arange(1, 9), LENGTHS, "ks", markerfacecolor="none", label="explicit, elastic-plastic")
    length.set(xlabel="time (µs)", ylabel="length of the rod (mm)", ylim=(20, 33))
    for name, unit in (("kinetic_energy_mJ", "kinetic energy"), ("momentum_z_Ns", "momentum")):
        values = results.history.column(name)
        at_start = ENERGY if unit == "kinetic energy" else -2 * ENERGY / 227e3
        energy.plot(microseconds, values / at_start, label=unit)
    energy.set(xlabel="time (µs)", ylabel="share of that of the flying rod", ylim=(0, 1.02))
    for ax in (length, energy):
        ax.set_xlim(0, 80)
        ax.grid(True, linewidth=0.5, alpha=0.4)
        ax.legend(frameon=False, fontsize="small")
    figure.savefig(path, dpi=85)
    plt.close(figure)


if __name__ == "__main__":
    main()
