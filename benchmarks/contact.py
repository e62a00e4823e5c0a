"""Contact between bodies: what it costs in space, and what the penalty factor changes.

The force of a billet cut into two bodies against that of the billet in one piece, over penalties from a tenth to ten
thousand times the default; and two blocks in space of more than 50 000 unknowns, one step, with the part of the time that
contact between them takes: search, gap operator, law, forces, tangents and what they add to the matrix.

    python3 benchmarks/contact.py
"""

from __future__ import annotations

from billet import HERE, markdown, percent, write_csv

import fenics_forming as ff
from fenics_forming.simulation import Simulation

FACTORS = (1.0, 10.0, 1e2, 1e3, 1e4, 1e5)
METAL = {"metal": {"flow_stress": {"law": "swift", "K": 200, "prestrain": 0.05, "n": 0.2}}}
SIZES = (0.9, 0.6, 0.36)        # of the elements in space, mm


def platen(height: float, dim: int) -> dict:
    up = [0.0] * (dim - 1) + [1.0]
    shape = {"kind": "plane", "point": [height * u for u in up], "normal": [-u for u in up]}
    return {"upper": {"shape": shape, "drive": {"kind": "speed", "velocity": [-u for u in up]},
                      "friction": {"law": "siebel", "factor": 0.2}}}


def billet(pieces: dict[str, tuple], **solver) -> ff.Scene:
    """Upper quarter of a section of a billet 20 x 20 mm in one or two pieces: name → (from, to, element size)."""
    bodies = {name: {"shape": {"kind": "rectangle", "from": low, "to": high}, "material": "metal", "mesh_size": size,
                     "symmetry": ["z"] if low[1] == 0 else []} for name, (low, high, size) in pieces.items()}
    contacts = [{"between": list(pieces), "friction": {"law": "sticking"}}] if len(pieces) > 1 else []
    return ff.Scene.read({"geometry": "axisymmetric", "materials": METAL, "workpieces": bodies, "tools": platen(10, 2),
                          "contacts": contacts, "steps": {"stroke": 0.25}, "stop": {"stroke": 2}, "solver": solver})


def blocks(size: float) -> ff.Scene:
    """Quarter of two blocks of 8 x 8 x 2 mm on one another, which slide."""
    bodies = {name: {"shape": {"kind": "box", "from": [0, 0, low], "to": [4, 4, low + 2]}, "material": "metal",
                     "mesh_size": size * fine, "symmetry": ["x", "y", "z"] if low == 0 else ["x", "y"]}
              for name, low, fine in (("low", 0, 1.0), ("high", 2, 0.9))}
    return ff.Scene.read({"geometry": "3d", "materials": METAL, "workpieces": bodies, "tools": platen(4, 3),
                          "contacts": [{"between": ["low", "high"], "friction": {"law": "siebel", "factor": 0.3}}],
                          "steps": {"stroke": 0.1}, "stop": {"stroke": 0.1}})


def factors() -> list[dict]:
    """A row for every penalty factor, with multipliers and without."""
    one = ff.simulate(billet({"billet": ([0, 0], [10, 10], 1.0)})).history.column("force_upper_N")
    cuts = {"stack": {"a": ([0, 0], [10, 5], 0.8), "b": ([0, 5], [10, 10], 1.0)},
            "core and sleeve": {"a": ([0, 0], [5, 10], 0.8), "b": ([5, 0], [10, 10], 1.0)}}
    rows = []
    for cut, pieces in cuts.items():
        for factor in FACTORS:
            row = {"cut": cut, "factor": factor}
            for augmented, word in ((True, "multipliers"), (False, "penalty_alone")):
                run = ff.simulate(billet(pieces, penalty_factor=factor, augmented=augmented))
                force = run.history.column("force_upper_N")
                row[f"error_{word}"] = float(f"{abs(force / one - 1).max():.2e}")
                row[f"newton_{word}"] = run.summary["newton_iterations_per_solve"]
            rows.append(row)
    return rows


def shares(sizes=SIZES) -> list[dict]:
    """A row for every mesh in space: one step, and what of it is contact between the bodies."""
    rows = []
    for size in sizes:
        run = Simulation(blocks(size))
        interfaces = run.body.interfaces
        before = interfaces.seconds
        summary = run.run().summary
        contact = interfaces.contacts[0]
        rows.append({"unknowns": summary["dofs"], "carriers": contact.carriers.total,
                     "points": contact.points.count,
                     "newton": summary["newton_iterations_per_solve"], "cpu_s": round(summary["cpu_s"], 1),
                     "contact_s": round(interfaces.seconds - before, 2),
                     "contact_share": round((interfaces.seconds - before) / summary["cpu_s"], 4)})
    return rows


def main(sizes=SIZES) -> str:
    """Run everything, write ``contact_factors.csv`` and ``contact_share.csv``; the Markdown of both tables."""
    swept = factors()
    shares(sizes[:1])       # compiles
    shared = shares(sizes)
    write_csv(swept, HERE / "contact_factors.csv")
    write_csv(shared, HERE / "contact_share.csv")
    words = {"multipliers": "multipliers", "penalty_alone": "penalty alone"}
    columns = {"cut": lambda row: row["cut"], "factor": lambda row: f"{row['factor']:g}"}
    for key, word in words.items():
        columns[f"force, {word}"] = percent(f"error_{key}", 3)
        columns[f"Newton, {word}"] = lambda row, key=key: f"{row[f'newton_{key}']:.1f}"
    of_share = {"unknowns": lambda row: row["unknowns"], "nodes that carry": lambda row: row["carriers"],
                "points": lambda row: row["points"], "Newton": lambda row: f"{row['newton']:.1f}",
                "CPU (s)": lambda row: row["cpu_s"], "contact (s)": lambda row: row["contact_s"],
                "share": percent("contact_share", 1)}
    return "\n\n".join((markdown(swept, columns), markdown(shared, of_share)))


if __name__ == "__main__":
    print(main())
