"""A rivet closes two plates: three bodies, of which no tool touches the plates.

The shank is upset between the anvil and the snap. First it flows freely, then it fills the holes with their clearance of
0.1 mm, at last the end above the plates spreads to a second head that clamps them. Nothing but the rivet holds the plates.

At the start the shank is a cylinder, 8 mm high, on the head; uniform flow with friction at the snap alone gives

    F = pi s R² [ 1 + m R / (3 sqrt(3) h) ] .

    python3 demos/riveting.py
"""

from __future__ import annotations

from math import pi, sqrt
from pathlib import Path

import matplotlib.pyplot as plt

import fenics_forming as ff
from demos.comparison import Compared, compare
from fenics_forming.results import Progress

SCENE = Path(__file__).parent / "scenes" / "riveting.toml"
RADIUS, LENGTH, FRICTION = 3.0, 8.0, 0.2       # of the shank, mm; at the snap
STROKE = 2.2
PAIRS = {"rivet_lower": "rivet on lower plate", "rivet_upper": "rivet on upper plate", "lower_upper": "plate on plate"}


def main(coarse: bool = False, out: str | Path = "results/riveting", quiet: bool = False) -> ff.Results:
    """Close the rivet, compare, draw.

    Parameters
    ----------
    coarse : larger elements and steps
    out : folder for the results
    quiet : print nothing
    """
    sizes = {"rivet": 0.9, "lower": 0.8, "upper": 0.85}
    changes = [f"workpieces.{name}.mesh_size={size}" for name, size in sizes.items()] + ["steps.stroke=0.1"]
    scene = ff.read_scene(SCENE, set=changes if coarse else [])
    with Progress(total=STROKE, quiet=quiet) as progress:
        results = ff.simulate(scene, out, observer=progress)
    picture(results, Path(out) / "riveting.png")
    compare(compared(results), quiet=quiet)
    return results


def compared(results: ff.Results) -> list[Compared]:
    """The force of the free shank, what is in balance, what is kept, and whether the holes are filled."""
    first, free, end = results.history.rows[0], results.at(stroke=0.3), results.history.rows[-1]
    flow_stress = 400 * 0.02**0.2
    exact = pi * flow_stress * RADIUS**2 * (1 + FRICTION * RADIUS / (3 * sqrt(3) * LENGTH))
    volume = pi * (5**2 * 2 + RADIUS**2 * LENGTH)
    bores = 0.5 * (end["bore_lower_r_mm"] + end["bore_upper_r_mm"])
    return [Compared("force on the free shank, N", first["force_snap_N"], exact, 0.01, "uniform flow"),
            Compared("force between rivet and plates at 0.3 mm, N",
                     free["contact_force_rivet_lower_N"] + free["contact_force_rivet_upper_N"], 0.0, 5.0,
                     "clearance is open", relative=False),
            Compared("force of the anvil at the end, N", end["force_anvil_N"], end["force_snap_N"], 1e-4,
                     "that of the snap"),
            Compared("radius of the shank at the end, mm", end["shank_r_mm"], bores, 2e-3, "the holes are filled"),
            Compared("volume of the rivet, mm³", end["volume_rivet_mm3"], volume, 1e-4, "constant")]


def picture(results: ff.Results, path: Path) -> None:
    """The closed rivet beside the forces between the bodies over the stroke."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.5, 4.2), width_ratios=[1.4, 1], layout="constrained")
    figure.get_layout_engine().set(wspace=0.12)
    ff.plot_fields(results, "effective_strain", ax=left)
    left.set_title(f"after a stroke of {STROKE:g} mm", fontsize="medium")
    history = results.history
    stroke = history.column("stroke_snap_mm")
    right.plot(stroke, history.column("force_snap_N") / 1e3, "k-", label="snap")
    for pair, name in PAIRS.items():
        right.plot(stroke, history.column(f"contact_force_{pair}_N") / 1e3, label=name)
    right.legend(frameon=False, fontsize="small")
    right.set(xlabel="stroke (mm)", ylabel="force (kN)", ylim=(0, None))
    figure.savefig(path, dpi=85)
    plt.close(figure)


if __name__ == "__main__":
    main()
