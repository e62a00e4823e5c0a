"""The elastic tool: one factorisation for any number of load cases."""

from __future__ import annotations

from time import perf_counter

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from ...errors import ConvergenceError
from ..linear import DirectSolver
from ..parallel import total
from .body import ToolBody
from .compliance import compliance
from .rigid import free_motions


class ElasticFactor:
    """The stiffness of a body whose material stays elastic, held where it is held; factorised when first used.

    Attributes
    ----------
    factorisations : how often that was, 0 or 1
    """

    def __init__(self, body: ToolBody):
        self.body, self.factorisations = body, 0
        terms = body.elastic_terms(ufl.TrialFunction(body.space), ufl.TestFunction(body.space))
        self.form = fem.form(sum(terms.values()))
        self._direct: DirectSolver | None = None

    @property
    def direct(self) -> DirectSolver:
        if self._direct is None:
            if free := free_motions(self.body):
                ways = "1 way" if free == 1 else f"{free} ways"
                raise ConvergenceError(f"the tool is free to move as a whole in {ways}: what holds it, symmetry planes and "
                                       "springs together do not prevent it")
            matrix = constrained_matrix(self.body, self.form)
            self._direct = DirectSolver(matrix)
            self._direct.factorise()
            self.factorisations += 1
        return self._direct

    def solve(self, load: PETSc.Vec, found: fem.Function, since: fem.Function | None = None) -> float:
        """The displacement under a load, or its increment where ``since`` is the displacement so far and ``load`` what is
        not yet balanced. ``load`` is changed: held components get what they still have to go. Returns the norm of what
        drives the displacement, forces and moved supports, N."""
        body = self.body
        if body.moves_supports:
            lift = body.new_vector()
            x0 = [] if since is None else [since.x.petsc_vec]
            fem_petsc.apply_lifting(lift, [self.form], [body.conditions], x0=x0)
            lift.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
            load.axpy(1.0, lift)
        driving = load.norm()
        set_held_rows(body, load, since)
        self.direct.solve(load, found.x.petsc_vec)
        found.x.scatter_forward()
        return driving


def constrained_matrix(body: ToolBody, form, matrix: PETSc.Mat | None = None) -> PETSc.Mat:
    """The matrix of a form with the springs at single nodes added, rows and columns of held dofs those of the unit."""
    matrix = fem_petsc.create_matrix(form) if matrix is None else matrix
    matrix.zeroEntries()
    fem_petsc.assemble_matrix(matrix, form, bcs=body.conditions)
    matrix.assemble()
    if body.has_point_springs:
        diagonal = matrix.getDiagonal()
        owned = (body.dofs < body.owned) & (body.point_springs > 0)
        diagonal.array[body.dofs[owned]] += body.point_springs[owned]
        matrix.setDiagonal(diagonal)
    return matrix


def set_held_rows(body: ToolBody, vector: PETSc.Vec, since: fem.Function | None = None) -> None:
    """Write how far the held components still have to go into their rows."""
    go = body.held_part * body.held_values
    if since is not None:
        go = go - body.nodal(since)
    own = body.is_held & (body.dofs < body.owned)
    vector.array[body.dofs[own]] = go[own]


def elastic_forces_form(body: ToolBody) -> fem.Form:
    """The virtual work of the elastic stresses and spread springs at the displacement of now."""
    return fem.form(sum(body.elastic_terms(body.displacement, ufl.TestFunction(body.space)).values()))


def elastic_forces(body: ToolBody, form: fem.Form) -> PETSc.Vec:
    """Nodal forces that elastic stresses and all springs hold in balance, N. Collective."""
    vector = body.new_vector()
    fem_petsc.assemble_vector(vector, form)
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    body.add_point_springs(vector)
    if body.heating is not None:
        vector.axpy(-1.0, body.heating.forces(body.heating.strain))
    return vector


class ElasticSolver:
    """Solve an elastic tool for one load case after the other.

    Attributes
    ----------
    force : nodal forces of the loads of the last solve · factor : the factorised stiffness
    plastic : None, as there is no plastic state · reached : 1, since every load can be carried · cuts : 0
    """

    plastic, reached, cuts = None, 1.0, 0

    def __init__(self, body: ToolBody):
        self.body, self.factor = body, ElasticFactor(body)
        self.force = body.new_vector()
        self.seconds = {"solve": 0.0}
        self._internal = None
        self._known: tuple[np.ndarray, np.ndarray] | None = None     # dofs, rising, and their compliance

    def solve(self, loads=(), *, held: float = 1.0, steps: int | None = None) -> int:
        """The displacement under these loads; the number of linear solves, which is 1.

        Parameters
        ----------
        held : the part of their values that the held displacements have · steps : of no meaning here

        Raises
        ------
        ConvergenceError
            if the tool is free to move as a whole.
        """
        start = perf_counter()
        self.force = self.body.external_forces(loads)
        self.body.set_held(held)
        driving, heating = self.force.copy(), self.body.heating
        if heating is not None:
            heating.strain = heating.wanted
            driving.axpy(1.0, heating.forces(heating.strain))
        self.factor.solve(driving, self.body.displacement)
        self.seconds["solve"] += perf_counter() - start
        return 1

    def compliance(self, dofs: np.ndarray) -> np.ndarray:
        """See `compliance.compliance`; it never changes, so that what was found is kept. Collective."""
        found = compliance(self.body, self.factor.direct, dofs, self._known)
        if self._known is None or not np.isin(dofs, self._known[0]).all():
            order = np.argsort(dofs)
            self._known = dofs[order], found[np.ix_(order, order)]
        return found

    def point_stress(self) -> np.ndarray:
        """Stresses at the points, (p, c), MPa."""
        return self.body.hooke(self.body.point_strain())

    def internal_forces(self) -> PETSc.Vec:
        """Nodal forces that the stresses and springs hold in balance, N."""
        if self._internal is None:
            self._internal = elastic_forces_form(self.body)
        return elastic_forces(self.body, self._internal)

    @property
    def thermal_work(self) -> float:
        """Work of the stresses on the thermal strains, raised together from nothing, mJ."""
        if self.body.heating is None:
            return 0.0
        work = 0.5 * self.point_stress()[:, :3].sum(axis=1) * self.body.heating.strain
        return float(total(self.body.nodes.comm, work @ self.body.volumes))

    @property
    def external_work(self) -> float:
        """Work of loads and moved supports, raised together from nothing: half their product with the displacement."""
        balance = self.internal_forces()
        balance.scale(0.5)
        return balance.dot(self.body.displacement.x.petsc_vec)

    plastic_work = 0.0
