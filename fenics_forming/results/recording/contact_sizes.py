"""Contacts that are smaller than the elements on them, or than the way of a roll in a step: their force is not to be
believed, and that has to be said."""

from __future__ import annotations

import numpy as np

from ...physics.facets import mean_lengths
from ...process.approach import NEAR

# Sides across a contact. Measured, a ball of 6 mm into a block about the axis, against 8 sides or more: with two or more
# the force was off by up to 6 %, with fewer by 5 to 56 %, and lost altogether where a large element had been dented.
FEW = 2.0
COUNTS = 0.1        # of the largest force of any tool: less says nothing of the process
WANTED = 4.0        # sides across, to be advised; and steps in which a roll takes the body through its gap
# Of the contact, the way of the surface of a roll in a step. Measured, a strip of 1 mm that rolls of 200 mm make 2 %
# thinner, on an arc of 1.4 mm: against steps of 0.3 arcs, the force was 11 % low with 0.7 and 35 % with 1.4.
FAR = 0.5
ALIKE = 1.25        # ratio of two forces of a roll between which its longest contact counts: few of its points may touch


class ContactSizes:
    """How wide the contact of every tool was when it pressed hardest, and how long the sides of the elements there.

    The width follows from the spread of the places that are pressed, about mirror planes that they reach: that of a strip
    of variance s² is √12 s. In space the smaller one of the two along the surface counts. Places far apart, as of a flash
    and of a cavity, count as one wide contact.

    Attributes
    ----------
    largest : tool → force, N (∫ p dΓ), step, width and side, mm
    passed : roll → force, step, length of the contact along the motion of the roll, ``arc``, and ``way`` in a step, mm
    """

    def __init__(self, run):
        self._run = run
        self.largest: dict[str, dict[str, float]] = {}
        self.passed: dict[str, dict[str, float]] = {}

    def look(self, step: int, dt: float) -> None:
        """Take notice of the contact as it is now, before a step of ``dt``, s. Collective."""
        contact = self._run.body.contact
        for tool in contact.tools if contact is not None else ():
            force = float(contact.facets.integral(tool.state.pressure * contact.weights))
            if force > self.largest.get(tool.name, {"force": 0.0})["force"]:
                spread, side, _ = self._measure(contact, tool, tool.state.pressure > 0)
                widest = np.linalg.eigvalsh(spread)[1]      # in the plane the greater of two, in space the middle of three
                self.largest[tool.name] = {"force": force, "step": step, "width": _width(widest), "side": side}
            if self._rolls(tool):
                self._pass(contact, tool, force, step, dt)

    def _pass(self, contact, tool, force: float, step: int, dt: float) -> None:
        """Take notice of a roll that presses; of forces that are alike, the contact that is passed slowest counts."""
        before = self.passed.get(tool.name, {"force": 0.0, "way": 0.0, "arc": 1.0})
        touching = (tool.state.pressure > 0) & (tool.state.gap <= NEAR * self._run.body.size)     # not what is to land
        if ALIKE * force <= before["force"] or not contact.facets.integral(touching * contact.weights):
            return
        spread, side, velocity = self._measure(contact, tool, touching)
        speed = float(np.linalg.norm(velocity))
        arc = max(_width(velocity @ spread @ velocity / speed**2), side) if speed > 0 else side
        if force > ALIKE * before["force"] or speed * dt * before["arc"] < before["way"] * arc:
            self.passed[tool.name] = {"force": force, "step": step, "arc": arc, "way": speed * dt}

    def _rolls(self, tool) -> bool:
        """Whether the body runs past the tool: one that turns, and is not a plate that turns in itself."""
        return tool.motion.centre is not None and self._run.scene.tools[tool.name].shape.kind != "plane"

    def _measure(self, contact, tool, pressed: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
        """Of the surface of the ``pressed`` points (points,): their spread, mm² (dim, dim), the mean side of the elements
        on it, mm, and the mean velocity of the tool along it, mm/s (dim,)."""
        facets, dim = contact.facets, contact.points.shape[1]
        at, weights = contact.points[pressed], contact.weights[pressed]
        weights = weights / self._run.body.workpiece.kinematics.weight_at(at)
        lengths = mean_lengths(self._run.nodes.x[facets.facet_nodes[:, :dim]])
        of_sides = np.repeat(lengths, facets.points_per_facet)[pressed]
        velocity, normal = tool.state.tool_velocity[pressed], tool.state.normal[pressed]
        along = velocity - np.einsum("pi,pi->p", velocity, normal)[:, None] * normal
        sums = facets.integral(np.column_stack([
            weights, weights * of_sides, weights[:, None] * at, weights[:, None] * along,
            (weights[:, None, None] * at[:, :, None] * at[:, None]).reshape(-1, dim * dim)]))
        area, side, mean, velocity = sums[0], sums[1] / sums[0], *(sums[2:2 + 2 * dim] / sums[0]).reshape(2, dim)
        spread = sums[2 + 2 * dim:].reshape(dim, dim) / area - np.outer(mean, mean)
        for axis, place in self._mirrors().items():
            if float(facets.integral(np.abs(at[:, axis] - place) < 0.5 * of_sides)):
                of_both = spread[axis, axis] + (mean[axis] - place) ** 2
                spread[axis], spread[:, axis], velocity[axis] = 0.0, 0.0, 0.0
                spread[axis, axis] = of_both
        return spread, float(side), velocity

    def _mirrors(self) -> dict[int, float]:
        surface, given = self._run.body.free_surface, self._run.mirrors
        return surface.mirrors if surface is not None else {a: at for planes in given.values() for a, at in planes.items()}

    def doubts(self) -> list[str]:
        """A sentence where a large force came from a contact of too few elements, of the narrowest such contact; and one
        where rolls take the body through their gap in few steps, of the fastest of them."""
        most = max((found["force"] for found in self.largest.values()), default=0.0)
        large = {name for name, found in self.largest.items() if found["force"] >= COUNTS * most}
        across = {name: self.largest[name]["width"] / self.largest[name]["side"] for name in large}
        share = {name: found["way"] / found["arc"] for name, found in self.passed.items() if name in large}
        narrowest, fastest = min(across, key=across.get, default=None), max(share, key=share.get, default=None)
        return [*([self._sentence(narrowest)] if across and across[narrowest] < FEW else []),
                *([self._passing(fastest)] if share and share[fastest] > FAR else [])]

    def _passing(self, name: str) -> str:
        found = self.passed[name]
        return (f"the surface of '{name}' moves by {found['way']:.2g} mm in a step, and its contact was only "
                f"{found['arc']:.2g} mm long (step {found['step']}): what the body does in it between two rows is lost, "
                f"and its force may be too low, even 0; take steps of {found['arc'] / WANTED:.2g} mm of its surface, "
                f"{found['arc'] / found['way'] / WANTED:.2g} times the present ones")

    def _sentence(self, name: str) -> str:
        found, body = self.largest[name], "NAME" if self._run.scene.is_assembled else self._run.scene.workpiece_name
        size = max(found["width"], 0.5 * found["side"]) / WANTED
        return (f"when '{name}' pressed hardest (step {found['step']}), its contact was {found['width']:.2g} mm wide, "
                f"with elements of {found['side']:.2g} mm: with fewer than {FEW:g} across, a force may be off by half; "
                f"make them {size:.1g} mm there: [[workpieces.{body}.refine]] kind = \"near_tool\", tool = \"{name}\"")

    def memory(self) -> dict:
        """What a run that is resumed must know."""
        return {"largest": self.largest, "passed": self.passed}

    def remember(self, memory: dict) -> None:
        """Take over what :meth:`memory` gave."""
        self.largest, self.passed = dict(memory["largest"]), dict(memory["passed"])


def _width(variance: float) -> float:
    """Of a strip whose points have this variance, mm²; in mm."""
    return float(np.sqrt(12 * max(variance, 0.0)))
