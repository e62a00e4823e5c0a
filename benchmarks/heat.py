"""What a die costs that takes heat: insulating, of constant temperature, as columns, with a temperature field of its own.

The billet of ``demos/hot_forging.py`` on its coarse mesh, with elements of 0.5 mm at the dies. The reference is the finest
temperature field. Only the upper die differs from run to run.

    python3 benchmarks/heat.py
"""

from __future__ import annotations

from billet import HERE, markdown, percent, write_csv

import fenics_forming as ff
from demos.hot_forging import LATE, SCENE, with_die

FIELDS = (1.0, 0.5, 0.25, 0.125)     # mm, elements of the die at its face


def runs() -> dict[str, ff.Scene]:
    """The scenes by name; the last one is the reference."""
    scene = ff.read_scene(SCENE, set=["workpieces.billet.mesh_size='4 mm'", "steps.stroke='1 mm'"])
    found = {kind: refined(with_die(scene, kind, coarse=True), 0.5) for kind in ("none", "constant", "column", "coupled")}
    coupled = found.pop("coupled")
    for size in FIELDS:
        die = coupled.tools["upper"].replaced(mesh_size={"contact": size, "far": 8})
        found[f"coupled, {size:g} mm"] = coupled.replaced(tools={**coupled.tools, "upper": die})
    return found


def refined(scene: ff.Scene, size: float) -> ff.Scene:
    """The scene with other elements at the dies."""
    billet = scene.workpieces["billet"]
    near = [domain.replaced(size=size) for domain in billet.refine]
    return scene.replaced(workpieces={"billet": billet.replaced(refine=near)})


def main() -> str:
    """Run all; the table, which is also written as ``heat.csv``."""
    results = {name: ff.simulate(scene) for name, scene in runs().items()}
    reference = list(results.values())[-1].at(stroke=LATE)
    rows = []
    for name, run in results.items():
        end, seconds = run.at(stroke=LATE), run.summary["wall_s_by_part"]["heat"]
        heat = end.get("heat_to_upper_J", 0.0)
        rows.append({"die": name, "seconds": seconds, "share": seconds / run.summary["wall_s"], "heat": heat,
                     "heat_off": heat / reference["heat_to_upper_J"] - 1, "face": end["face_temperature_degC"],
                     "force_off": end["force_upper_N"] / reference["force_upper_N"] - 1})
    write_csv(rows, HERE / "heat.csv")
    return markdown(rows, {
        "upper die": lambda r: r["die"], "heat, s": lambda r: f"{r['seconds']:.2f}", "of the run": percent("share", 0),
        "heat to the die, J": lambda r: f"{r['heat']:.1f}", "off the finest": percent("heat_off", 1),
        "face of the billet, °C": lambda r: f"{r['face']:.1f}", "force, off the finest": percent("force_off")})


if __name__ == "__main__":
    print(main())
