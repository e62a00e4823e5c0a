"""Why a flow was not found: what the tools that touch the body, and what holds it, say of it."""

from __future__ import annotations

import numpy as np

from ..errors import ConvergenceError
from ..laws.friction import SHEAR
from ..physics.parallel import total
from .approach import NEAR

OPPOSED = 1e-2                  # of a push: what pushes the other way, and so holds the body between tools
YIELDS = 2.0 / np.sqrt(3.0)     # of the flow stress: the pressure under which a body between two tools flows


def explained(body, failure: ConvergenceError) -> ConvergenceError:
    """The failure, with its likely reason where the tools that touch the body do not hold it. Collective.

    Parameters
    ----------
    body : ``FlowingBody`` on the closest points of the failed solve
    """
    if body.contact is None:
        return failure
    pushes = {tool.name: _push(body, tool) for tool in body.tools}
    pushes = {name: push for name, push in pushes.items() if np.any(push[0] != 0)}
    held = {condition.component for condition in body.workpiece.fixed}
    if len(pushes) == 1:
        (name, push), = pushes.items()
        if int(np.argmax(np.abs(push[0]))) not in held:
            return ConvergenceError(f"{failure.sentence}; of the tools only '{name}' touches the body",
                                    history=failure.history, advice="if the body is free to move away from it, put what "
                                    "opposes it against the body: a tool, or a mirror plane by 'symmetry'")
    if not pushes or body.interfaces is not None or body.inertia is not None:
        return failure
    if body.workpiece.kinematics.name == "axisymmetric":
        held.add(0)
    angles = [angle for k in range(body.nodes.dim) if k not in held
              for angle in _slipping(*np.sum(list(pushes.values()), axis=0)[:, k])]
    if not angles:
        return failure
    lean, borne = angles[0]
    return ConvergenceError(
        f"{failure.sentence}; what touches the body leans by {lean:.1f} degrees against it, friction holds up to "
        f"{borne:.1f}: it slips out instead of being formed", history=failure.history,
        advice="rolls bite up to the angle whose tangent is the friction coefficient: more friction, a smaller draught, "
        "larger rolls, a front that is tapered farther, or a tool behind the body that pushes it in")


def _push(body, tool) -> np.ndarray:
    """Sums over the points where a tool touches, (4, dim), mm² and what goes with them: of its normal, of the part of it
    that points up each axis, of what presses across the axis, and of what friction makes of that. Collective."""
    normal, touching = tool.state.normal, (tool.state.gap <= NEAR * body.size) * body.contact.weights
    across = np.sqrt(np.clip(1.0 - normal**2, 0.0, None))
    of_point = np.stack([normal, np.maximum(normal, 0.0), across, _coefficient(body, tool) * across])
    return body.contact.facets.integral(np.einsum("p,spi->psi", touching, of_point))


def _coefficient(body, tool) -> float:
    """Friction stress over pressure where the body flows between two tools; where it sticks, its own shear yield stress
    over that pressure. Collective."""
    if not tool.has_friction:
        return 0.0
    stress = body.workpiece.flow_stress_at_points.x.array
    sums = total(body.nodes.comm, np.array([stress.sum(), stress.size]))
    stress = sums[0] / sums[1] if sums[0] > 0 else 1.0      # before the first solve there is none; any gives the share
    most = min(float(tool.friction.limit(YIELDS * stress, stress)), SHEAR * stress)
    return most / (YIELDS * stress)


def _slipping(along: float, up: float, across: float, borne: float) -> list[tuple[float, float]]:
    """The angles of lean and of friction, degrees, where all that touches pushes one way, and more than friction bears."""
    down = up - along
    if min(up, down) > OPPOSED * max(up, down) or abs(along) <= borne:
        return []
    return [(float(np.degrees(np.arctan2(abs(along), across))), float(np.degrees(np.arctan2(borne, across))))]
