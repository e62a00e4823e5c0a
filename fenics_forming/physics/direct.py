"""The linearised flow as one sparse matrix of velocities and pressures, solved by factorisation."""

from __future__ import annotations

from collections import Counter

from petsc4py import PETSc

from .linear import DirectSolver
from .plane_matrix import PlaneMatrix
from .resolving import NONE, FewChanges, FewPoints, Unknowns
from .system import CoupledMatrix, SystemMatrix
from .workpiece import Workpiece

FEW = 4     # points that close or open: as many directions again are as dear as an iteration


class DirectSystem:
    """The tangent of a workpiece, the contact of its bodies included, and its factorisation.

    What the Newton asks of a linear system: :meth:`follow`, :meth:`assemble`, :meth:`lift`, :meth:`stiffness`,
    :meth:`solve`, :meth:`solve_also`, :meth:`news`; ``linear_choice.WithFallback`` is the other one.

    Attributes
    ----------
    counts : "solves" so far · settles : whether :meth:`settle` follows the contact
    """

    kind, settles = "direct", False
    stands = False      # see ``WithFallback.stands``
    changes: FewPoints | None = None     # which points have closed and opened since the factorisation

    def __init__(self, workpiece: Workpiece):
        self.counts: Counter[str] = Counter()
        self._body, interfaces = workpiece, workpiece.interfaces
        if workpiece.nodes.dim == 2 and workpiece.nodes.comm.size == 1:
            self._bulk = PlaneMatrix(workpiece)
        else:
            self._bulk = SystemMatrix(workpiece.tangent_form)
        self.matrix = self._bulk if interfaces is None else CoupledMatrix(self._bulk, interfaces)
        self._solver = None
        self._settling: FewPoints | None = None
        self._few: FewChanges | None = None

    def follow(self) -> None:
        """Make ready for the present geometry and the present pairs of bodies in contact. Collective."""
        if self._body.interfaces is not None and self.matrix.follow(self._body.conditions):
            self._solver = None

    def assemble(self) -> None:
        """The tangent at the present state; rows and columns of given velocities are those of the identity."""
        self.matrix.assemble(self._body.conditions)

    def lift(self, b: PETSc.Vec) -> None:
        """Add to the residual what given velocities that are not met yet do to the other equations, ghosts not summed."""
        self._bulk.lift(b, self._body)

    def stiffness(self):
        """Diagonal of the velocities, (nodes, dim), N s/mm."""
        body = self._body
        body.increment.x.petsc_vec.setArray(self.matrix.petsc.getDiagonal().array)
        body.increment.x.scatter_forward()
        return body.increment.x.array[body.velocity_dofs]

    def solve_also(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Another right-hand side with the factorisation of the last :meth:`solve`."""
        if self.changes is None:
            self._solver.solve(b, x)
        else:
            self._changed().solve(Unknowns(b, NONE)).body.copy(x)

    def solve(self, b: PETSc.Vec) -> None:
        """Factorise, and solve for the increment; after :meth:`follow_contact` with the factors of before."""
        x = self._body.increment.x
        if self.changes is None:
            self.counts["solves"] += 1
            if self._solver is None:
                self._solver = self.solver_of(self.matrix.petsc, self.matrix.rows)
            self._solver.factorise()
        self.solve_also(b, x.petsc_vec)
        x.scatter_forward()

    def solver_of(self, A: PETSc.Mat, rows, appended=None):
        """Factorisation of the matrix, or of one with unknowns appended to it: by fronts where all of the workpiece lies on
        one mesh in the plane, by MUMPS elsewhere. ``rows`` and ``appended`` as of a `FrontalSolver`."""
        if self.matrix.rows is None:
            return DirectSolver(A)
        from .frontal.solver import FrontalSolver
        nodes = self._body.nodes
        corners = nodes.mesh.geometry.x[nodes.cells[:, :3], :2]
        return FrontalSolver(A, rows, corners, self._body.element.dofs, appended)

    def solve_bordered(self, b: PETSc.Vec, columns, corner, right, factorised):
        """Solve with unknown motions of tools, (n,), by the matrix that they are appended to: see ``AppendedBorder``."""
        self.counts["solves"] += 1
        return factorised(self, b, columns, corner, right)

    def settle(self, b: PETSc.Vec, solve, border) -> None:
        """Follow the contact of the increment that ``solve(b)`` has found where few points close or open, for one body in
        the plane with motions of tools behind its unknowns: elsewhere another iteration takes less time. Not where friction
        follows the pressure of the iteration before, with which they would turn round, nor where a ram's energy makes its
        motion, which would end in another step on another number of ranks. Collective."""
        contact = self._body.contact
        if border is None or contact.facets.dim == 3 or self._body.interfaces is not None or any(
                (t.has_friction and t.friction.depends_on_pressure) or (t.is_sought and not t.free.deforms)
                for t in contact.tools):
            return
        self._settling = self._settling or FewPoints(self._body, FEW)
        self._settling.settle(self, b, solve, border)
        self.changes = self._few = None

    def follow_contact(self) -> None:
        """Take over the tangents of contact anew: those of few points have changed since the factorisation. Collective."""
        self.changes, self._few = self._settling, None

    def _changed(self) -> FewChanges:
        if self._few is None:
            self._few = self.changes.changed(self._solve_as_factorised, self._body.increment.x.petsc_vec)
        return self._few

    def _solve_as_factorised(self, right: Unknowns) -> Unknowns:
        found = right.body.duplicate()
        self._solver.solve(right.body, found)
        return Unknowns(found, right.behind)

    def news(self) -> list[str]:
        """What a user wants to hear: nothing."""
        return []
