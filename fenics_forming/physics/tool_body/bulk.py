r"""What the material of a tool answers to a trial displacement: an elastic body, or one with a plastic state at its points.

Both give a solver that goes in steps (``plastic``) the nodal forces of the trial, its tangent, and the work of an accepted
step.  The elastic one keeps nothing at the points: its forces are those of the displacement, its tangent never changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from ..parallel import total
from .body import DEGREE, ToolBody
from .elastic import constrained_matrix, elastic_forces, elastic_forces_form


@dataclass(frozen=True)
class PlasticState:
    """The state at the points: stress, strain, plastic strain (p, c), and effective plastic strain (p,)."""

    stress: np.ndarray
    strain: np.ndarray
    plastic_strain: np.ndarray
    effective: np.ndarray


class ElasticBulk:
    """A body that stays elastic.

    Parameters
    ----------
    form : its stiffness (``ElasticFactor.form``)
    """

    plastic, flows, tangents = None, False, np.empty(0)

    def __init__(self, body: ToolBody, form):
        self.body, self._form = body, form
        self._internal = None
        self._before: np.ndarray | None = None      # stresses at the start of a step in which heat does work on them

    def respond(self) -> bool:
        """Whether any point flows: none."""
        return False

    def forces(self) -> PETSc.Vec:
        """Nodal forces of the stresses and of the springs, N. Collective."""
        if self._internal is None:
            self._internal = elastic_forces_form(self.body)
        return elastic_forces(self.body, self._internal)

    def tangent(self, matrix: PETSc.Mat | None) -> PETSc.Mat:
        """The stiffness, made once. Collective."""
        return constrained_matrix(self.body, self._form) if matrix is None else matrix

    def point_stress(self) -> np.ndarray:
        """Stresses at the points of the displacement of now, (p, c), MPa."""
        return self.body.hooke(self.body.point_strain())

    def heats(self) -> None:
        """A thermal strain is about to change from what it is in the accepted state, which is that of now."""
        self._before = self.point_stress()

    def accept(self, heating: np.ndarray | None) -> tuple[float, float]:
        """Plastic and thermal work of the step, mJ; ``heating`` (p,) the thermal strain of the step. Collective."""
        if heating is None:
            return 0.0, 0.0
        mean = 0.5 * (self._before + self.point_stress())
        return 0.0, float(total(self.body.nodes.comm, (mean[:, :3].sum(axis=1) * heating) @ self.body.volumes))

    def take_back(self) -> None:
        """Nothing: the state is the displacement."""

    def use_accepted_tangent(self) -> None:
        """Nothing: there is one tangent."""

    def state(self) -> tuple:
        """Nothing: the state is the displacement."""
        return ()

    def go_back(self, state: tuple) -> None:
        """Nothing."""

    def cellwise(self) -> dict[str, np.ndarray]:
        """Nothing that a resumed run must know."""
        return {}

    def remember(self, cellwise: dict[str, np.ndarray], flows: bool) -> None:
        """Nothing to take over."""


class PlasticBulk:
    """A body that can yield.

    Attributes
    ----------
    plastic : `PlasticState`, the accepted one · flows : whether any point flowed in the accepted step
    tangents : (p, k, k) of the last response · stress : Function, what the internal forces are of
    """

    def __init__(self, body: ToolBody):
        self.body = body
        mesh, k = body.nodes.mesh, len(body.state.held)
        self.upper = np.triu_indices(k)
        element = lambda size: basix.ufl.quadrature_element(  # noqa: E731
            mesh.basix_cell().name, value_shape=(size,), degree=DEGREE)
        self.stress = fem.Function(fem.functionspace(mesh, element(k)), name="stress")
        self.packed = fem.Function(fem.functionspace(mesh, element(len(self.upper[0]))), name="tangent")
        du, w = ufl.TrialFunction(body.space), ufl.TestFunction(body.space)
        self._internal = fem.form(sum(body.plastic_terms(self.stress, w).values()))
        self.tangent_form = fem.form(sum(body.plastic_tangents(self.packed, du, w).values()))
        points, c = len(body.volumes), body.state.components
        self.plastic = self._trial = PlasticState(*(np.zeros((points, c)) for _ in range(3)), np.zeros(points))
        self.flows = self._trial_flows = False
        self.tangents = self._accepted_tangents = np.empty((points, k, k))

    def respond(self) -> bool:
        """Stresses and tangents at the points for the present displacement; whether any point flows. Collective."""
        body, before = self.body, self.plastic
        strain = body.point_strain()
        if body.state.is_plane_stress:
            strain[:, 2] = before.strain[:, 2]
        stress, plastic = np.empty_like(strain), before.plastic_strain.copy()
        effective, flowing = before.effective.copy(), 0
        self.tangents = np.empty((len(strain),) + 2 * (len(body.state.held),))
        for law, cells in body.parts:
            rows = body.points_of(cells)
            own = strain[rows]
            found = body.state.return_map(law, own, plastic[rows], effective[rows])
            strain[rows], stress[rows], plastic[rows] = own, found.stress, found.plastic_strain
            effective[rows] = found.effective
            self.tangents[rows] = body.state.narrowed_tangent(found.tangent)
            flowing += np.count_nonzero(found.yielding)
        self._trial = PlasticState(stress, strain, plastic, effective)
        self._write(stress)
        self._trial_flows = total(body.nodes.comm, float(flowing)) > 0
        return self._trial_flows

    def _write(self, stress: np.ndarray) -> None:
        narrow = self.body.state.narrowed(stress)
        self.stress.x.array[: narrow.size] = narrow.ravel()

    def forces(self) -> PETSc.Vec:
        """Nodal forces of the stresses and of the springs, N. Collective."""
        vector = self.body.new_vector()
        fem_petsc.assemble_vector(vector, self._internal)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        self.body.add_point_springs(vector)
        return vector

    def pack(self) -> None:
        """Write the tangents of the last response where the form takes them from."""
        tangents = self.tangents[:, self.upper[0], self.upper[1]]
        self.packed.x.array[: tangents.size] = tangents.ravel()

    def tangent(self, matrix: PETSc.Mat | None) -> PETSc.Mat:
        """The consistent tangent of the last response. Collective."""
        self.pack()
        return constrained_matrix(self.body, self.tangent_form, matrix)

    def point_stress(self) -> np.ndarray:
        """Stresses at the points of the accepted state, (p, c), MPa."""
        return self.plastic.stress

    def heats(self) -> None:
        """Nothing: the stresses of the accepted state are kept."""

    def accept(self, heating: np.ndarray | None) -> tuple[float, float]:
        """Plastic and thermal work of the step, mJ, by the trapezoidal rule, which is exact for the elastic part;
        ``heating`` (p,) the thermal strain of the step. The trial state becomes the state. Collective."""
        body, before, after = self.body, self.plastic, self._trial
        mean = 0.5 * (before.stress + after.stress)
        works = np.array([np.einsum("pi,pi->p", mean, after.plastic_strain - before.plastic_strain) @ body.volumes,
                          0.0 if heating is None else (mean[:, :3].sum(axis=1) * heating) @ body.volumes])
        self.plastic, self.flows, self._accepted_tangents = after, self._trial_flows, self.tangents
        return tuple(float(work) for work in total(body.nodes.comm, works))

    def take_back(self) -> None:
        """Back to the accepted state."""
        self._trial = self.plastic
        self._write(self.plastic.stress)

    def use_accepted_tangent(self) -> None:
        """Make the tangent that of the accepted state."""
        self.tangents = self._accepted_tangents

    def state(self) -> tuple:
        """The accepted state, for :meth:`go_back`: nothing in it is changed any more."""
        return self.plastic, self.flows, self._accepted_tangents

    def go_back(self, state: tuple) -> None:
        """Take over what :meth:`state` gave."""
        self.plastic, self.flows, self._accepted_tangents = state

    def cellwise(self) -> dict[str, np.ndarray]:
        """What a resumed run must know of the points, by name, (p, ...)."""
        return {**vars(self.plastic), "tangents": self._accepted_tangents}

    def remember(self, cellwise: dict[str, np.ndarray], flows: bool) -> None:
        """Take over what :meth:`cellwise` gave, and ``flows``."""
        self.flows = flows
        self.plastic = PlasticState(**{name: cellwise[name].reshape(old.shape) for name, old in vars(self.plastic).items()})
        self.tangents = self._accepted_tangents = cellwise["tangents"].reshape(self.tangents.shape)
