"""What loads a tool: pressures and tractions on its faces, forces per volume, forces at its nodes.

A load adds its virtual work to a vector: ``load.add_to(vector, body)``. Values may be numbers or functions of the place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Pressure:
    """Pressure on ``facets``, MPa, that pushes into the body: a number or f(x (n, dim)) → (n,)."""

    facets: np.ndarray
    value: float | object

    def add_to(self, vector, body) -> None:
        face = body.face(self.facets)
        pressure = np.broadcast_to(_at(self.value, face.points), len(face.points))
        face.add(vector, -pressure[:, None] * face.normals)


@dataclass(frozen=True)
class Traction:
    """Traction on ``facets``, MPa: its components, or f(x (n, dim)) → (n, dim)."""

    facets: np.ndarray
    value: tuple[float, ...] | object

    def add_to(self, vector, body) -> None:
        face = body.face(self.facets)
        face.add(vector, np.broadcast_to(_at(self.value, face.points), face.points.shape))


@dataclass(frozen=True)
class PointTractions:
    """Tractions at the points of ``facets``, (n, dim) MPa, in the order of ``body.face(facets).points``: those of contact,
    taken over point by point."""

    facets: np.ndarray
    value: np.ndarray

    def add_to(self, vector, body) -> None:
        body.face(self.facets).add(vector, self.value)


@dataclass(frozen=True)
class BodyForce:
    """Force per volume, N/mm³: its components, or f(x (n, dim)) → (n, dim)."""

    value: tuple[float, ...] | object

    def add_to(self, vector, body) -> None:
        body.volume_force.add(vector, lambda x: np.broadcast_to(_at(self.value, x), x.shape))


@dataclass(frozen=True)
class Centrifugal:
    r"""Centrifugal force :math:`\rho\omega^2 r` of a spinning body: density t/mm³, speed rad/s.

    The axis goes through ``centre``: along z in the plane, the axis of symmetry in axisymmetry, ``axis`` in space.
    """

    density: float
    speed: float
    centre: tuple[float, ...] = (0.0, 0.0, 0.0)
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def add_to(self, vector, body) -> None:
        def force(x):
            arm = x - np.asarray(self.centre, float)[: x.shape[1]]
            if body.state.name == "axisymmetric":
                arm[:, 1] = 0.0
            elif x.shape[1] == 3:
                axis = np.asarray(self.axis, float) / np.linalg.norm(self.axis)
                arm -= (arm @ axis)[:, None] * axis
            return self.density * self.speed**2 * arm

        body.volume_force.add(vector, force)


@dataclass(frozen=True)
class NodalForces:
    """Forces at the nodes, (nodes, dim), N: what a contact operator gives; those of ghosts are not looked at."""

    value: np.ndarray

    def add_to(self, vector, body) -> None:
        dofs = body.dofs.ravel()
        owned = dofs < body.owned
        vector.array[dofs[owned]] += self.value.ravel()[owned]


def _at(value, points):
    return value(points) if callable(value) else np.asarray(value, float)
