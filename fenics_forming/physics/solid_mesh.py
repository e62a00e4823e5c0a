"""Meshes of bodies that deform elastically: fine where something presses on them, coarse away from there."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from . import meshing
from .bodies import BUILDERS, automatic_size, import_cad, read_msh

GROWTH = 0.25       # of the element size per unit of distance: half-planes under strips change by 1e-3 from 0.1 to 0.3
MOST_POINTS = 3000  # that gmsh measures distances from


def solid_mesh(shape, dim: int, *, contact: float | None = None, far: float | None = None, near=None, mirrors=(),
               comm=MPI.COMM_WORLD):
    """Mesh of order 2 of a body shape, or of a full circle.

    Parameters
    ----------
    contact, far : element size, mm, at the points ``near`` (n, dim) and away from them; far is chosen if not given
    near : where it is fine; everywhere if None
    mirrors : axes on which a round body is cut in half

    Raises
    ------
    MeshError
        if the shape cannot be meshed.
    """
    if shape.kind == "file":
        path, scale = str(shape.file), shape.scale
        if path.endswith(".msh"):
            return read_msh(path, scale, dim, comm)[0]
        build = lambda gmsh: import_cad(gmsh, path, scale, dim)  # noqa: E731
    else:
        far = far or automatic_size(shape.volume_or_area(), dim)
        build = lambda gmsh: BUILDERS[shape.kind](gmsh, shape, far, mirrors)  # noqa: E731
    graded = near is not None and contact is not None and (far is None or contact < far)

    def build_and_grade(gmsh):
        volume = build(gmsh)
        if graded:
            _grade(gmsh, contact, far or automatic_size(volume, dim), np.asarray(near, float))
        elif size is None:
            gmsh.option.setNumber("Mesh.MeshSizeMax", automatic_size(volume, dim))

    size = far if graded or contact is None else min(contact, far or contact)
    return meshing.generate(build_and_grade, dim, size, from_boundary=not graded, comm=comm)


def _grade(gmsh, contact: float, far: float, near: np.ndarray) -> None:
    """Sizes from ``contact`` at the points up to ``far``, by the distance: fields of gmsh, which ask no Python."""
    kernel = gmsh.model.occ if gmsh.model.occ.getEntities() else gmsh.model.geo
    places = np.zeros((len(near), 3))
    places[:, : near.shape[1]] = near
    tags = [kernel.addPoint(*place) for place in places[:: 1 + len(near) // MOST_POINTS]]
    kernel.synchronize()
    field = gmsh.model.mesh.field
    distance, size = field.add("Distance"), field.add("Threshold")
    field.setNumbers(distance, "PointsList", tags)
    for key, value in {"InField": distance, "SizeMin": contact, "SizeMax": far, "DistMin": contact,
                       "DistMax": contact + (far - contact) / GROWTH}.items():
        field.setNumber(size, key, value)
    field.setAsBackgroundMesh(size)
    gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)


def facing_points(scene, name: str, solids) -> dict[str, np.ndarray | None]:
    """Where each body of a tool is pressed on, mm: points of its surface near the workpieces and other parts, and on loaded
    faces; of a body from a file points on the workpieces; None where nothing says so."""
    tool, found = scene.tools[name], {}
    samples = {part: _samples(scene, tool, solid) for part, solid in solids.items()}
    bounds = [w.shape.bounds() for w in scene.workpieces.values() if w.shape.file is None]
    away = {part: _distance_to_boxes(x, bounds) for part, x in samples.items() if x is not None}
    nearest = min((d.min() for d in away.values()), default=0.0) if bounds else 0.0
    reach = max((0.5 * np.ptp(b, axis=0).max() for b in bounds), default=0.0)
    for part, solid in solids.items():
        x = samples[part]
        if x is None:
            found[part] = np.concatenate([_box_points(b) for b in bounds]) if bounds else None
            continue
        pressed = away[part] <= nearest + reach if bounds else np.zeros(len(x), bool)
        if tool.rolls:
            pressed |= _on_face(x, "mantle", scene.axes, solid.shape)
        for contact in scene.contacts:
            for other in set(contact.between) - {part} if part in contact.between else ():
                if other in solids and samples[other] is not None:
                    pressed |= _touching(x, solids[other].shape, samples[other])
        for face in {*solid.loads, *tool.loads}:
            pressed |= _on_face(x, face, scene.axes, solid.shape)
        found[part] = x[pressed] if pressed.any() else None
    return found


def _samples(scene, tool, solid) -> np.ndarray | None:
    """Points of the surface, none on mirror planes and on the axis of rotation; None of a body from a file."""
    shape = solid.shape
    if shape.file is not None:
        return None
    bounds = np.asarray(shape.bounds())
    size = float(np.ptp(bounds, axis=0).max())
    finest = 0.01 * size if solid.mesh_size is None else solid.mesh_size.contact
    x = shape.boundary_points(max(finest, 2e-3 * size))
    planes = {scene.axes.index(a): bounds[0, scene.axes.index(a)] for a in tool.symmetry}
    if scene.geometry == "axisymmetric":
        planes[0] = 0.0
    inside = np.ones(len(x), bool)
    for axis, value in planes.items():
        inside &= x[:, axis] > value + 1e-9 * size
    return x[inside]


def _distance_to_boxes(x, bounds) -> np.ndarray:
    found = [np.linalg.norm(np.maximum(np.maximum(low - x, x - high), 0.0), axis=1) for low, high in bounds]
    return np.min(found, axis=0) if found else np.zeros(len(x))


def _touching(x, shape, samples) -> np.ndarray:
    """Whether points lie near the surface of another body: within 2 % of its size."""
    near = 0.02 * np.ptp(shape.bounds(), axis=0).max()
    if hasattr(shape, "depth"):
        return np.abs(shape.depth(x)) < near
    from scipy.spatial import cKDTree
    return cKDTree(samples).query(x)[0] < 2 * near


def _on_face(x, face: str, axes, shape) -> np.ndarray:
    axis, _, end = face.partition("_")
    if face in ("surface", "mantle"):
        return np.ones(len(x), bool)
    if end.isdigit() and hasattr(shape, "corners"):
        n, k = len(shape.corners), int(end) - 1
        if axis == "fillet":
            arc = shape.rounding(k + 1)
            return np.abs(np.linalg.norm(x - arc.centre, axis=1) - arc.radius) < 1e-6 * arc.radius
        start, stop = shape.corners[k % n], shape.corners[(k + 1) % n]
        along = (stop - start) / np.linalg.norm(stop - start)
        part = np.clip((x - start) @ along, 0.0, np.linalg.norm(stop - start))
        return np.linalg.norm(x - start - part[:, None] * along, axis=1) < 1e-6 * np.linalg.norm(stop - start)
    if axis not in axes or end not in ("low", "high"):
        return np.zeros(len(x), bool)
    along = x[:, axes.index(axis)]
    value = along.min() if end == "low" else along.max()
    return np.abs(along - value) < 1e-9 * max(1.0, np.abs(along).max())


def _box_points(bounds) -> np.ndarray:
    grids = [np.linspace(low, high, 12) for low, high in np.transpose(bounds)]
    points = np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1)
    edge = np.zeros(points.shape[:-1], bool)
    for axis in range(points.shape[-1]):
        for end in (0, -1):
            edge[tuple(end if k == axis else slice(None) for k in range(points.shape[-1]))] = True
    return points[edge]
