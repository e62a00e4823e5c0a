"""What a run passes from step to step."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..process.integration import Flow

if TYPE_CHECKING:
    from ..process.heat.heating import HeatState


@dataclass
class State:
    """Where a run is: step, time s, history of the nodes, the flow, the step length that contact looked ahead, and what
    has changed the volume in the step, mm³ by cause; where temperatures change, what the heat needs to know; time
    paused, s, in how many operations of cooling."""

    step: int
    time: float
    history: dict[str, np.ndarray]
    flow: Flow
    dt: float
    volume_changes: dict[str, float] = field(default_factory=dict)
    heat: HeatState | None = None
    paused: float = 0.0
    cooled: int = 0

    @property
    def clock(self) -> float:
        """Time with all pauses, s."""
        return self.time + self.paused
