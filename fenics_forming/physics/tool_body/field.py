"""One deformable tool on a mesh of your own, in a few lines: the lower layer of the package, for notebooks and tests.

    mesh = fenics_forming.meshing.rectangle((0, 0), (100, 20), (20, 4))
    root = fenics_forming.meshing.boundary_facets(mesh, lambda x: np.isclose(x[0], 0))
    top = fenics_forming.meshing.boundary_facets(mesh, lambda x: np.isclose(x[1], 20))
    steel = laws.Elasticity(young="210 GPa", poisson=0.3, yield_stress="900 MPa")
    tool = fenics_forming.solve_tool(mesh, kinematics="plane_stress", material=steel, loads=[Pressure(top, 10)],
                                     held=[FixedDisplacement(root, 0), FixedDisplacement(root, 1)])
    tool.displacement, tool.von_mises, tool.reaction(root)
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from dolfinx.mesh import Mesh

from ..conditions import facet_nodes
from ..kinematics import SQRT2
from ..meshing import order_two
from ..nodes import Nodes
from ..parallel import total
from .body import ToolBody
from .elastic import ElasticSolver
from .plastic import PlasticSolver, ToolSettings
from .stress_state import StressState

COMPONENTS = {"plane_strain": ("xx", "yy", "zz", "xy"), "plane_stress": ("xx", "yy", "zz", "xy"),
              "axisymmetric": ("rr", "zz", "tt", "rz"), "3d": ("xx", "yy", "zz", "yz", "xz", "xy")}


@dataclass(frozen=True)
class ToolField:
    """A deformed tool.

    displacement (nodes, dim) mm · stress (nodes, components) MPa, in the order of ``components`` · von_mises,
    mean_stress (nodes,) MPa · plastic_strain (nodes,) effective, None of a tool that cannot yield · reactions
    (nodes, dim) N, zero where nothing is held · external_work = elastic_energy + spring_energy + plastic_work +
    thermal_work (of the stresses on thermal strains), mJ · iterations · solver and body, with which further loads can be
    brought on
    """

    displacement: np.ndarray
    stress: np.ndarray
    von_mises: np.ndarray
    mean_stress: np.ndarray
    plastic_strain: np.ndarray | None
    reactions: np.ndarray
    external_work: float
    elastic_energy: float
    spring_energy: float
    plastic_work: float
    thermal_work: float
    iterations: int
    solver: ElasticSolver | PlasticSolver = field(repr=False)

    @property
    def body(self) -> ToolBody:
        return self.solver.body

    @property
    def x(self) -> np.ndarray:
        """Positions of the nodes before the deformation, (nodes, dim), mm."""
        return self.body.nodes.x

    @property
    def components(self) -> tuple[str, ...]:
        """Names of the components of the stress."""
        return COMPONENTS[self.body.state.name]

    def reaction(self, facets: np.ndarray) -> np.ndarray:
        """Force on the body of what holds it at some facets, (dim,), N (N/mm in the plane, of the full ring in
        axisymmetry). Collective."""
        nodes = facet_nodes(self.body.nodes, facets)
        mine = np.zeros(self.body.nodes.count)
        mine[nodes] = 1.0
        held = self.body.nodes.sum_at_all(mine) > 0         # a facet's owner need not own its nodes
        owned = held & (self.body.dofs[:, 0] < self.body.owned)
        return total(self.body.nodes.comm, self.reactions[owned].sum(axis=0))


def solve_tool(mesh: Mesh, *, kinematics: StressState | str, material, held=(), springs=(), loads=(),
               temperature=None, stress_free: float = 20.0, steps: int | None = None,
               settings: ToolSettings = ToolSettings()) -> ToolField:
    """A tool under loads, from no stress.

    Parameters
    ----------
    mesh : a dolfinx mesh of triangles or tetrahedra; raised to order 2 where it is straight-sided
    kinematics : "plane_strain", "plane_stress", "axisymmetric" or "3d"
    material : ``laws.Elasticity``; or pairs (law, cells)
    held : `FixedDisplacement` (also symmetry planes and the axis), `FixedPoint`
    springs : `Springs`, `PointSprings`
    loads : `Pressure`, `Traction`, `BodyForce`, `Centrifugal`, `NodalForces`
    temperature : (nodes,) or everywhere, degC; without it no thermal strain is built · stress_free : degC, where it is zero
    steps : in which the loads are brought on, if the tool yields

    Raises
    ------
    ConvergenceError
        if the tool is free to move as a whole, or cannot carry the loads.
    """
    body = ToolBody(Nodes(order_two(mesh)), kinematics=kinematics, material=material, held=held, springs=springs)
    if temperature is not None:
        body.set_temperature(temperature, stress_free)
    solver = solver_of(body, settings)
    iterations = solver.solve(loads, steps=steps)
    return fields(solver, iterations)


def solver_of(body: ToolBody, settings: ToolSettings = ToolSettings()) -> ElasticSolver | PlasticSolver:
    """The solver that a body needs: without a plastic state if no part of it can yield."""
    return PlasticSolver(body, settings) if body.yields else ElasticSolver(body)


def fields(solver: ElasticSolver | PlasticSolver, iterations: int = 0) -> ToolField:
    """The fields of the present state. Collective."""
    body, at_points = solver.body, solver.point_stress()
    normal = body.state.components - (3 if body.nodes.dim == 3 else 1)
    nodal = at_nodes(body, at_points)
    mean = nodal[:, :3].mean(axis=1)
    deviator = nodal - mean[:, None] * (np.arange(nodal.shape[1]) < 3)
    mises = np.sqrt(1.5 * np.einsum("ni,ni->n", deviator, deviator))
    stress = np.concatenate([nodal[:, :normal], nodal[:, normal:] / SQRT2], axis=1)
    plastic = None if solver.plastic is None else np.maximum(at_nodes(body, solver.plastic.effective[:, None])[:, 0], 0.0)
    balance = solver.internal_forces()
    balance.axpy(-1.0, solver.force)
    reactions = np.where(body.is_held, body.nodal_forces(balance), 0.0)
    return ToolField(body.nodal(), stress, mises, mean, plastic, reactions, solver.external_work,
                     body.elastic_energy(at_points), body.spring_energy(), solver.plastic_work, solver.thermal_work,
                     iterations, solver)


def at_nodes(body: ToolBody, at_points: np.ndarray) -> np.ndarray:
    """Values at the points (p, k), carried on linearly to the vertices of each cell and averaged there by volume:
    (nodes, k)."""
    hats = np.column_stack([1 - body.reference_points.sum(axis=1), body.reference_points])
    corners = np.einsum("vp,cpk->cvk", np.linalg.pinv(hats),
                        at_points.reshape(len(body.nodes.cells), body.points_per_cell, at_points.shape[1]))
    return body.nodes.vertex_mean(corners)
