"""One velocity solve on a mesh of your own, in a few lines: the lower layer of the package, for notebooks and tests.

    mesh = fenics_forming.meshing.polygon([(0, 0), (1, 0), (1, 1), (0, 1)], 0.05)
    top = fenics_forming.meshing.boundary_facets(mesh, lambda x: np.isclose(x[1], 1))
    flow = fenics_forming.solve_flow(mesh, kinematics="plane_strain", flow_stress=laws.Constant(value=100),
                                     fixed=[FixedVelocity(top, 1, -1.0), ...], characteristic_rate=1.0)
    flow.plastic_power, flow.velocity, flow.mean_stress
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from dolfinx.mesh import Mesh

from .conditions import FixedVelocity
from .kinematics import KINDS, Kinematics
from .meshing import order_two
from .newton import FlowSolver
from .nodes import Nodes
from .settings import NewtonSettings
from .workpiece import Workpiece

__all__ = ["FixedVelocity", "FlowField", "solve_flow"]


@dataclass(frozen=True)
class FlowField:
    """A solved flow.

    velocity (nodes, dim) mm/s · mean_stress (nodes,) MPa · effective_strain_rate (nodes,) 1/s · plastic_power mW ·
    volume mm³ · iterations of the Newton · workpiece, whose spaces and forms can be used further
    """

    velocity: np.ndarray
    mean_stress: np.ndarray
    effective_strain_rate: np.ndarray
    plastic_power: float
    volume: float
    iterations: int
    workpiece: Workpiece = field(repr=False)

    @property
    def x(self) -> np.ndarray:
        """Positions of the nodes, (nodes, dim), mm."""
        return self.workpiece.nodes.x


def solve_flow(mesh: Mesh, *, kinematics: Kinematics | str, flow_stress, fixed=(), characteristic_rate: float,
               contact=None, body_force=None, pressure_datum: bool = False, strain: np.ndarray | None = None,
               temperature: float | None = None, settings: NewtonSettings = NewtonSettings()) -> FlowField:
    """Rigid-(visco)plastic flow of a body at one instant.

    Parameters
    ----------
    mesh : a dolfinx mesh of triangles or tetrahedra; raised to order 2 where it is straight-sided
    kinematics : "plane_strain", "axisymmetric" or "3d"
    flow_stress : a law of ``laws``, or your own subclass of ``laws.FlowStress``
    fixed : conditions on the velocity, :class:`FixedVelocity`
    characteristic_rate : tool speed over body size, 1/s; the regularisation is relative to it
    body_force : UFL vector or numbers, N/mm³
    pressure_datum : pin the pressure at one point (normal velocity given on the whole boundary)
    strain : nodal effective strain, (nodes,)

    Raises
    ------
    ConvergenceError
        if the Newton fails from the linear viscous start and by continuation.
    """
    kind = KINDS[kinematics] if isinstance(kinematics, str) else kinematics
    nodes = Nodes(order_two(mesh))
    body = Workpiece(nodes, kinematics=kind, flow_stress=flow_stress, fixed=fixed, contact=contact,
                     body_force=body_force, pressure_datum=pressure_datum, settings=settings)
    strain = np.zeros(nodes.count) if strain is None else strain
    heat = None if temperature is None else np.full(nodes.count, float(temperature))
    found = FlowSolver(body).solve(strain=strain, characteristic_rate=characteristic_rate, temperature=heat)
    return FlowField(body.velocity, body.mean_stress, body.nodal_rate(), body.plastic_power(), body.volume(),
                     found.iterations, body)
