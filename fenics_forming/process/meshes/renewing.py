"""Renewing the mesh of a body: shape, history and flow are carried over to a new one."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
from dolfinx.mesh import Mesh

from ...errors import MeshError
from ...physics.gather import gather_cells, gather_nodal
from ...physics.meshing import from_arrays
from ...physics.nodes import EDGES
from ...physics.parallel import on_first_rank
from ...physics.remeshing import BodyArrays, Landing, Remeshed, remesh
from ...physics.remeshing.quality import overturned, scaled_jacobian
from ...physics.sizes import Remembered
from ...physics.surface import Surface
from ..body import FlowingBody
from ..volume import FreeSurface
from .at_tools import drawn_to_tools
from .transfer import Transfer, conservation

LANDED = 3e-3     # of the size of a contact facet: a side that hovers less than this above a tool has landed on it


@dataclass
class Carried:
    """Nodal fields (nodes, …) that go from one mesh to the next, by name.

    linear : history and stresses, which keep their bounds · quadratic : velocities and positions, which keep their order
    """

    linear: dict[str, np.ndarray] = field(default_factory=dict)
    quadratic: dict[str, np.ndarray] = field(default_factory=dict)

    def gathered(self, nodes) -> Carried:
        """The same on rank 0, whole; None for every field elsewhere. Collective."""
        return Carried(*({name: gather_nodal(nodes, values) for name, values in kind.items()}
                         for kind in (self.linear, self.quadratic)))


@dataclass(frozen=True)
class Renewed:
    """A new mesh and what was carried to its nodes, rows in the order in which the mesh was given (rank 0 only).

    volume : changes, mm³ (mm² in plane strain), by cause: "remeshing", "corners", "given back"
    conservation : relative change of the integral of every linear field
    healed : what of the old boundary could not be kept, in words
    counts : cells of each of several bodies; volume and conservation are by their names then
    """

    mesh: Mesh
    fields: dict[str, np.ndarray] | None
    volume: dict[str, float]
    conservation: dict[str, float]
    cells: tuple[int, int]
    engine: str
    healed: tuple[str, ...]
    seconds: float
    counts: list[int] | None = None


def renew(body: FlowingBody, carried: Carried, *, mirrors: dict[int, float], sizes, chord: float | None, least: float,
          hover: float, engine: str, kept_volume: float | None) -> Renewed:
    """A new mesh for the present shape of ``body``, with the fields ``carried`` on its nodes. Collective.

    Everything geometric happens on rank 0, so that the mesh does not depend on the number of ranks: new mesh on the old
    boundary, boundary nodes back onto the tools, volume restored, and only then, at the final positions, the transfer.

    Parameters
    ----------
    mirrors : axis → coordinate of the mirror planes
    sizes : f(BodyArrays, labels, fields by name) → wanted size at points, mm, see ``adaptation``
    least : mm; curvature, chord and short runs of the boundary ask for no finer sides
    hover : of the wanted size: what is less high above a tool, beside contact, lands on it
    kept_volume : volume to be restored by a uniform offset of the free surface, mm³; None: left as it comes

    Raises
    ------
    MeshError
        if no engine can mesh the body.
    """
    start = perf_counter()
    nodes, kinematics = body.nodes, body.workpiece.kinematics
    x, cells = gather_nodal(nodes, nodes.x), gather_cells(nodes)
    given = carried.gathered(nodes)
    landed = LANDED * body.contact.facets.size()
    found = on_first_rank(nodes.comm, lambda: renewed_arrays(
        BodyArrays(x, cells), given, body.tools, kinematics, mirrors=mirrors, sizes=sizes, chord=chord, least=least,
        hover=hover, engine=engine, kept_volume=kept_volume, landed=landed))
    placed, made, fields, volume, lost = found or (np.empty((0, nodes.dim)), None, None, {}, {})
    new_cells = made.cells if made is not None else np.empty((0, cells_width(nodes.dim)), np.int64)
    mesh = from_arrays(placed, new_cells, nodes.comm)
    told = made and (volume, lost, (len(cells), len(new_cells)), made.engine, made.healed)
    return Renewed(mesh, fields, *nodes.comm.bcast(told, 0), perf_counter() - start)


def renewed_arrays(old: BodyArrays, given: Carried, tools, kinematics, *, mirrors, sizes, chord, least, hover, engine,
                   kept_volume, landed, neighbours=None):
    """The new mesh of a body that is wholly on this rank: positions of its nodes, the `Remeshed`, what was carried to the
    nodes, changes of volume, and of the integrals of the history; as :func:`renew`.

    landed : mm; a side that hovers less than this above a tool is on it · neighbours : `Neighbours` among several bodies
    """
    labels = side_labels(old, tools, mirrors, landed)
    wanted = sizes(old, labels, given.linear | given.quadratic)
    drawn, corners = drawn_to_tools(old, wanted, tools, mirrors)
    labels = labels if drawn is old else side_labels(drawn, tools, mirrors, landed)
    if drawn.dim == 2:
        outer = marked(drawn.cells[:, :3], len(drawn.x)) | marked(drawn.sides, len(drawn.x))
        wanted = Remembered(wanted, drawn.x[outer], wanted.nodal[outer] if drawn is old else None)
    landing = Landing({k: tool.gap for k, tool in enumerate(tools, start=1)},
                      lambda points: hover * wanted(points), lambda points: np.minimum(least, wanted(points)), landed)
    made = remesh(drawn, labels, wanted, chord=chord, engine=engine, least=least, landing=landing,
                  corners=corners)
    surface = FreeSurface.of_arrays(made.x, made.cells, made.sides, kinematics, mirrors)
    known = Surface(drawn.sides, drawn.x, kinematics).volume(drawn.x)
    start = known if drawn is old else Surface(old.sides, old.x, kinematics).volume(old.x)
    new = surface.volume(made.x)
    placed = put_back(made, tools, mirrors)
    met = None
    if neighbours is not None:
        met = neighbours.meet(made, placed)
        follow(made, placed)
    back = surface.volume(placed)
    if kept_volume is not None:
        surface.offset_around(kept_volume, placed, tools, met=met)
    if overturned(made.x, placed, made.cells).any() or scaled_jacobian(placed, made.cells).min() <= 0.0:
        raise MeshError("the new mesh does not fit between the tools: a cell folds over when its nodes are put on them")
    moved = Transfer(old, placed, old.locator)
    fields = linear_fields(moved, made, given.linear)
    fields |= {name: moved.quadratic(values) for name, values in given.quadratic.items()}
    lost = conservation(old, BodyArrays(placed, made.cells), {
        name: (given.linear[name], fields[name]) for name in given.linear
        if name.startswith("history.") and not name.startswith("history.heat.")},
        axisymmetric=kinematics.name == "axisymmetric")
    change = {"remeshing": new - known, "corners": known - start + back - new, "given back": surface.volume(placed) - back}
    return placed, made, fields, change, lost


def linear_fields(moved: Transfer, made: BodyArrays, given: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Fields at the old nodes, (n, …), all at once at the new vertices, with the means at the mid-nodes: (p, …)."""
    if not given:
        return {}
    columns = [np.reshape(values, (len(values), -1)) for values in given.values()]
    vertices = np.flatnonzero(marked(made.cells[:, : made.dim + 1], len(made.x)))
    new = np.zeros((len(made.x), sum(c.shape[1] for c in columns)))
    new[vertices] = moved.linear(np.concatenate(columns, axis=1), vertices)
    parts = np.split(means_at_mids(made, new), np.cumsum([c.shape[1] for c in columns])[:-1], axis=1)
    return {name: part.reshape((len(new),) + values.shape[1:]) for (name, values), part in zip(given.items(), parts,
                                                                                                strict=True)}


def means_at_mids(body: BodyArrays, values: np.ndarray) -> np.ndarray:
    """Nodal values (n, …) with the mean of the ends of its edge at every mid-node: linear fields stay linear."""
    values = values.copy()
    for k, (a, b) in enumerate(EDGES[body.dim]):
        values[body.cells[:, body.dim + 1 + k]] = 0.5 * (values[body.cells[:, a]] + values[body.cells[:, b]])
    return values


def cells_width(dim: int) -> int:
    """Nodes of a cell of order 2."""
    return dim + 1 + len(EDGES[dim])


def side_labels(body: BodyArrays, tools, mirrors: dict[int, float], reach: float) -> np.ndarray:
    """Label of every boundary side: 0 free, k on the k-th tool, -1 - axis on a mirror plane (see ``physics.remeshing``)."""
    labels = np.zeros(len(body.sides), dtype=np.int64)
    numbers = np.flatnonzero(marked(body.sides, len(body.x)))
    on_tool = np.zeros(len(body.x), dtype=bool)
    for k, tool in enumerate(tools, start=1):
        gap, _ = tool.gap(body.x[numbers])
        on_tool[numbers] = np.abs(gap) <= reach
        labels[on_tool[body.sides].all(axis=1)] = k
    size = np.ptp(body.x, axis=0).max()
    for axis, value in mirrors.items():
        on_plane = np.abs(body.x[:, axis] - value) < 1e-8 * size
        labels[on_plane[body.sides].all(axis=1)] = -1 - axis
    return labels


def marked(nodes: np.ndarray, count: int) -> np.ndarray:
    """Which of ``count`` nodes are among the given ones, of any shape: (count,)."""
    among = np.zeros(count, dtype=bool)
    among[nodes] = True
    return among


def put_back(made: Remeshed, tools, mirrors: dict[int, float]) -> np.ndarray:
    """Positions with the boundary nodes on their tools: those of pressed sides exactly, others where they have sunk in.

    Inner mid-nodes go half of the way of their neighbours; nodes on mirror planes stay there.
    """
    x = made.x.copy()
    free = np.flatnonzero(marked(made.sides[made.labels >= 0], len(x)))
    for k, tool in enumerate(tools, start=1):
        held = marked(made.sides[made.labels == k], len(x))
        gap, normal = tool.gap(x[free])
        off = (gap < 0) | held[free]
        x[free[off]] -= gap[off, None] * normal[off]
    for axis, value in mirrors.items():
        x[made.sides[made.labels == -1 - axis], axis] = value
    return follow(made, x)


def follow(made: BodyArrays, x: np.ndarray) -> np.ndarray:
    """Move the inner mid-nodes, in place, by half of what the ends of their edges have moved."""
    dim = made.dim
    moved = x - made.x
    ends = made.cells[:, np.array(EDGES[dim])]                        # cells, edges, 2
    mids = made.cells[:, dim + 1:]
    inner = np.ones(len(x), dtype=bool)
    inner[made.sides] = False
    chosen = inner[mids]
    x[mids[chosen]] = made.x[mids[chosen]] + 0.5 * moved[ends[chosen]].sum(axis=1)
    return x
