"""Faces and volumes that carry loads: given at points, handed over as virtual work to a vector of nodal forces."""

from __future__ import annotations

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from ..contact.facets import ContactFacets
from ..kinematics import Kinematics
from ..nodes import Nodes
from . import terms

VOLUME_DEGREE = 4       # a force that is linear in space, a quadratic displacement, and r in axisymmetry


class LoadedFace:
    """Tractions on some facets of a body that does not move its mesh; making one is collective.

    Attributes
    ----------
    facets : `ContactFacets`, its points and its traces
    points : (n, dim) mm, of this rank · normals : (n, dim) out of the body · weights : (n,) mm²
    """

    def __init__(self, space, nodes: Nodes, kinematics: Kinematics, facets: np.ndarray):
        self.facets = ContactFacets(nodes, kinematics, facets)
        w, x = ufl.TestFunction(space), ufl.SpatialCoordinate(nodes.mesh)
        self._form = fem.form(-self.facets.virtual_power(w, kinematics.weight(x)), entity_maps=self.facets.entity_maps)
        self.points = self.facets.trace(nodes.x)
        self.weights = self.facets.weights()
        self.normals = self._outward(nodes)

    def add(self, vector, traction: np.ndarray) -> None:
        """Add the nodal forces of tractions (n, dim), MPa, to a PETSc vector; ghosts are not yet summed."""
        self.facets.traction_function.x.array[: traction.size] = traction.ravel()
        fem_petsc.assemble_vector(vector, self._form)

    def _outward(self, nodes: Nodes) -> np.ndarray:
        """Normals of the facets, turned away from the middle of the cell behind each."""
        count, dim = len(self.facets.facet_nodes), nodes.dim
        normal = self.facets.area_vectors()
        inverse = next(iter(self.facets.entity_maps.values()))
        facet_of = np.zeros(count, dtype=np.int32)
        chosen = np.flatnonzero((inverse >= 0) & (inverse < count))
        facet_of[inverse[chosen]] = chosen
        nodes.mesh.topology.create_connectivity(dim - 1, dim)
        to_cell = nodes.mesh.topology.connectivity(dim - 1, dim)
        cells = to_cell.array[to_cell.offsets[facet_of]]
        middle = nodes.x[nodes.mesh.geometry.dofmap[cells, : dim + 1]].mean(axis=1)
        away = self.points.reshape(normal.shape) - middle[:, None]
        sign = np.sign(np.einsum("fqi,fqi->f", normal, away))
        normal *= sign[:, None, None]
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        return normal.reshape(-1, dim)


class VolumeForce:
    """Forces per volume, given as a function of the place."""

    def __init__(self, space, nodes: Nodes, kinematics: Kinematics):
        mesh, cell, dim = nodes.mesh, nodes.mesh.basix_cell(), nodes.dim
        element = basix.ufl.quadrature_element(cell.name, value_shape=(dim,), degree=VOLUME_DEGREE)
        self._force = fem.Function(fem.functionspace(mesh, element), name="body_force")
        dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": VOLUME_DEGREE, "quadrature_rule": "default"})
        w, x = ufl.TestFunction(space), ufl.SpatialCoordinate(mesh)
        self._form = fem.form(terms.body_force(self._force, w, kinematics.weight(x), dx))
        points, _ = basix.make_quadrature(cell, VOLUME_DEGREE)
        cells = np.arange(len(nodes.cells), dtype=np.int32)
        self._points = fem.Expression(x, points).eval(mesh, cells).reshape(-1, dim)

    def add(self, vector, force) -> None:
        """Add the nodal forces of ``force(x (n, dim))``, N/mm³, to a PETSc vector; ghosts are not yet summed."""
        values = force(self._points.copy())
        self._force.x.array[: values.size] = values.ravel()
        fem_petsc.assemble_vector(vector, self._form)
