"""Which linear solver a workpiece gets: factorisation, or in space, from a few thousand unknowns on, iterations."""

from __future__ import annotations

from collections import Counter

from petsc4py import PETSc

from ..errors import ConvergenceError
from .direct import DirectSystem
from .workpiece import Workpiece

# Below, a factorisation takes less time than setting the iterative solver up (benchmarks/solver3d.py).
ITERATIVE_FROM = 3000       # unknowns
MOST_DIRECT = 200_000       # unknowns: beyond, factors in space take more memory than a machine is likely to have
MOST_FAILURES = 3           # in a row, of the iterations, before a body is solved directly for good
# Whose tangents the kernels of the iterative solver know.
KNOWN_TERMS = {"plastic", "incompressibility", "contact", "drag", "inertia"}


def linear_system(workpiece: Workpiece):
    """A direct or an iterative system, as ``settings.linear`` says: "direct", "iterative" or "auto"."""
    wanted = workpiece.settings.linear
    known = workpiece.nodes.dim == 3 and set(workpiece.tangents) <= KNOWN_TERMS
    unknowns = workpiece.space.dofmap.index_map.size_global
    if not known or wanted == "direct" or wanted == "auto" and unknowns < ITERATIVE_FROM:
        return DirectSystem(workpiece)
    return WithFallback(workpiece)


def unknowns_of(workpiece: Workpiece) -> int:
    """Velocities and pressures of all ranks."""
    return int(workpiece.space.dofmap.index_map.size_global)


class WithFallback:
    """An iterative system; where its iterations stall, the same equations are factorised, and it says so.

    Attributes
    ----------
    counts : "solves", "krylov iterations", and those "solved directly" after all · settles : whether :meth:`settle`
        follows the contact
    """

    kind, settles = "iterative", True
    changes = None      # of the contact since a factorisation: what settles here are the iterations

    def __init__(self, workpiece: Workpiece):
        from .iterative.system import IterativeSystem
        self._body = workpiece
        from .settling import Settling
        self.iterative = IterativeSystem(workpiece)
        self._settling = None if workpiece.contact is None else Settling(workpiece)
        self._direct: DirectSystem | None = None
        self._failures, self._news, self._again = 0, [], False
        self.counts: Counter[str] = Counter()

    def follow(self) -> None:
        """Make ready for the present geometry and the present pairs of bodies in contact. Collective."""
        self.iterative.follow()
        self._followed = False

    def assemble(self) -> None:
        """The tangent at the present state."""
        self.iterative.assemble()

    def lift(self, b: PETSc.Vec) -> None:
        """Add to the residual what given velocities that are not met yet do to the other equations, ghosts not summed."""
        self.iterative.lift(b)

    def stiffness(self):
        """Diagonal of the velocities, (nodes, dim), N s/mm."""
        return self.iterative.stiffness()

    def settle(self, b: PETSc.Vec, solve, border) -> None:
        """Follow the contact of the increment that ``solve(b)`` has found by iterations, and solve again. Collective."""
        if self._settling is not None and self._last is self.iterative:
            self._settling.settle(self, b, solve, border)

    @property
    def stands(self) -> bool:
        """Whether the last solve found the increment before right but for an iteration: what has closed or opened since
        is less than the tolerance of a solve."""
        return self._last is self.iterative and self.iterative.stood

    def follow_contact(self) -> None:
        """Take over the tangents of contact anew."""
        self.iterative.follow_contact()
        self._again = True

    def solve(self, b: PETSc.Vec) -> None:
        """Solve for the increment, by iterations if they converge."""
        self.iterative.take_motions(None)
        if not self._iterated(b):
            self._solve_directly(b)

    def solve_bordered(self, b: PETSc.Vec, columns, corner, right, factorised):
        """The same with unknown motions of tools, which are eliminated; (n,) what they are. See ``AppendedBorder``."""
        from .iterative.eliminated import Eliminated
        motions = Eliminated(columns, corner, self._body.nodes.comm)
        self.iterative.take_motions(motions)
        reduced = motions.reduced(b, right)
        iterated = self._iterated(reduced)
        reduced.destroy()
        if iterated:
            return motions.found(self._body.increment.x.petsc_vec.array_r, right)
        return factorised(self._factorising(), b, columns, corner, right)

    def _iterated(self, b: PETSc.Vec) -> bool:
        """Solve by iterations; whether they have converged."""
        again, self._again = self._again, False
        self.counts["solves"] += 1
        if self._failures < MOST_FAILURES:
            try:
                self.iterative.solve(b, again=again)
                self._failures, self._last = 0, self.iterative
                return True
            except ConvergenceError as failure:
                if unknowns_of(self._body) > MOST_DIRECT:
                    raise ConvergenceError(f"the iterative solver stalled: {failure.sentence}", advice="better shaped "
                                           "cells, a smaller solver.penalty_factor or smaller steps") from failure
                self._failures += 1
                self._news.append(f"the iterative solver stalled ({failure.sentence}); solved directly" +
                                  (" from now on" if self._failures == MOST_FAILURES else ""))
            finally:
                self.counts["krylov iterations"] += self.iterative.iterations
        return False

    def _solve_directly(self, b: PETSc.Vec) -> None:
        self._factorising().solve(b)

    def _factorising(self) -> DirectSystem:
        """The direct system at the present state, for the equations that the iterations have not solved."""
        self.counts["solved directly"] += 1
        if self._direct is None:
            self._direct = DirectSystem(self._body)
        if not self._followed:
            self._direct.follow()
            self._followed = True
        self._direct.assemble()
        self._last = self._direct
        return self._direct

    def solve_also(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Another right-hand side for the matrix of the last :meth:`solve`."""
        try:
            self._last.solve_also(b, x)
        except ConvergenceError:        # the iterations for this one stall: then all of them are found directly
            increment = self._body.increment.x.array.copy()
            self._solve_directly(b)
            self._body.increment.x.array[:] = increment
            self._direct.solve_also(b, x)

    def news(self) -> list[str]:
        """What a user wants to hear, since it was asked last, one sentence each."""
        news, self._news = list(dict.fromkeys(self._news)), []
        return news
