r"""A tool as a deformable body: displacements u in the frame that moves with the tool, small strains.

Find u with, for all w that vanish where u is held,

.. math:: \int\sigma(u):D(w)\,dV + \int k\,(u\cdot d)(w\cdot d)\,d\Gamma = \int t\cdot w\,d\Gamma + \int f\cdot w\,dV .

The mesh never moves.  P2 displacements; the points of degree 2 (3 a triangle, 4 a tetrahedron) carry the stresses.  They
are the fewest that leave no mode without stiffness, and few enough that plastic flow does not lock: the thick cylinder of
4 x 4 cells collapses within 1e-4 of the exact pressure, with the 6 points of degree 3 or 4 4 % above it, and the sphere of
8 x 8 not at all.
"""

from __future__ import annotations

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from ..nodes import Nodes
from ..parallel import highest, total
from ..plasticity import elastic_tangent
from . import terms
from .faces import LoadedFace, VolumeForce
from .heating import Heating
from .stress_state import STATES, StressState
from .supports import PointSprings, Springs, nodes_at

DEGREE = 2


class ToolBody:
    """Spaces, terms and supports of one deformable tool.

    Parameters
    ----------
    nodes : the order-2 mesh by its nodes
    kinematics : "plane_strain", "plane_stress", "axisymmetric", "3d", or a `StressState`
    material : ``laws.Elasticity``, or pairs (law, cells) that share out all local cells of the mesh
    held : `FixedDisplacement`, `FixedPoint` · springs : `Springs`, `PointSprings`

    Attributes
    ----------
    displacement : Function, mm · dofs : (nodes, dim) · owned : number of dofs of this rank
    heating : `Heating`, None of a tool without temperature
    """

    def __init__(self, nodes: Nodes, *, kinematics: StressState | str, material, held=(), springs=()):
        self.nodes = nodes
        self.state = STATES[kinematics] if isinstance(kinematics, str) else kinematics
        mesh, dim = nodes.mesh, nodes.dim
        cell = mesh.basix_cell()
        self.degree = DEGREE
        self.space = V = fem.functionspace(mesh, basix.ufl.element("Lagrange", cell, 2, shape=(dim,)))
        self.displacement = fem.Function(V, name="displacement")
        blocks = np.empty(nodes.count, dtype=np.int32)
        blocks[mesh.geometry.dofmap] = V.dofmap.list
        self.dofs = blocks[:, None] * dim + np.arange(dim, dtype=np.int32)
        self.owned = V.dofmap.index_map.size_local * dim

        self.reference_points, weights = basix.make_quadrature(cell, DEGREE)
        self.points_per_cell = len(weights)
        self.measure = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": DEGREE, "quadrature_rule": "default"})
        self.weight = self.state.kinematics.weight(ufl.SpatialCoordinate(mesh))
        self._cells = np.arange(len(nodes.cells), dtype=np.int32)
        self._strain = fem.Expression(self.strain(self.displacement), self.reference_points)
        stretch = fem.Expression(abs(ufl.JacobianDeterminant(mesh)) * self.weight, self.reference_points)
        self.volumes = (stretch.eval(mesh, self._cells) * weights).ravel()
        self._take_material(material)
        self._hold(held)
        self._support(springs)
        self._faces: dict[bytes, LoadedFace] = {}
        self._volume_force: VolumeForce | None = None
        self.heating: Heating | None = None
        zero = fem.Constant(mesh, np.zeros(dim))
        self._no_force = fem.form(ufl.inner(zero, ufl.TestFunction(V)) * self.measure)

    # ------------------------------------------------------------------ material
    def _take_material(self, material) -> None:
        """The law of every cell; those of the elastic form as numbers per cell."""
        every = np.arange(len(self.nodes.mesh.geometry.dofmap), dtype=np.int32)
        self.parts = [(material, every)] if hasattr(material, "young") else [(m, np.asarray(c)) for m, c in material]
        space = fem.functionspace(self.nodes.mesh, ("DG", 0))
        self._lame, self._shear = fem.Function(space), fem.Function(space)
        for law, cells in self.parts:
            own = space.dofmap.list[cells, 0]
            self._lame.x.array[own] = self.state.lame(law)
            self._shear.x.array[own] = law.shear_modulus
        given = np.concatenate([cells for _, cells in self.parts])
        if not np.array_equal(np.sort(given), every):
            raise ValueError("the parts of the material must share out all local cells, ghosts included, each once")

    @property
    def yields(self) -> bool:
        """Whether any part can become plastic."""
        return any(law.yields for law, _ in self.parts)

    def points_of(self, cells: np.ndarray) -> np.ndarray:
        """Rows of the points of the owned ones of some cells, (p,)."""
        own = cells[cells < len(self.nodes.cells)]
        return (own[:, None] * self.points_per_cell + np.arange(self.points_per_cell)).ravel()

    # ------------------------------------------------------------------ forms
    def strain(self, u):
        """Strain of a displacement as the Mandel vector of the kinematics (UFL)."""
        return self.state.kinematics.strain_rate(u)

    def _spring_terms(self, u, w):
        return {f"spring_{i}": terms.spring(u, w, direction, stiffness, self.weight, ds)
                for i, (direction, stiffness, ds) in enumerate(self._springs)}

    def elastic_terms(self, u, w) -> dict:
        """The virtual works of the elastic tool by name."""
        kin = self.state.kinematics
        return {"elastic": terms.elastic(u, w, self.strain, kin.divergence, self._lame, self._shear, self.weight,
                                         self.measure), **self._spring_terms(u, w)}

    def plastic_terms(self, stress, w) -> dict:
        """The virtual works by name of a stress known at the points."""
        return {"internal": terms.internal(stress, self.strain(w), self.weight, self.measure),
                **self._spring_terms(self.displacement, w)}

    def plastic_tangents(self, packed, du, w) -> dict:
        """Their derivatives by name."""
        return {"internal": terms.tangent(packed, self.strain(du), self.strain(w), self.weight, self.measure),
                **self._spring_terms(du, w)}

    # ------------------------------------------------------------------ supports
    def _hold(self, held) -> None:
        """Marks and values of the held components at the nodes, the same on all ranks that share a node."""
        n = self.nodes
        marks, values = np.zeros((n.count, n.dim)), np.zeros((n.count, n.dim))
        for condition in held:
            at, i = condition.nodes(n), condition.component
            marks[at, i] = 1.0
            values[at, i] = condition.value(n.x[at]) if callable(condition.value) else condition.value
        sums = n.sum_at_all(np.concatenate([marks, values], axis=1))
        marks, values = sums[:, : n.dim], sums[:, n.dim:]
        self.is_held = marks > 0
        self.held_values = np.divide(values, marks, out=np.zeros_like(values), where=self.is_held)
        self.fixed_dofs = np.sort(self.dofs[self.is_held])
        self.conditions, self._condition_values = [], []
        for i in range(n.dim):
            scalar, _ = self.space.sub(i).collapse()
            value = fem.Function(scalar)
            blocks = np.sort(self.dofs[self.is_held[:, i], 0] // n.dim).astype(np.int32)
            self._condition_values.append(value)
            self.conditions.append(fem.dirichletbc(value, [blocks * n.dim + i, blocks], self.space.sub(i)))
        self.held_part = 0.0
        self.moves_supports = highest(n.comm, float(np.abs(self.held_values).max(initial=0.0))) > 0

    def set_held(self, part: float) -> None:
        """Give the held components ``part`` of their values."""
        self.held_part = part
        for i, function in enumerate(self._condition_values):
            at = self.is_held[:, i]
            function.x.array[self.dofs[at, 0] // self.nodes.dim] = part * self.held_values[at, i]

    def _support(self, springs) -> None:
        mesh, dim = self.nodes.mesh, self.nodes.dim
        spread = [s for s in springs if isinstance(s, Springs)]
        entities = [(i, fem.compute_integration_domains(fem.IntegralType.exterior_facet, mesh.topology,
                                                        np.sort(s.facets).astype(np.int32), dim - 1))
                    for i, s in enumerate(spread)]
        ds = ufl.Measure("ds", domain=mesh, subdomain_data=entities) if spread else None
        axes = [ufl.as_vector([float(i == j) for j in range(dim)]) for i in range(dim)]
        self._springs = [(ufl.FacetNormal(mesh) if s.component is None else axes[s.component],
                          fem.Constant(mesh, float(s.stiffness)), ds(i)) for i, s in enumerate(spread)]
        self._spread = spread
        self.point_springs = np.zeros((self.nodes.count, dim))
        for s in springs:
            if isinstance(s, PointSprings):
                self.point_springs[nodes_at(self.nodes, s.points), s.component] += s.stiffness
        self.point_springs[self.is_held] = 0.0
        self.has_point_springs = any(isinstance(s, PointSprings) for s in springs)

    def spread_springs(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Points (n, dim) of the springs on facets, and the directions (n, dim) in which they push. Collective."""
        found = []
        for springs in self._spread:
            face = self.face(springs.facets)
            axis = None if springs.component is None else np.eye(self.nodes.dim)[springs.component]
            found.append((face.points, face.normals if axis is None else np.broadcast_to(axis, face.points.shape)))
        return found

    # ------------------------------------------------------------------ loads
    def face(self, facets: np.ndarray) -> LoadedFace:
        """The points of some facets, made once for each set of facets. Collective."""
        key = np.sort(facets).astype(np.int32).tobytes()
        known = total(self.nodes.comm, float(key in self._faces)) == self.nodes.comm.size
        if not known:
            self._faces[key] = LoadedFace(self.space, self.nodes, self.state.kinematics, facets)
        return self._faces[key]

    @property
    def volume_force(self) -> VolumeForce:
        if self._volume_force is None:
            self._volume_force = VolumeForce(self.space, self.nodes, self.state.kinematics)
        return self._volume_force

    def new_vector(self) -> PETSc.Vec:
        """A vector of nodal forces, all zero."""
        return fem_petsc.create_vector(self._no_force)

    def external_forces(self, loads) -> PETSc.Vec:
        """The nodal forces of all loads together, N."""
        vector = self.new_vector()
        for load in loads:
            load.add_to(vector, self)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        return vector

    def set_temperature(self, temperature, stress_free: float = 20.0) -> None:
        """Temperature of the next solve, at the nodes (nodes,) or everywhere, degC, and that without thermal strain."""
        if self.heating is None:
            self.heating = Heating(self)
        self.heating.set_temperature(temperature, stress_free)

    def set_thermal_strain(self, strain: np.ndarray) -> None:
        """Thermal strains (p,) of now and of the next solve."""
        if self.heating is None:
            self.heating = Heating(self)
        self.heating.strain = self.heating.wanted = strain

    # ------------------------------------------------------------------ fields
    def nodal(self, function: fem.Function | None = None) -> np.ndarray:
        """Nodal values (nodes, dim) of a function of the space, without one of the displacement, mm (a copy)."""
        return (self.displacement if function is None else function).x.array[self.dofs]

    def nodal_forces(self, vector: PETSc.Vec) -> np.ndarray:
        """A vector of forces as (nodes, dim), with the values of the ghosts."""
        function = fem.Function(self.space)
        function.x.array[: self.owned] = vector.array_r[: self.owned]
        function.x.scatter_forward()
        return self.nodal(function)

    def point_strain(self) -> np.ndarray:
        """Strains at the points that stress the material, all components, (p, c): without the thermal ones; in plane stress
        the one across is not set."""
        values = self._strain.eval(self.nodes.mesh, self._cells)
        strain = self.state.widened(values.reshape(len(self.volumes), len(self.state.held)))
        if self.heating is not None:
            strain[:, :3] -= self.heating.strain[:, None]
        return strain

    def hooke(self, strain: np.ndarray) -> np.ndarray:
        """Stresses of elastic strains (p, c) by the law of each part, (p, c), MPa."""
        stress = np.empty_like(strain)
        for law, cells in self.parts:
            rows = self.points_of(cells)
            part = strain[rows]
            if self.state.is_plane_stress:
                part[:, 2] = -law.poisson / (1 - law.poisson) * (part[:, 0] + part[:, 1])
            stress[rows] = part @ elastic_tangent(law, self.state.components)
        return stress

    def add_point_springs(self, vector: PETSc.Vec) -> None:
        """Add the forces of the springs at single nodes to a vector of internal forces."""
        if not self.has_point_springs:
            return
        forces = self.point_springs * self.nodal()
        owned = (self.dofs < self.owned) & (self.point_springs > 0)
        vector.array[self.dofs[owned]] += forces[owned]

    def spring_energy(self) -> float:
        """Energy stored in the springs, half of their virtual work on the displacement itself, mJ."""
        own = self.dofs < self.owned
        u = self.nodal()
        energy = 0.5 * float((self.point_springs * u**2)[own].sum())
        if self._springs:
            works = self._spring_terms(self.displacement, self.displacement)
            energy += 0.5 * fem.assemble_scalar(fem.form(sum(works.values())))
        return float(total(self.nodes.comm, energy))

    def elastic_energy(self, stress: np.ndarray) -> float:
        """Energy stored in the material by stresses (p, c): 1/2 (s:s / 2G + p² / K) over the volume, mJ."""
        density = np.empty(len(stress))
        for law, cells in self.parts:
            rows = self.points_of(cells)
            compliance = np.linalg.inv(elastic_tangent(law, self.state.components))
            density[rows] = 0.5 * np.einsum("pi,ij,pj->p", stress[rows], compliance, stress[rows])
        return float(total(self.nodes.comm, density @ self.volumes))
