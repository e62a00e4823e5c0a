"""The quadratic triangle of the flow in two dimensions, by its tables at the integration points."""

from __future__ import annotations

import basix
import numpy as np

from . import plane_kernels as kernels
from .kinematics import Kinematics
from .nodes import QUADRATURE_DEGREE, Nodes


class PlaneElement:
    """Tables of the element, and strain rates by it.

    Attributes
    ----------
    weights (points,), table (points, 6, 2) reference gradients, shape (points, 6), hats (points, 3) · dofs (cells, 15)
    unknowns of the owned cells: velocities node by node, then pressures
    """

    def __init__(self, nodes: Nodes, kinematics: Kinematics, dofs: np.ndarray):
        cell = nodes.mesh.basix_cell()
        points, self.weights = basix.make_quadrature(cell, QUADRATURE_DEGREE[2])
        quadratic = basix.create_element(basix.ElementFamily.P, cell, 2, basix.LagrangeVariant.gll_warped)
        linear = basix.create_element(basix.ElementFamily.P, cell, 1)
        table = quadratic.tabulate(1, points)[..., 0]
        self.shape, self.table = table[0].copy(), np.moveaxis(table[1:], 0, 2).copy()
        self.hats = linear.tabulate(0, points)[0, :, :, 0].copy()
        self.axisymmetric, self.dofs = kinematics.name == "axisymmetric", dofs[: len(nodes.cells)]
        self._nodes, self._components = nodes, kinematics.components

    def strain_rates(self, unknowns: np.ndarray) -> np.ndarray:
        """Strain rates at the points as Mandel vectors, (cells · points, components), 1/s, of velocities (unknowns,)."""
        out = np.empty((len(self.dofs), len(self.weights), self._components))
        kernels.strain_rates(self._nodes.mesh.geometry.x, self._nodes.cells, self.dofs, self.table, self.shape,
                             self.axisymmetric, unknowns, out)
        return out.reshape(-1, self._components)
