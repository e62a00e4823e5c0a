"""Whether its tools leave a body room to flow: one that is closed in on all sides cannot be pressed any further."""

from __future__ import annotations

import numpy as np

from ..errors import ConvergenceError
from ..physics.parallel import highest, lowest

TAKEN = 0.9      # of the power of the tools by the penalty: what they ask for is then no flow of the body
PRESSED = 5.0    # times the flow stress, at every node: beside a free side the mean stress is not much above it


def demand_room(body) -> None:
    """Refuse a flow in which the tools press a body that fills all the space between them. Collective.

    Tools whose motion is given would then need any force; one with a force limit, or that spends its energy, comes to rest.

    Raises
    ------
    ConvergenceError
        if the penalty takes nearly all the power of the tools and the body is under high pressure everywhere.
    """
    if body.tools_yield or body.landing_share() < TAKEN:
        return
    comm, workpiece = body.nodes.comm, body.workpiece
    strongest = highest(comm, float(workpiece.flow_stress_at_points.x.array.max(initial=0.0)))
    if lowest(comm, float((-workpiece.mean_stress).min(initial=np.inf))) > PRESSED * strongest:
        raise ConvergenceError("the tools leave the body no room: it fills all the space between them",
                               advice="no force presses it further: stop earlier, by a smaller stop.stroke or by "
                               "stop.force, give the drive a force limit, or draw a gap into which it can flow")
