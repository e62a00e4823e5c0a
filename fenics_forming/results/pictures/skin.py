"""The visible part of a frame: a body in the plane, or the surface of a body in space, as triangles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..files import ResultsError
from ..table import name_and_unit

# VTK order: a triangle of order 2 is seen as four straight ones; the six-node faces of a tetrahedron
_QUARTERS = [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]
_FACES = [[0, 2, 1, 6, 5, 4], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [2, 0, 3, 6, 7, 9]]
_SIDES = [[0, 3, 1], [1, 4, 2], [2, 5, 0]]


@dataclass(frozen=True)
class Skin:
    """Six-node triangles in the plane or in space with the fields at their nodes.

    Attributes
    ----------
    points : (n, dim) mm
    faces : (m, 6) nodes, VTK order
    fields : arrays (n,) or (n, 3) by name
    """

    points: np.ndarray
    faces: np.ndarray
    fields: dict[str, np.ndarray]

    @classmethod
    def read(cls, paths: list[Path]) -> Skin:
        """The skin of one frame, of all its bodies together; a field that a body lacks is nan there."""
        import meshio

        skins = []
        for path in paths:
            try:
                frame = meshio.read(path)
            except (OSError, meshio.ReadError) as error:
                raise ResultsError(f"the frame '{path}' cannot be read: {error}") from None
            kind = "triangle6" if "triangle6" in frame.cells_dict else "tetra10"
            faces = frame.cells_dict[kind]
            if kind == "tetra10":
                faces = _outer(faces[:, _FACES].reshape(-1, 6))
            points = frame.points[:, :2] if kind == "triangle6" else frame.points
            skins.append(cls(points, faces, dict(frame.point_data)))
        return skins[0] if len(skins) == 1 else _joined(skins)

    def full_name(self, name: str) -> str | None:
        """Name of a field with its unit, given with or without; None if the frame has none."""
        if name in self.fields:
            return name
        return next((key for key in self.fields if name_and_unit(key)[0] == name.replace("_", " ")), None)

    def field(self, name: str) -> tuple[str, np.ndarray]:
        """Full name and values of a field; ``name`` may leave out the unit; of a vector the magnitude.

        Raises
        ------
        ResultsError
            if the frame has no such field.
        """
        full = self.full_name(name)
        if full is None:
            raise ResultsError(
                f"the frame has no field '{name}'; it has {', '.join(sorted(self.fields)) or 'none'}"
            )
        values = self.fields[full]
        return full, values if values.ndim == 1 else np.linalg.norm(values, axis=1)

    def mirrored(self, axis: int, at: float) -> Skin:
        """This skin and its image in the plane where coordinate ``axis`` is ``at``, as one.

        Nodes on the plane are shared; of a body in space the faces on it, now inside, are left out.
        """
        image = self.points.copy()
        image[:, axis] = 2 * at - image[:, axis]
        n = len(image)
        on_plane = np.abs(self.points[:, axis] - at) <= 1e-6 * np.ptp(self.points, axis=0).max()
        seen = self.faces[~on_plane[self.faces].all(axis=1)]
        twin = replace(self, points=image, faces=seen[:, [0, 2, 1, 5, 4, 3]])
        both = _joined([replace(self, faces=seen), twin])
        shared = np.concatenate([np.arange(n), np.where(on_plane, np.arange(n), np.arange(n, 2 * n))])
        return replace(both, faces=shared[both.faces])

    def deformed(self, times: float) -> Skin:
        """This skin with its displacements, as many times as large, added to its points; as it is where it has none."""
        if "displacement_mm" not in self.fields:
            return self
        return replace(self, points=self.points + times * self.fields["displacement_mm"][:, : self.points.shape[1]])

    @property
    def triangles(self) -> np.ndarray:
        """Four straight triangles for each face, (4 m, 3)."""
        return self.faces[:, _QUARTERS].reshape(-1, 3)

    def sides(self) -> tuple[np.ndarray, np.ndarray]:
        """Sides of the faces as (k, 3) nodes (end, middle, end): those inside, those on the rim."""
        sides = self.faces[:, _SIDES].reshape(-1, 3)
        _, first, count = np.unique(sides[:, 1], return_index=True, return_counts=True)
        return sides[first[count > 1]], sides[first[count == 1]]


def _outer(faces):
    """The faces that belong to one cell only."""
    _, first, count = np.unique(np.sort(faces[:, :3], axis=1), axis=0, return_index=True, return_counts=True)
    return faces[first[count == 1]]


def _joined(skins):
    starts = np.cumsum([0] + [len(s.points) for s in skins[:-1]])
    fields = {}
    for name in dict.fromkeys(name for s in skins for name in s.fields):
        like = next(s.fields[name] for s in skins if name in s.fields)
        fields[name] = np.concatenate(
            [s.fields.get(name, np.full((len(s.points),) + like.shape[1:], np.nan)) for s in skins]
        )
    return Skin(
        np.concatenate([s.points for s in skins]),
        np.concatenate([s.faces + start for s, start in zip(skins, starts, strict=True)]),
        fields,
    )
