"""A new mesh of order 2 for a solid body: a straight mesh by an engine, laid onto the old quadratic surface."""

from __future__ import annotations

import numpy as np

from ...errors import MeshError
from . import gmsh_solid, mmg
from .body_arrays import FACETS, BodyArrays, Remeshed, boundary_sides, keys
from .curving import raised, vertices_placed
from .features import Features, find_features
from .gradation import over_mesh
from .quality import radius_ratio
from .straight import Straight, cell_edges, improve, one_side_each, oriented, volumes
from .surface import OldSurface, within_chord

CHORD = 0.5             # of the mean size: distance allowed between straight sides and the surface unless given
# mmg cuts 1.5 times the cells that fill the volume with edges of the wanted length, gmsh 0.75 times
COUNT_SCALE = {"mmg": 1.5 ** (1 / 3), "gmsh": 0.75 ** (1 / 3)}
REGULAR = 6 * 2**0.5    # regular cells of edge h in a volume h³
COUNT_ERROR = 1.15      # ratio of the numbers of cells, made and wanted, beyond which it is made again
RUNS = 2
# where the engine leaves a sliver, mostly between three nodes of a line, it does not for slightly other sizes
GOOD = {"mmg": 0.2, "gmsh, then mmg": 0.2, "gmsh": 0.1}
TRIES = (1.0, 0.93, 1.07)
ROUNDS = 3              # of moving nodes to better places and back onto the surface


def remesh(body: BodyArrays, labels: np.ndarray, sizes, *, chord: float | None, corner_angle: float,
           engine: str, corners: np.ndarray | None = None) -> Remeshed:
    """See `fenics_forming.physics.remeshing.remesh`."""
    cells = oriented(body.x, body.cells[:, :4])
    sides = _oriented_sides(body, cells)
    features = find_features(body.x, sides, np.asarray(labels), corner_angle, corners)
    surface = OldSurface(body.x, sides, features)
    sizes = within_chord(sizes, body.x, sides, chord)
    old, best, most = _straight(body.x, cells, sides, features), None, -1.0
    for factor in TRIES:
        mesh, name = _by_an_engine(old, surface, lambda points, factor=factor: factor * sizes(points), chord, engine)
        made = _finished(mesh, surface, name)
        worst = float(radius_ratio(made.x, made.cells).min())
        if worst > most:
            best, most = made, worst
        if worst >= GOOD[name]:
            break
    return best


def improved(body: BodyArrays, corner_angle: float = 40.0) -> Remeshed:
    """The same body with its cells made better: those with several boundary sides split, nodes moved to better places.

    For first meshes: cut at its centre, as `gmsh_arrays.split_corner_cells` does, a cell leaves four with radius ratios
    near 0.16, which are worn out long before the others. Labels are 0.
    """
    cells = oriented(body.x, body.cells[:, :4])
    sides = _oriented_sides(body, cells)
    features = find_features(body.x, sides, np.zeros(len(sides), np.int64), corner_angle)
    return _finished(one_side_each(_straight(body.x, cells, sides, features)), OldSurface(body.x, sides, features), "")


def _finished(mesh: Straight, surface: OldSurface, engine: str) -> Remeshed:
    """A straight mesh improved and raised to order 2 on the old surface."""
    for _ in range(ROUNDS):
        mesh = vertices_placed(improve(mesh), surface)
    x, cells, mids, patch = raised(mesh, surface)
    new = boundary_sides(cells, 3, x)
    # a mid-node on a line belongs to two patches: the facet is found by its three
    count = len(x)
    order = np.argsort(keys(mids, count))
    at = order[np.searchsorted(keys(mids, count)[order], keys(new[:, 3:], count))]
    return Remeshed(x=x, cells=cells, labels=surface.features.patch_labels[patch][at], engine=engine)


def _by_an_engine(old: Straight, surface: OldSurface, sizes, chord, engine: str) -> tuple[Straight, str]:
    """The straight mesh with its boundary vertices on the old surface, and what made it."""
    def by_mmg(mesh):
        return _sized(mesh, surface, sizes, "mmg", lambda m, size: mmg.solid(m, size, chord or CHORD * float(size.mean())))

    def by_gmsh(mesh):
        return _sized(mesh, surface, sizes, "gmsh", lambda m, size: gmsh_solid.solid(m, size, surface))

    ways = {"mmg": [lambda: by_mmg(old)],
            "gmsh, then mmg": [lambda: by_mmg(gmsh_solid.refill(old)), lambda: by_mmg(by_gmsh(old))],
            "gmsh": [lambda: by_gmsh(old), lambda: vertices_placed(gmsh_solid.refill(old), surface)]}
    reasons = []
    for name in _engines(engine):
        for way in ways[name]:
            try:
                return way(), name
            except RuntimeError as error:
                reasons.append(f"{name}: {error}")
    advice = "" if mmg.installed() else "; mmg repairs surfaces that gmsh cannot: pip install mmgpy"
    raise MeshError(f"the body could not be meshed anew ({'; '.join(reasons)}); its surface may cross itself{advice}")


def _engines(engine: str) -> list[str]:
    with_mmg = ["mmg", "gmsh, then mmg"]
    if engine == "auto":
        return (with_mmg if mmg.installed() else []) + ["gmsh"]
    return with_mmg if engine == "mmg" else ["gmsh"]


def _sized(old: Straight, surface: OldSurface, sizes, name: str, make) -> Straight:
    """What ``make(mesh, size)`` gives, and again with corrected sizes where the number of cells is not the wanted one."""
    if name == "mmg" and volumes(old.x, old.cells).min() <= 0:
        raise RuntimeError("cells are inside out")
    scale, new = COUNT_SCALE[name], None
    for _ in range(RUNS):
        try:
            new = one_side_each(vertices_placed(make(old, scale * _graded(old, sizes)), surface))
        except RuntimeError:
            if new is None:
                raise
            break
        wanted = volumes(new.x, new.cells) @ (REGULAR / _graded(new, sizes) ** 3)[new.cells].mean(axis=1)
        ratio = len(new.cells) / float(wanted)
        if 1 / COUNT_ERROR < ratio < COUNT_ERROR:
            break
        old, scale = new, scale * ratio ** (1 / 3)
    return new


def _graded(mesh: Straight, sizes) -> np.ndarray:
    """Sizes (n,) at the nodes that grow no faster over the edges than an engine would let them, mm."""
    edges, _ = cell_edges(mesh.cells)
    return over_mesh(sizes(mesh.x), edges, np.linalg.norm(mesh.x[edges[:, 1]] - mesh.x[edges[:, 0]], axis=1))


def _straight(x: np.ndarray, cells: np.ndarray, sides: np.ndarray, features: Features) -> Straight:
    """The vertices of a body of order 2, with its features."""
    used = np.unique(cells)
    number = np.full(len(x), -1)
    number[used] = np.arange(len(used))
    return Straight(x[used], number[cells], number[sides[:, :3]], features.patch, number[features.edges[:, :2]],
                    features.line, number[features.corners])


def _oriented_sides(body: BodyArrays, cells: np.ndarray) -> np.ndarray:
    """``body.sides`` with their normals outwards also where a cell is inside out."""
    sides, count = body.sides.copy(), len(body.x)
    faces = cells[:, np.array(FACETS[3])].reshape(-1, 3)
    key = keys(faces, count)
    order = np.argsort(key, kind="stable")
    own = faces[order[np.searchsorted(key[order], keys(sides[:, :3], count))]]
    after = [np.take_along_axis(f, (f.argmin(axis=1)[:, None] + 1) % 3, axis=1) for f in (own, sides[:, :3])]
    over = (after[0] != after[1])[:, 0]
    sides[over] = sides[over][:, [1, 0, 2, 4, 3, 5]]
    return sides
