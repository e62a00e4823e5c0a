"""What renewing the mesh costs and what it keeps: rings, the billet and a cylinder in space, with ``remesh = true``.

The share of the time counts the making of the mesh and the transfer of all fields; the solve on the new mesh belongs to the
steps. The force is compared before and after each remeshing at the same instant.

    python3 benchmarks/remeshing.py
"""

from __future__ import annotations

from billet import HERE, markdown, percent, write_csv

import fenics_forming as ff
from demos.billet_upsetting import SCENE as BILLET
from demos.ring_compression import SCENE as RING

ROUND = ff.Scene(
    title="quarter of the upper half of a cylinder", geometry="3d",
    materials={"metal": {"flow_stress": {"law": "linear", "initial": 100, "hardening": 30}}},
    workpieces={"body": {"shape": {"kind": "cylinder", "base": [0, 0, 0], "radius": 10, "height": 10}, "material": "metal",
                         "symmetry": ["x", "y", "z"], "mesh_size": 2, "remesh": True}},
    tools={"upper": {"shape": {"kind": "plane", "point": [0, 0, 10], "normal": [0, 0, -1]},
                     "drive": {"kind": "speed", "velocity": [0, 0, -1]}, "friction": {"law": "siebel", "factor": 0.2}}},
    steps={"stroke": 0.3}, stop={"stroke": 6})


def runs() -> dict[str, ff.Scene]:
    """The scenes by name."""
    ring = lambda m: ff.read_scene(RING, set=[f"tools.upper.friction.factor={m}"])  # noqa: E731
    billet = ff.read_scene(BILLET, set=["workpieces.billet.remesh=true", "stop.stroke=10.5"])
    return {**{f"ring 6:3:2, m = {m:g}, 50 %": ring(m) for m in (0.1, 0.5, 1.0)}, "billet, 70 %": billet,
            "cylinder in space, 60 %": ROUND}


def row(name: str, scene: ff.Scene) -> dict:
    """Cost and what was kept of one run."""
    results = ff.simulate(scene)
    s = results.summary
    seconds = s["wall_s_by_part"]
    jumps = [abs(after[0] / before[0] - 1) for before, after in (record["forces"] for record in s["remeshed"])]
    kept = [abs(record["conservation"]["history.effective_strain"]) for record in s["remeshed"]]
    return {"run": name, "steps": s["steps"], "remeshings": s["remeshings"], "cpu_s": round(s["cpu_s"], 2),
            "remeshing_share": round(seconds.get("remeshing", 0.0) / s["wall_s"], 4),
            "force_jump": round(max(jumps, default=0.0), 5), "strain_integral": round(max(kept, default=0.0), 5),
            "volume_error": float(f"{s['ledger']['volume']['relative_error']:.1e}")}


def main() -> str:
    """Run everything, write ``remeshing.csv``; the Markdown of the table."""
    scenes = runs()
    for scene in (scenes["ring 6:3:2, m = 0.1, 50 %"], ROUND):      # compiles, and imports mmg and gmsh
        workpiece = next(iter(scene.workpieces))
        stop = scene.steps.stroke * 4
        ff.simulate(ff.Scene.read(scene.as_table() | {"stop": {"stroke": stop}, "workpieces": {workpiece: scene.as_table()[
            "workpieces"][workpiece] | {"remesh": {"every": 3}}}}))
    rows = []
    for name, scene in scenes.items():
        try:
            rows.append(row(name, scene))
        except ff.ConvergenceError:
            rows.append({"run": name})
    write_csv(rows, HERE / "remeshing.csv")
    return markdown(rows, {
        "run": lambda r: r["run"], "steps": lambda r: r["steps"], "remeshings": lambda r: r["remeshings"],
        "CPU s": lambda r: f"{r['cpu_s']:.2f}", "remeshing and transfer": percent("remeshing_share", 1),
        "largest jump of the force": percent("force_jump"),
        "change of the integral of the strain": percent("strain_integral"),
        "volume": lambda r: f"{r['volume_error']:+.0e}"})


if __name__ == "__main__":
    print(main())
