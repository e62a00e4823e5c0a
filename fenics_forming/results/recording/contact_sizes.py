"""Contacts that are smaller than the elements on them, whose force is not to be believed: that has to be said."""

from __future__ import annotations

import numpy as np

from ...physics.facets import mean_lengths

# Sides across a contact. Measured, a ball of 6 mm into a block about the axis, against 8 sides or more: with two or more
# the force was off by up to 6 %, with fewer by 5 to 56 %, and lost altogether where a large element had been dented.
FEW = 2.0
COUNTS = 0.1        # of the largest force of any tool: less says nothing of the process
WANTED = 4.0        # sides across, to be advised


class ContactSizes:
    """How wide the contact of every tool was when it pressed hardest, and how long the sides of the elements there.

    The width follows from the spread of the places that are pressed, about mirror planes that they reach: that of a strip
    of variance s² is √12 s. In space the smaller one of the two along the surface counts. Places far apart, as of a flash
    and of a cavity, count as one wide contact.

    Attributes
    ----------
    largest : tool → force, N (∫ p dΓ), step, width and side, mm
    """

    def __init__(self, run):
        self._run = run
        self.largest: dict[str, dict[str, float]] = {}

    def look(self, step: int) -> None:
        """Take notice of the contact as it is now. Collective."""
        contact = self._run.body.contact
        for tool in contact.tools if contact is not None else ():
            force = float(contact.facets.integral(tool.state.pressure * contact.weights))
            if force > self.largest.get(tool.name, {"force": 0.0})["force"]:
                width, side = self._measure(contact, tool.state.pressure > 0)
                self.largest[tool.name] = {"force": force, "step": step, "width": width, "side": side}

    def _measure(self, contact, pressed: np.ndarray) -> tuple[float, float]:
        """Width of the surface of the ``pressed`` points (points,), and the mean side of the elements on it, mm."""
        facets, dim = contact.facets, contact.points.shape[1]
        at, weights = contact.points[pressed], contact.weights[pressed]
        weights = weights / self._run.body.workpiece.kinematics.weight_at(at)
        lengths = mean_lengths(self._run.nodes.x[facets.facet_nodes[:, :dim]])
        of_sides = np.repeat(lengths, facets.points_per_facet)[pressed]
        sums = facets.integral(np.column_stack([
            weights, weights * of_sides, weights[:, None] * at,
            (weights[:, None, None] * at[:, :, None] * at[:, None]).reshape(-1, dim * dim)]))
        area, side, mean = sums[0], sums[1] / sums[0], sums[2:2 + dim] / sums[0]
        spread = sums[2 + dim:].reshape(dim, dim) / area - np.outer(mean, mean)
        for axis, place in self._mirrors().items():
            if float(facets.integral(np.abs(at[:, axis] - place) < 0.5 * of_sides)):
                along = spread[axis, axis] + (mean[axis] - place) ** 2
                spread[axis], spread[:, axis] = 0.0, 0.0
                spread[axis, axis] = along
        widest = np.linalg.eigvalsh(spread)[1]      # in the plane the greater of two, in space the middle one of three
        return float(np.sqrt(12 * max(widest, 0.0))), float(side)

    def _mirrors(self) -> dict[int, float]:
        surface, given = self._run.body.free_surface, self._run.mirrors
        return surface.mirrors if surface is not None else {a: at for planes in given.values() for a, at in planes.items()}

    def doubts(self) -> list[str]:
        """A sentence where a large force came from a contact of too few elements; of the narrowest such contact."""
        most = max((found["force"] for found in self.largest.values()), default=0.0)
        across = {name: found["width"] / found["side"] for name, found in self.largest.items()
                  if found["force"] >= COUNTS * most}
        narrowest = min(across, key=across.get, default=None)
        return [self._sentence(narrowest)] if across and across[narrowest] < FEW else []

    def _sentence(self, name: str) -> str:
        found, body = self.largest[name], "NAME" if self._run.scene.is_assembled else self._run.scene.workpiece_name
        size = max(found["width"], 0.5 * found["side"]) / WANTED
        return (f"when '{name}' pressed hardest (step {found['step']}), its contact was {found['width']:.2g} mm wide, "
                f"with elements of {found['side']:.2g} mm: with fewer than {FEW:g} across, a force may be off by half; "
                f"make them {size:.1g} mm there: [[workpieces.{body}.refine]] kind = \"near_tool\", tool = \"{name}\"")

    def memory(self) -> dict:
        """What a run that is resumed must know."""
        return self.largest

    def remember(self, memory: dict) -> None:
        """Take over what :meth:`memory` gave."""
        self.largest = dict(memory)
