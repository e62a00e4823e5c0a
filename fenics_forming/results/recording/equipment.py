"""Columns of the history that tell what the drives do: strokes, energies, deflections of springs, speeds of free rolls."""

from __future__ import annotations


def equipment_columns(run, time: float) -> dict[str, float]:
    """Strokes of driven tools, energy left in rams, ways by which springs are pushed back, speeds of free rolls."""
    row = {f"stroke_{tool}_mm": float(run.drives[tool].travel(time)) for tool in run.scene.driven_tools}
    row |= {f"energy_{name}_mJ": ledger["left"] for name, ledger in run.body.rams.ledger().items()}
    for tool in run.body.tools:
        kind = None if tool.drive is None else tool.drive.kind
        if kind == "spring":
            row[f"deflection_{tool.name}_mm"] = -float(tool.free.displacement[0])
        elif kind == "roll" and tool.free is not None:
            row[f"speed_{tool.name}_rad_per_s"] = float(tool.free.rate[0])
    return row
