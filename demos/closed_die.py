"""A gear blank with a hub is forged from a round billet between closed dies, up to a thin flash.

The upper die first presses the billet flat and its middle up into the hub, then the rim reaches the wall of the cavity
and leaves by the gap between the dies, the flash. When the cavity is nearly full the force rises to several times what
upsetting takes: that is what fills the corners. Fillets of 1 to 2 mm, a flash of 1.5 mm and strains of 5 wear out more
than ten meshes, all renewed by the run itself.

There is no reference but the laws: volume, balance of forces and powers, and the shape of the dies.

    python3 demos/closed_die.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial import cKDTree

import fenics_forming as ff
from demos.comparison import Compared, compare
from fenics_forming.physics.tools import known_tools
from fenics_forming.results import Progress
from fenics_forming.results.pictures.skin import Skin

SCENE = Path(__file__).parent / "scenes" / "closed_die.toml"
BILLET = np.pi * 15**2 * 40      # volume, mm³
LAND = 26.0                      # radius where the flash is between parallel faces, mm: what lies inside is the part
FLASH = 1.5                      # its thickness at the end, mm
SAMPLES = np.linspace(0, 1, 9)   # along each side of an element


def main(coarse: bool = False, out: str | Path = "results/closed_die", quiet: bool = False) -> ff.Results:
    """Forge the blank, compare, draw.

    Parameters
    ----------
    coarse : larger elements and steps, and twice the tolerance
    out : folder for the results
    quiet : print nothing
    """
    changes = ["workpieces.billet.mesh_size='1.8 mm'", "steps.stroke='0.25 mm'"] if coarse else []
    scene = ff.read_scene(SCENE, set=changes)
    with Progress(total=scene.stop.stroke, quiet=quiet) as progress:
        results = ff.simulate(scene, out, observer=progress)
    picture(results, Path(out) / "closed_die.png")
    compare(compared(results, slack=2.0 if coarse else 1.0), quiet=quiet)
    return results


def compared(results: ff.Results, slack: float) -> list[Compared]:
    """Ours beside what must be, with ``slack`` times the tolerances."""
    force, other = results.force("upper"), results.force("lower")
    falls = 1 - force[1:] / np.maximum.accumulate(force)[:-1]
    rim, dies = rim_of(results), die_faces(results)
    gaps = cKDTree(rim.reshape(-1, 2)).query(np.concatenate(dies))[0]
    around = np.concatenate([dies[0], dies[1][::-1]])       # up through the flash, and back to the axis
    left_over = BILLET - volume_within(np.stack([around[:-1], around[1:]], axis=1), LAND)
    flash = BILLET - volume_within(rim, LAND)
    power = results.summary["ledger"]["power"]
    return [
        Compared("relative error of the volume", results.history.rows[-1]["volume_error_billet"], 0, 1e-4, "constancy",
                 relative=False),
        Compared("largest gap between die and part, mm", gaps.max(), 0, 0.25 * slack, "a full cavity", relative=False),
        Compared("volume in the flash, mm³", flash, left_over, 0.02 * slack, "billet less cavity"),
        Compared("force of the lower die at the end, kN", other[-1] / 1e3, force[-1] / 1e3, 0.01, "balance"),
        Compared("largest fall of the force on its way up, %", 100 * max(falls.max(), 0), 0, 3 * slack, "a closing die",
                 relative=False),
        Compared("powers that do not balance at worst, %", 100 * power["worst_relative_imbalance"], 0, 0.1, "first law",
                 relative=False),
    ]


def rim_of(results: ff.Results) -> np.ndarray:
    """Points on the sides of the forged body, (sides, samples, 2), the body on the left, mm."""
    skin = Skin.read([results.frames[-1][1]])
    _, rim = skin.sides()
    a, m, b = (skin.points[rim[:, k], None] for k in range(3))
    s = SAMPLES[:, None]
    return (1 - s) * (1 - 2 * s) * a + 4 * s * (1 - s) * m + s * (2 * s - 1) * b


def die_faces(results: ff.Results) -> list[np.ndarray]:
    """Points on the faces of both dies at the end, from the axis to the flash land, (k, 2) each, mm."""
    drive, end = results.scene.tools["upper"].drive, results.history.rows[-1]["time_s"]
    faces = []
    for tool in known_tools(results.scene):
        vertices, segments = tool.surface.outline(np.array([-10.0, -10.0]), np.array([60.0, 60.0]))
        line = vertices[segments[:, 0]] + (drive.displacement(end) if tool.name == "upper" else 0)
        line = line[np.argsort(line[:, 0], kind="stable")]
        along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        fine = np.linspace(0, along[-1], 4000)
        points = np.stack([np.interp(fine, along, line[:, k]) for k in range(2)], axis=1)
        faces.append(points[(points[:, 0] >= 0) & (points[:, 0] <= LAND)])
    return faces


def volume_within(sides: np.ndarray, radius: float) -> float:
    """Volume within a radius, mm³, of the body of revolution with the given sides (f, samples, 2) of its section.

    The integral of pi min(r, R)² dz around the section: that of 2 pi r dr dz where r < R.
    """
    r, z = np.minimum(sides[..., 0], radius), sides[..., 1]
    return float(np.pi / 3 * ((r[:, 1:] ** 2 + r[:, 1:] * r[:, :-1] + r[:, :-1] ** 2) * np.diff(z, axis=1)).sum())


def picture(results: ff.Results, path: Path) -> None:
    """The forged section with its strain and its flow lines, and the force over the stroke."""
    figure, axes = plt.subplots(1, 3, figsize=(15.5, 4.6), width_ratios=[1.15, 1.0, 0.9], layout="constrained")
    ff.plot_fields(results, "effective_strain", ax=axes[0], mesh=False)
    axes[0].set_title("effective strain", fontsize="medium")
    ff.plot_fields(results, None, ax=axes[1], mirror=False)
    axes[1].set_title("mesh and flow lines", fontsize="medium")
    ff.plot_force_stroke(results, ax=axes[2])
    axes[2].set(title="", xlabel="stroke of the upper die (mm)", ylabel="force (kN)")
    figure.savefig(path, dpi=85)
    plt.close(figure)


if __name__ == "__main__":
    main()
