"""The faces of a tool by the names that a scene gives them: flat ends, sides of polygons, mantles, the whole surface."""

from __future__ import annotations

import numpy as np

from ...errors import SceneError
from ...physics.facets import exterior_facets
from ...physics.nodes import Nodes
from ...physics.parallel import highest, lowest, total
from ...physics.parts import Parts
from ...physics.surface import facet_sides

FLAT = 1e-6      # of the size of the tool: nodes so near to a plane or side lie on it


class ToolFaces:
    """Facets of the bodies of a tool.

    Parameters
    ----------
    solids : name → body with a ``shape``, in the order of the cells
    mirrors : axes of mirror planes at the low end of the whole tool
    on_axis : whether the axis r = 0 bounds bodies that reach it

    Attributes
    ----------
    mirrors : axis → coordinate of the mirror planes, and of the axis of rotation where the tool reaches it
    """

    def __init__(self, nodes: Nodes, parts: Parts, solids, axes, *, mirrors=(), on_axis: bool = False):
        self.nodes, self.parts, self.solids, self.axes = nodes, parts, solids, axes
        facets = exterior_facets(nodes.mesh)
        self._facets = {name: parts.facets_of(name, facets) for name in solids}
        self._x = {name: nodes.x[facet_sides(nodes, own)] for name, own in self._facets.items()}
        self.extents = nodes.extents()
        self._slack = FLAT * float(np.ptp(self.extents, axis=0).max())
        self.mirrors = {axes.index(a): float(self.extents[0, axes.index(a)]) for a in mirrors}
        if on_axis and self.extents[0, 0] <= self._slack:
            self.mirrors[0] = 0.0

    def named(self, face: str, key: str, part: str | None = None) -> np.ndarray:
        """Owned facets of a face, of the whole tool or of one of its parts. Collective.

        Raises
        ------
        SceneError
            if there are none; ``key`` is where the scene names the face.
        """
        names = list(self.solids) if part is None else [part]
        extents = self.extents if part is None else self.extents_of(part)
        found = np.concatenate([self._of(name, face, extents) for name in names])
        if total(self.nodes.comm, float(len(found))) == 0:
            raise SceneError(f"'{face}': the tool has no such face", key=key, got=face)
        return np.sort(found)

    def extents_of(self, part: str) -> np.ndarray:
        """Lowest and highest coordinates of a part, (2, dim), mm. Collective."""
        x = self.nodes.x[self.parts.of_node == self.parts.names.index(part)]
        comm = self.nodes.comm
        return np.array([lowest(comm, x.min(axis=0, initial=np.inf)), highest(comm, x.max(axis=0, initial=-np.inf))])

    def on_mirror(self, axis: int) -> np.ndarray:
        """Owned facets on the mirror plane (or axis) across an axis."""
        value = self.mirrors[axis]
        return np.sort(np.concatenate([self._flat(name, axis, value) for name in self.solids]))

    def surface(self, part: str) -> np.ndarray:
        """Owned exterior facets of a part that lie on no mirror plane and not on the axis."""
        taken = [self._flat(part, axis, value) for axis, value in self.mirrors.items()]
        own = self._facets[part]
        return np.setdiff1d(own, np.concatenate(taken)) if taken else np.sort(own)

    def _flat(self, name: str, axis: int, value: float) -> np.ndarray:
        return self._facets[name][(np.abs(self._x[name][..., axis] - value) < self._slack).all(axis=1)]

    def _of(self, name: str, face: str, extents) -> np.ndarray:
        first, _, last = face.partition("_")
        if first in self.axes and last in ("low", "high"):
            axis = self.axes.index(first)
            return self._flat(name, axis, extents[0 if last == "low" else 1, axis])
        if face == "surface":
            return self.surface(name)
        shape = self.solids[name].shape
        if face == "mantle" and shape.kind == "cylinder":
            return self.mantle(name)
        if face == "neck" and getattr(shape, "neck", None):
            return np.setdiff1d(self.surface(name), self.mantle(name))
        if hasattr(shape, "corners") and last.isdigit():
            if first == "side":
                return self._side(name, shape.corners, int(last))
            if first == "fillet":
                return self._arc(name, shape.rounding(int(last)))
        return np.empty(0, np.int32)

    def mantle(self, name: str) -> np.ndarray:
        """Owned facets of the round side of a cylinder or a circle."""
        shape = self.solids[name].shape
        if shape.kind == "circle":
            away = np.linalg.norm(self._x[name] - np.asarray(shape.centre), axis=-1)
            return self._facets[name][(np.abs(away - shape.radius) < self._slack).all(axis=1)]
        axis = np.asarray(shape.axis, float) / np.linalg.norm(shape.axis)
        along = (self._x[name] - shape.base) @ axis
        ends = [(np.abs(along - end) < self._slack).all(axis=1) for end in (0.0, shape.height)]
        return np.setdiff1d(self.surface(name), self._facets[name][ends[0] | ends[1]])

    def _arc(self, name: str, arc) -> np.ndarray:
        if arc is None:
            return np.empty(0, np.int32)
        ends = np.array([arc.start, arc.end])
        away = self._x[name] - arc.centre
        on = np.abs(np.linalg.norm(away, axis=-1) - arc.radius) < self._slack
        towards = ends.mean(axis=0) - arc.centre                # an arc of less than half a turn lies on that side
        least = ((ends - arc.centre) @ towards).min() - self._slack * np.linalg.norm(towards)
        return self._facets[name][(on & (away @ towards > least)).all(axis=1)]

    def _side(self, name: str, corners, number: int) -> np.ndarray:
        if not 1 <= number <= len(corners):
            return np.empty(0, np.int32)
        start, end = corners[number - 1], corners[number % len(corners)]
        along = (end - start) / np.linalg.norm(end - start)
        away = self._x[name] - start
        across = np.abs(away @ np.array([-along[1], along[0]])) < self._slack
        within = (away @ along > -self._slack) & (away @ along < np.linalg.norm(end - start) + self._slack)
        return self._facets[name][(across & within).all(axis=1)]
