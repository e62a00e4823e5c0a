"""Meshes and boundary conditions that several verification tests share."""

from __future__ import annotations

import numpy as np

from fenics_forming import FixedVelocity, meshing


def side(mesh, axis: int, at: float, within: tuple[float, float] | None = None) -> np.ndarray:
    """Facets of a body on the line or plane x[axis] = at; ``within`` bounds the other coordinate of a 2-D body."""

    def on_side(x):
        found = np.isclose(x[axis], at, atol=1e-9)
        if within is not None:
            found &= (x[1 - axis] > within[0] - 1e-9) & (x[1 - axis] < within[1] + 1e-9)
        return found

    facets = meshing.boundary_facets(mesh, on_side)
    assert len(facets), f"no facets on x[{axis}] = {at}"
    return facets


def held(facets, velocity) -> list[FixedVelocity]:
    """Both (or all three) velocity components on facets; None leaves a component free."""
    return [FixedVelocity(facets, i, v) for i, v in enumerate(velocity) if v is not None]


def ring_sector(inner: float, outer: float, radial: int, around: int, angle: float = np.pi / 2):
    """Sector of a ring, a quarter, with curved order-2 cells: all nodes, mid-nodes too, lie where polar coordinates put
    them. A full turn is slit on the first axis."""
    mesh = meshing.rectangle((np.log(inner), 0.0), (np.log(outer), angle), (radial, around))
    radius, angle = np.exp(mesh.geometry.x[:, 0]), mesh.geometry.x[:, 1].copy()
    mesh.geometry.x[:, 0] = radius * np.cos(angle)
    mesh.geometry.x[:, 1] = radius * np.sin(angle)
    on_axis = np.abs(mesh.geometry.x[:, :2]) < 1e-12 * outer
    mesh.geometry.x[:, :2][on_axis] = 0.0
    return mesh


def observed_orders(sizes, errors) -> np.ndarray:
    """Exponents p of error ~ size**p between neighbours of a sequence."""
    return np.diff(np.log(np.abs(errors))) / np.diff(np.log(sizes))
