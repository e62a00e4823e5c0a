r"""A billet is forged with three blows of a hammer, without friction and with, and with one stroke of a screw press.

A hammer brings energy, not a way: the higher the force has become, the shorter the next blow. Without friction the billet
stays a cylinder, and the energy alone gives its height,

.. math:: \eta\sum E = V\,(\sigma_0\varepsilon+\tfrac12 H\varepsilon^2),\qquad h=h_0e^{-\varepsilon},

:math:`\eta=1/(1+M/M_a)` on a free anvil. With friction the bound for a billet that does not bulge is a little higher than
the truth: :math:`p=\bar\sigma\,(1+2mR/3\sqrt3h)`. The frame of the screw press keeps :math:`F^2/2C` of its energy.

    python3 demos/hammer_forging.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fenics_forming as ff
from demos.comparison import Compared, compare
from fenics_forming.results import Progress

RADIUS, HEIGHT, INITIAL, HARDENING, FRICTION = 10.0, 20.0, 100.0, 50.0, 0.2     # mm; MPa; shear factor
BLOWS, RAM, ANVIL = (300e3, 300e3, 300e3), 0.1, 2.0                             # mJ; tonnes
ENERGY, FRAME = 600e3, 5e5                                                      # mJ; N/mm
VOLUME = np.pi * RADIUS**2 * HEIGHT

HAMMER = {"kind": "hammer", "mass": RAM, "anvil_mass": ANVIL, "energy": list(BLOWS), "pause": "1 s", "direction": [0, -1]}
PRESS = {"kind": "screw_press", "energy": ENERGY, "speed": "500 mm/s", "stiffness": FRAME, "direction": [0, -1]}


def main(coarse: bool = False, out: str | Path = "results/hammer_forging", quiet: bool = False) -> dict[str, ff.Results]:
    """Forge the billet, compare, draw.

    Parameters
    ----------
    coarse : larger elements and steps
    out : folder for the results
    quiet : print nothing

    Returns
    -------
    Results of the runs "hammer", "friction" and "screw press".
    """
    runs = {}
    for name, drive, friction in (("hammer", HAMMER, 0.0), ("friction", HAMMER, FRICTION), ("screw press", PRESS, 0.0)):
        with Progress(quiet=quiet) as progress:
            runs[name] = ff.simulate(scene(drive, friction, coarse), Path(out) / name.replace(" ", "_"), observer=progress)
    picture(runs, Path(out) / "hammer_forging.png")
    compare(compared(runs), quiet=quiet)
    return runs


def scene(drive: dict, friction: float, coarse: bool) -> ff.Scene:
    """The billet between anvil and ram."""
    law = {"law": "siebel", "factor": friction} if friction else {"law": "none"}
    planes = {"anvil": {"point": [0, 0], "normal": [0, 1]}, "ram": {"point": [0, HEIGHT], "normal": [0, -1]}}
    tools = {name: {"shape": {"kind": "plane", **plane}, "friction": law} for name, plane in planes.items()}
    tools["ram"]["drive"] = drive
    return ff.Scene.read({
        "title": f"{drive['kind'].replace('_', ' ')}, friction {friction:g}", "geometry": "axisymmetric",
        "materials": {"billet": {"flow_stress": {"law": "linear", "initial": INITIAL, "hardening": HARDENING}}},
        "workpieces": {"billet": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [RADIUS, HEIGHT]},
                                  "material": "billet", "mesh_size": 2.5 if coarse else 1.25}},
        "tools": tools, "steps": {"stroke": 0.5 if coarse else 0.25}, "stop": {"energy_spent": True},
        "process": {"volume_constancy": "each_step"}, "output": {"fields_every": 0}})


def height_of(energy: float, friction: float = 0.0) -> float:
    """Height of the billet that has taken an energy, mJ: of a cylinder, with the bound of the friction on it."""
    heights = np.linspace(HEIGHT, 0.2 * HEIGHT, 100001)
    strain = np.log(HEIGHT / heights)
    radius = RADIUS * np.sqrt(HEIGHT / heights)
    pressure = (INITIAL + HARDENING * strain) * (1 + 2 * friction * radius / (3 * np.sqrt(3) * heights))
    work = VOLUME * np.concatenate([[0], np.cumsum(0.5 * (pressure[1:] + pressure[:-1]) * np.diff(strain))])
    return float(np.interp(energy, work, heights))


def ends_of_blows(results: ff.Results) -> np.ndarray:
    """Numbers of the rows at which a blow has ended: before a pause, and the last."""
    time = results.history.column("time_s")
    return np.append(np.flatnonzero(np.diff(time) > 0.5), len(time) - 1)


def compared(runs: dict[str, ff.Results]) -> list[Compared]:
    """Heights after the blows, the height and the energy in the frame after the stroke of the press."""
    taken = np.cumsum(BLOWS) / (1 + RAM / ANVIL)
    rows = []
    for name, friction, allowed, source in (("hammer", 0.0, 0.005, "energy"), ("friction", FRICTION, 0.03, "upper bound")):
        stroke = runs[name].stroke()[ends_of_blows(runs[name])]
        rows += [Compared(f"{name}: height after blow {k + 1}, mm", HEIGHT - stroke[k], height_of(taken[k], friction),
                          allowed, source) for k in range(len(BLOWS))]
    press, ledger = runs["screw press"], runs["screw press"].summary["ledger"]["energy_mJ"]["ram"]
    low, high = press.summary["extents_mm"]["billet"]["z"]
    area = VOLUME / (high - low)
    force = area * (INITIAL + HARDENING * np.log(HEIGHT / (high - low)))
    return [*rows,
            Compared("screw press: height, mm", high - low, height_of(ENERGY - force**2 / (2 * FRAME)), 0.005, "energy"),
            Compared("screw press: energy in the frame, J", ledger["stored in the frame"] / 1e3,
                     force**2 / (2 * FRAME) / 1e3, 0.02, "F²/2C"),
            Compared("screw press: energies found again", sum(ledger.values()) - 2 * ledger["brought"], 0.0, 1e-3, "mJ",
                     relative=False)]


def picture(runs: dict[str, ff.Results], path: Path) -> None:
    """Force and energy over the stroke, blow by blow, and the billet forged with friction."""
    figure, axes = plt.subplot_mosaic([["force", "billet"], ["energy", "billet"]], figsize=(10, 6), layout="constrained",
                                      width_ratios=[1.2, 1])
    for k, (name, results) in enumerate(runs.items()):
        label = f"hammer, m = {FRICTION:g}" if name == "friction" else name
        axes["force"].plot(results.stroke(), results.force() / 1e3, color=f"C{k}", label=label)
        axes["energy"].plot(results.stroke(), results.history.column("energy_ram_mJ") / 1e6, color=f"C{k}")
    axes["force"].set(ylabel="force of the ram (kN)", xlabel="")
    axes["force"].legend(frameon=False, fontsize="small")
    axes["energy"].set(ylabel="energy left (kJ)", xlabel="stroke (mm)", ylim=(0, None))
    ff.plot_fields(runs["friction"], "effective_strain", ax=axes["billet"])
    axes["billet"].set_title(f"after three blows, m = {FRICTION:g}", fontsize="medium")
    figure.savefig(path, dpi=85)
    plt.close(figure)


if __name__ == "__main__":
    main()
