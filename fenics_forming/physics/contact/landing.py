r"""Points that are about to land on a tool: they press before they touch, since contact looks ahead.

A solve with look-ahead :math:`\Delta t` lets a point close its gap :math:`g` and no more, and holds it back by a pressure
:math:`p`. At the instant of the solve there is no such pressure. How much it adds to the force follows from a small
:math:`\delta` by which a point is held back: the flow then takes more power by :math:`\tfrac12 k\delta^2`, its pressure is
:math:`k\delta`, and the tools give

.. math:: P = P_{flow} + \int p\,g/\Delta t\,d\Gamma ,

of which the last term, of first order in :math:`\delta`, is spent on nothing but the gap. So the force of the tools is,
to first order, that of the power without it. Points that pressed in the solve before are in contact, whatever small gap a
quadratic side leaves them: their pressure is real.
"""

from __future__ import annotations

import numpy as np

from ..parallel import total
from .point_law import landing_power
from .rigid import RigidContact


def share_on_the_body(contact: RigidContact) -> float:
    r"""Power of the tools without what landing points take, :math:`1-\int p\,g/\Delta t\,d\Gamma/P`, 0 to 1. Collective."""
    sums = np.zeros(2)
    for tool in contact.tools:
        sums += landing_power(tool.state, tool.traction, contact.weights)
    given, landed = total(contact.facets.comm, sums).tolist()
    return min(max(1.0 - landed / contact.dt / given, 0.0), 1.0) if given > 0 < landed else 1.0
