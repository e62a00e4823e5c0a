"""A can is extruded in a die of two rings, one shrunk onto the other: what the die bears, with and without the shrink fit.

The billet fills the bore; a punch is pressed into it and the metal flows up around the punch. The workpiece meets the bore
as one rigid outline, and its contact forces go, afterwards, to the meshed insert and ring: first these are put together
with their interference, then loaded. The insert yields where the pressure is highest, at the bottom of the bore; without
the shrink fit it yields many times as much, which is what shrink fits are for.

What is known exactly: the die is clamped between stiff plates, so its displacements, averaged over its height, are those
of plane strain under the averaged pressure (Lamé), however the pressure is distributed along the bore:

    fit      p = E' d (b² - a²)(c² - b²) / (2 b³ (c² - a²)),   E' = E / (1 - nu²),   bore  u = -2 p a b² / (E' (b² - a²))
    forming  u = q a (1 + nu) ((1 - 2 nu) a² + c²) / (E (c² - a²)),   q = radial force / (2 pi a H)

with the radii a, b, c of bore, joint and outside, the interference d and the height H.

    python3 demos/assembled_die.py
"""

from __future__ import annotations

from math import pi
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fenics_forming as ff
from demos.comparison import Compared, compare
from fenics_forming.results import Progress
from fenics_forming.results.pictures.skin import Skin
from fenics_forming.results.recording.contact_forces import read_contact_forces

SCENE = Path(__file__).parent / "scenes" / "assembled_die.toml"
BORE, JOINT, OUTSIDE, HEIGHT = 20.0, 40.0, 80.0, 40.0     # mm
YOUNG, POISSON = 210e3, 0.3
STROKE = 2.0


def main(coarse: bool = False, out: str | Path = "results/assembled_die", quiet: bool = False) -> dict[str, ff.Results]:
    """Form, then compute the die: as it is, without shrink fit, and elastic; compare, draw.

    Parameters
    ----------
    coarse : larger elements and steps
    out : folder for the results
    quiet : print nothing
    """
    changes = ["workpieces.billet.mesh_size=2.5", "steps.stroke=0.2", "stop.stroke=0.8"] if coarse else []
    changes += ["tools.die.parts.insert.mesh_size={ contact = 2.5, far = 5 }"] if coarse else []
    scene = ff.read_scene(SCENE, set=changes)
    with Progress(total=STROKE, quiet=quiet) as progress:
        forming = ff.simulate(scene, Path(out) / "forming", observer=progress)
    dies = {"shrink fit": scene, "no interference": loosely_fitted(scene), "elastic": elastic(scene)}
    runs = {"forming": forming}
    for name, each in dies.items():
        with Progress(quiet=quiet) as progress:
            folder = Path(out) / name.replace(" ", "_")
            runs[name] = ff.tool_stresses(forming, "die", scene=each, out=folder, observer=progress)
    picture(runs, Path(out) / "assembled_die.png")
    compare(compared(runs, scene.contacts[0].interference), quiet=quiet)
    return runs


def loosely_fitted(scene):
    """The same die without interference: the rings just touch."""
    return scene.replaced(contacts=[scene.contacts[0].replaced(interference=0.0)])


def elastic(scene):
    """The same die of steels that do not yield."""
    steel = {"young": YOUNG, "poisson": POISSON}
    return scene.replaced(materials={"billet": scene.materials["billet"]} |
                          {name: type(scene.materials[name])(**steel) for name in ("insert_steel", "ring_steel")})


def fit_pressure(interference: float) -> float:
    """Pressure in the joint of a shrink fit in plane strain, MPa."""
    a, b, c = BORE**2, JOINT**2, OUTSIDE**2
    return YOUNG / (1 - POISSON**2) * interference * (b - a) * (c - b) / (2 * JOINT**3 * (c - a))


def bore_of_the_fit(interference: float) -> float:
    """Displacement of the bore by the shrink fit, mm."""
    a, b = BORE**2, JOINT**2
    return -2 * fit_pressure(interference) * BORE * b * (1 - POISSON**2) / (YOUNG * (b - a))


def bore_under_pressure(pressure: float) -> float:
    """Displacement of the bore of a ring in plane strain, mm."""
    a, c = BORE**2, OUTSIDE**2
    return pressure * BORE * (1 + POISSON) * ((1 - 2 * POISSON) * a + c) / (YOUNG * (c - a))


def bore_displacement(results: ff.Results, frame: int) -> float:
    """Mean over its height of the radial displacement of the bore, mm."""
    times = sorted({time for time, _ in results.frames})
    skin = Skin.read([path for time, path in results.frames if time == times[frame]])
    on_bore = np.isclose(skin.points[:, 0], BORE)
    z, u = skin.points[on_bore, 1], skin.fields["displacement_mm"][on_bore, 0]
    order = np.argsort(z)
    return float(np.trapezoid(u[order], z[order]) / np.ptp(z))


def compared(runs: dict[str, ff.Results], interference: float) -> list[Compared]:
    """The fit and the elastic widening beside Lamé; forces of the forming run beside those that hold the die."""
    forming, fitted, loose, elastic_die = runs.values()
    _, _, _, forces = read_contact_forces(forming.folder, "die")
    pressure = forces[:, 0].sum() / (2 * pi * BORE * HEIGHT)
    start, end = elastic_die.history.rows[1], elastic_die.history.rows[-1]
    widening = bore_displacement(elastic_die, -1) - bore_displacement(elastic_die, 1)
    held = -sum(end[f"reaction_die_{face}_z_N"] for face in ("z_low", "z_high"))
    share = [run.summary["tools"]["die"]["insert"]["share_that_flowed"] for run in (fitted, loose)]
    strain = [run.summary["tools"]["die"]["insert"]["largest_effective_strain"] for run in (fitted, loose)]
    return [
        Compared("pressure of the shrink fit, MPa", start["contact_pressure_insert_ring_MPa"], fit_pressure(interference),
                 0.002, "Lamé"),
        Compared("bore moved by the fit, mm", bore_displacement(elastic_die, 1), bore_of_the_fit(interference), 0.002,
                 "Lamé"),
        Compared("bore widened by forming, mm", widening, bore_under_pressure(pressure), 0.01, "Lamé, mean pressure"),
        Compared("axial force of the supports, kN", held / 1e3, -forming.history.rows[-1]["force_die_N"] / 1e3, 1e-6,
                 "forming run"),
        Compared("plastic part of the insert, with / without fit", share[0] / share[1], 0, 0.3, "less by far",
                 relative=False),
        Compared("its largest plastic strain, with / without", strain[0] / strain[1], 0, 0.5, "less by far",
                 relative=False),
    ]


def picture(runs: dict[str, ff.Results], path: Path) -> None:
    """The can, the stress in the die and its plastic zones with and without the fit."""
    figure, axes = plt.subplots(2, 2, figsize=(14.0, 8.4), layout="constrained")
    figure.get_layout_engine().set(wspace=0.16, hspace=0.06)
    ff.plot_fields(runs["forming"], "effective_strain", ax=axes[0, 0], mesh=False)
    axes[0, 0].set_title("strain of the can", fontsize="medium")
    ff.plot_fields(runs["shrink fit"], "von_mises", ax=axes[0, 1], mesh=False, mirror=False)
    axes[0, 1].set_title("stress in the pre-stressed die", fontsize="medium")
    most = max(row["max_effective_strain_die"] for run in list(runs.values())[1:3] for row in run.history.rows)
    for ax, name in zip(axes[1], ("shrink fit", "no interference"), strict=True):
        ff.plot_fields(runs[name], "effective_strain", ax=ax, mesh=False, mirror=False, limits=(0, most))
        ax.set_title(f"plastic strain, {name}", fontsize="medium")
        ax.set(xlim=(18, 52), ylim=(-1, 25))
    figure.savefig(path, dpi=85, bbox_inches="tight", pad_inches=0.1)
    plt.close(figure)


if __name__ == "__main__":
    main()
