"""A run in which nothing was formed, for no tool ever pressed on the body: that has to be said."""

from __future__ import annotations

import numpy as np

from ..physics.parallel import lowest
from ..process.approach import NEAR

ADVICE = "mind where it starts, its direction and the stop"
PULLED = "it went away from the body, and a tool only pushes: to pull, let it push behind a shoulder"
EDGE = ("a point or an edge, on which no pressure acts: let more of the body lie on it at the start, "
        "or push the body on with another tool")


def untouched(run, rows: list[dict]) -> list[str]:
    """One sentence where tools moved and none of them ever gave a force. Collective.

    Nothing where the body can move by itself: by its weight or its speed, or pressed by another body.

    Parameters
    ----------
    run : the simulation. rows : of its history, with `force_<tool>_…`.
    """
    body, forces = run.body, [value for row in rows for key, value in row.items() if key.startswith("force_")]
    if not forces or any(forces) or body.inertia is not None or body.interfaces is not None:
        return []
    surface = body.x[body.boundary]
    gaps = {tool.name: lowest(body.nodes.comm, float(np.min(tool.gap(surface)[0], initial=np.inf)))
            for tool in body.tools if tool.name in run.drives}
    if not gaps:
        return []
    name = min(gaps, key=gaps.get)
    where = f"'{name}' touches it in {EDGE}" if gaps[name] <= NEAR * body.size else \
        f"'{name}' ends {gaps[name]:.3g} mm away: {PULLED if _went_away(gaps[name], rows, name, body.size) else ADVICE}"
    return [f"no tool ever pressed on the body, nothing was formed; {where}"]


def _went_away(gap: float, rows: list[dict], name: str, size: float) -> bool:
    """Whether all of the tool's stroke is the gap that it ends with: it touched, and moved straight away. mm."""
    return abs(gap - rows[-1].get(f"stroke_{name}_mm", np.inf)) <= NEAR * size
