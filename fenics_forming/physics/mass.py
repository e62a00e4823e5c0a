r"""Mass of a flowing body: its inertia, its weight, momentum and kinetic energy.

The mass of every integration point stays what it was when the mesh was made, wherever the nodes move: the mass matrix
:math:`M=\int\rho N^TN` is that of the material, mass and momentum do not drift with the volume. The velocities of a node
at two times belong to one material point, so their difference is the material acceleration.

Imported only where a scene asks for inertia or weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem

from .gravity import GRAVITY
from .nodes import Nodes
from .parallel import total
from .terms import inertia, weight_power

DEGREE = 4          # exact for the product of quadratic velocities in straight cells; enough points that M is regular


@dataclass(frozen=True)
class MassProperties:
    """What of the mass acts.

    density : t/mm³, one number or (cells,) · inertia : whether acceleration takes force · weight : whether gravity acts,
    along the negative last axis (y in plane strain, else z)
    """

    density: float | np.ndarray
    inertia: bool = False
    weight: bool = False


class Mass:
    """Mass at the integration points of a body, and the terms that it makes.

    Parameters
    ----------
    nodes, kinematics : of the body · properties : what acts
    space : of velocity and pressure · velocity_dofs : (nodes, dim) numbers of the velocities in it

    Attributes
    ----------
    of_points : (cells, points) t; in plane strain t/mm
    per_step : 1 / interval since the velocity before, 1/s (a UFL constant); ``before``, that velocity (in ``space``)
    """

    def __init__(self, nodes: Nodes, kinematics, properties: MassProperties, space, velocity_dofs: np.ndarray):
        self.nodes, self.kinematics, self.properties = nodes, kinematics, properties
        self._velocity_dofs = velocity_dofs
        mesh, cell = nodes.mesh, nodes.mesh.basix_cell()
        points, self._weights = basix.make_quadrature(cell, DEGREE)
        element = basix.create_element(basix.ElementFamily.P, cell, 2, basix.LagrangeVariant.gll_warped)
        table = element.tabulate(1, points)[..., 0]
        self._shapes, self._slopes = table[0], table[1:]
        self.density = fem.Function(fem.functionspace(mesh, basix.ufl.quadrature_element(cell.name, degree=DEGREE)))
        self.before, self.per_step = fem.Function(space), fem.Constant(mesh, 0.0)
        self.of_points = np.asarray(properties.density).reshape(-1, 1) * self._measure()
        self.follow()

    # ------------------------------------------------------------------ terms
    def terms(self, v, dv, w, weight) -> tuple[dict, dict, dict]:
        """Terms, their tangents, and their power meters (UFL), by name."""
        dx = ufl.Measure("dx", domain=self.nodes.mesh,
                         metadata={"quadrature_degree": DEGREE, "quadrature_rule": "default"})
        terms, tangents, meters = {}, {}, {}
        if self.properties.inertia:
            before = ufl.split(self.before)[0]
            terms["inertia"] = inertia(v - before, w, self.density, self.per_step, weight, dx)
            tangents["inertia"] = inertia(dv, w, self.density, self.per_step, weight, dx)
            meters["inertia"] = inertia(v - before, v, self.density, self.per_step, weight, dx)
        if self.properties.weight:
            gravity = ufl.as_vector([0.0] * (self.nodes.dim - 1) + [-GRAVITY])
            terms["weight"] = weight_power(gravity, w, self.density, weight, dx)
            meters["weight"] = -weight_power(gravity, v, self.density, weight, dx)
        return terms, tangents, meters

    def inertia_of_points(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Shape functions (points, 10) and linear ones (points, 4) at the points, and the tangent of the inertia there,
        (cells, points), t/s: for kernels that build matrices by themselves."""
        points, _ = basix.make_quadrature(self.nodes.mesh.basix_cell(), DEGREE)
        hats = basix.create_element(basix.ElementFamily.P, self.nodes.mesh.basix_cell(), 1).tabulate(0, points)[0, :, :, 0]
        return self._shapes, hats, float(self.per_step.value) * self.of_points

    def start_from(self, velocity: np.ndarray, interval: float) -> None:
        """The solve to come ends ``interval``, s, after the nodal velocities (nodes, dim) were those given."""
        self.follow()
        self.before.x.array[self._velocity_dofs] = velocity
        self.per_step.value = 1.0 / interval

    def follow(self) -> None:
        """The density of the points where the nodes are now: their mass over their present volume."""
        values = self.of_points / self._measure()
        self.density.x.array[: values.size] = values.ravel()

    def _measure(self) -> np.ndarray:
        """Volume that belongs to the points, (cells, points), mm³ (mm² in plane strain)."""
        x = self.nodes.x[self.nodes.cells]
        jacobian = np.einsum("kqa,cad->cqkd", self._slopes, x)
        measure = np.abs(np.linalg.det(jacobian)) * self._weights
        places = np.einsum("qa,cad->cqd", self._shapes, x).reshape(-1, self.nodes.dim)
        return measure * np.broadcast_to(self.kinematics.weight_at(places), measure.size).reshape(measure.shape)

    # ------------------------------------------------------------------ what moves
    def at_points(self, nodal: np.ndarray) -> np.ndarray:
        """A nodal vector field (nodes, dim) at the points, (cells, points, dim)."""
        return np.einsum("qa,cad->cqd", self._shapes, nodal[self.nodes.cells])

    def total(self) -> float:
        """Mass of the body, t (t/mm in plane strain). Collective."""
        return float(total(self.nodes.comm, self.of_points.sum()))

    def total_per_step(self) -> float:
        """Mass over the interval of the present solve, t/s. Collective."""
        return self.total() * float(self.per_step.value)

    def momentum(self, velocity: np.ndarray) -> np.ndarray:
        """Sum of mass times velocity, (dim,), N s; in axisymmetry only the axial component is a resultant. Collective."""
        return total(self.nodes.comm, np.einsum("cq,cqd->d", self.of_points, self.at_points(velocity)))

    def kinetic_energy(self, velocity: np.ndarray) -> float:
        """mJ (mJ/mm in plane strain). Collective."""
        v = self.at_points(velocity)
        return 0.5 * float(total(self.nodes.comm, np.einsum("cq,cqd,cqd->", self.of_points, v, v)))

    def weight_force(self) -> np.ndarray:
        """Weight of the body, (dim,), N. Collective."""
        force = np.zeros(self.nodes.dim)
        if self.properties.weight:
            force[-1] = -GRAVITY * self.total()
        return force

    def speeds(self, velocity: np.ndarray) -> tuple[float, float]:
        """Root mean squares of the velocity, and of what is left of it without its rigid part, mm/s. Collective."""
        mass, comm = self.of_points, self.nodes.comm
        whole = self.total()
        v, x = self.at_points(velocity), self.at_points(self.nodes.x)
        fixed = slice(1, None) if self.kinematics.name == "axisymmetric" else slice(None)
        mean = total(comm, np.stack([np.einsum("cq,cqd->d", mass, f) for f in (v, x)])) / whole
        speed = float(np.sqrt(total(comm, np.einsum("cq,cqd,cqd->", mass, v, v)) / whole))
        v = v.copy()
        v[..., fixed] -= mean[0, fixed]
        if self.kinematics.name != "axisymmetric":
            v -= self._spin(v, x - mean[1])
        return speed, float(np.sqrt(total(comm, np.einsum("cq,cqd,cqd->", mass, v, v)) / whole))

    def _spin(self, v: np.ndarray, arm: np.ndarray) -> np.ndarray:
        """The rigid rotation with the same moment of momentum, at the points."""
        if self.nodes.dim == 2:
            arm, v = (np.concatenate([a, np.zeros_like(a[..., :1])], axis=-1) for a in (arm, v))
        square = np.einsum("cq,cqi,cqj->ij", self.of_points, arm, arm)
        square, moment = (total(self.nodes.comm, value)
                          for value in (square, np.einsum("cq,cqd->d", self.of_points, np.cross(arm, v))))
        rate = np.linalg.lstsq(np.trace(square) * np.eye(3) - square, moment, rcond=1e-12)[0]
        return np.cross(rate, arm)[..., : self.nodes.dim]

    def diagonal(self) -> np.ndarray:
        """Diagonal of the mass matrix for one component, (nodes,), t; complete on every rank. Collective."""
        shares = np.einsum("cq,qa->ca", self.of_points, self._shapes**2)
        return self.nodes.sum_at_all(np.bincount(self.nodes.cells.ravel(), shares.ravel(), self.nodes.count))

    def remember(self, of_points: np.ndarray) -> None:
        """Take over saved masses of the points, a row a cell: made from nodes that have moved they would be others, t."""
        self.of_points[:] = of_points.reshape(self.of_points.shape)
        self.follow()

    def keep_total(self, mass: float) -> None:
        """Scale the masses so that the body has the given one, t. Collective."""
        self.of_points *= mass / self.total()
        self.follow()
