"""A copper core in a steel sleeve is upset between flat dies: two bodies that press and slide on one another.

Half the height is modelled. Every body is meshed and flows by its own law; Siebel friction acts between them. Copper
hardens and steel does not, so the core is soft at first and the sleeve carries the load; barrelled by friction at the dies,
the two slide along one another and the surface between them bends.

At the start a bound is known: if both metals were shortened uniformly, h' = -v, with u_r = v r / 2h, the power would be

    F v = pi v [ s_core R1² + s_sleeve (R2² - R1²) ] + pi m v / (3 sqrt(3) h) [ s_core R1³ + s_sleeve (R2³ - R1³) ] ,

the second part by friction at the die. The real flow takes no more, and at such low friction hardly less. And two bodies
of one metal that stick together must need the force of one solid billet.

    python3 demos/bimetal_upsetting.py
"""

from __future__ import annotations

from math import pi, sqrt
from pathlib import Path

import matplotlib.pyplot as plt

import fenics_forming as ff
from demos.comparison import Compared, compare
from fenics_forming import laws
from fenics_forming.results import Progress

SCENE = Path(__file__).parent / "scenes" / "bimetal_upsetting.toml"
CORE, SLEEVE, HEIGHT = 6.0, 10.0, 12.0     # radii and half the height, mm
DIE_FRICTION = 0.1
STROKE = 4.0


def main(coarse: bool = False, out: str | Path = "results/bimetal_upsetting", quiet: bool = False
         ) -> dict[str, ff.Results]:
    """Upset the two metals, then one metal in two pieces and in one; compare, draw.

    Parameters
    ----------
    coarse : larger elements and steps
    out : folder for the results
    quiet : print nothing
    """
    changes = ["workpieces.core.mesh_size=1.5", "workpieces.sleeve.mesh_size=1.3", "steps.stroke=0.2"] if coarse else []
    scene = ff.read_scene(SCENE, set=changes)
    scenes = {"two metals": scene, "two pieces of steel": in_two_pieces(scene), "one piece of steel": in_one_piece(scene)}
    runs = {}
    for name, each in scenes.items():
        with Progress(total=STROKE, quiet=quiet) as progress:
            runs[name] = ff.simulate(each, Path(out) / name.replace(" ", "_"), observer=progress)
    picture(runs, Path(out) / "bimetal.png")
    compare(compared(runs, tolerance=0.015 if coarse else 0.01), quiet=quiet)
    return runs


def in_two_pieces(scene):
    """Core and sleeve of the steel, sticking to one another."""
    bodies = {name: body.replaced(material="steel") for name, body in scene.workpieces.items()}
    contact = scene.contacts[0].replaced(friction=laws.Sticking())
    return scene.replaced(title="Two pieces of one metal", workpieces=bodies, contacts=[contact],
                          materials={"steel": scene.materials["steel"]})


def in_one_piece(scene):
    """A solid billet of the steel."""
    sleeve = scene.workpieces["sleeve"]
    whole = sleeve.replaced(shape=sleeve.shape.replaced(from_=(0, 0)))
    return scene.replaced(title="One piece of one metal", workpieces={"billet": whole}, contacts=[],
                          materials={"steel": scene.materials["steel"]})


def uniform_force(core: float, sleeve: float, height: float = HEIGHT) -> float:
    """Force of uniform shortening at the start, N, for the flow stresses of the two metals, MPa."""
    flow = core * CORE**2 + sleeve * (SLEEVE**2 - CORE**2)
    rubbing = core * CORE**3 + sleeve * (SLEEVE**3 - CORE**3)
    return pi * flow + pi * DIE_FRICTION / (3 * sqrt(3) * height) * rubbing


def compared(runs: dict[str, ff.Results], tolerance: float) -> list[Compared]:
    """The force of the start beside its bound, one metal beside itself, volumes and surfaces that must be kept."""
    two, pieces, solid = runs.values()
    copper = 450 * 0.01**0.25
    rows = [Compared("force at the start, kN", two.history.rows[0]["force_upper_N"] / 1e3,
                     uniform_force(copper, 600) / 1e3, tolerance, "uniform flow, upper bound"),
            Compared("the same, all of steel, kN", solid.history.rows[0]["force_upper_N"] / 1e3,
                     uniform_force(600, 600) / 1e3, tolerance, "uniform flow, upper bound")]
    for stroke in (0.0, STROKE / 2, STROKE):
        ours, whole = (run.at(stroke=stroke)["force_upper_N"] / 1e3 for run in (pieces, solid))
        rows.append(Compared(f"two pieces of steel at {stroke:g} mm, kN", ours, whole, 0.005, "one piece of steel"))
    end = two.history.rows[-1]
    exact = {"core": 2 * pi * CORE**2 * HEIGHT, "sleeve": 2 * pi * (SLEEVE**2 - CORE**2) * HEIGHT}
    rows += [Compared(f"volume of the {name}, mm³", end[f"volume_{name}_mm3"], volume, 1e-4, "constant")
             for name, volume in exact.items()]
    worst = max(abs(row["power_imbalance"]) for row in two.history.rows)
    return [*rows, Compared("greatest imbalance of power, %", 100 * worst, 0.0, 0.2, "balance", relative=False)]


def picture(runs: dict[str, ff.Results], path: Path) -> None:
    """The two deformed bodies beside the forces over the stroke."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.5, 4.2), width_ratios=[1.25, 1], layout="constrained")
    figure.get_layout_engine().set(wspace=0.12)
    ff.plot_fields(runs["two metals"], "effective_strain", ax=left)
    left.set_title(f"core and sleeve after a stroke of {STROKE:g} mm", fontsize="medium")
    for name, style in zip(runs, ("-", "o", "-"), strict=True):
        history = runs[name].history
        right.plot(history.column("stroke_upper_mm"), history.column("force_upper_N") / 1e3, style, label=name,
                   markersize=4, markerfacecolor="none", markevery=4)
    right.legend(frameon=False, fontsize="small")
    right.set(xlabel="stroke (mm)", ylabel="force of a die (kN)", ylim=(0, None))
    figure.savefig(path, dpi=85)
    plt.close(figure)


if __name__ == "__main__":
    main()
