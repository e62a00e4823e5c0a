"""Where the parts meet: a scene becomes a body between its tools, and runs to its stop.

``run`` builds and drives, ``stepping`` takes the body from step to step, ``stops`` says where steps and runs end,
``checkpointing`` writes and reads the whole.
"""

from .run import Simulation, simulate, simulation_of
from .state import State

__all__ = ["Simulation", "State", "simulate", "simulation_of"]
