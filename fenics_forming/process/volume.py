"""Volume constancy: the free surface is offset by one distance, along its normals, until the volume is the wanted one.

A repair of size, not of shape: what a coarse time scheme has distorted stays distorted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..physics.kinematics import Kinematics
from ..physics.locating import slopes
from ..physics.nodes import Nodes, determinants, mid_nodes
from ..physics.parallel import highest, lowest
from ..physics.surface import Surface
from .shifting import put_on_tools

CAP = 0.1             # of the smallest element, the farthest that the surface moves at once
MOST_CALLS = {"in": 40, "out": 150}     # inwards a few of the smallest elements in all; outwards, where cells only grow,
                                        # a dozen, as a thin flash may need; what is then left waits for the next time
EXACT = 1e-14         # relative volume that is as good as none
TOUCHING = 1e-6       # of the size of the body: a node nearer to a tool than this is on it
LEAST_COSINE = 0.5    # to the sides that meet in an edge, and to a mirror plane: sharper ones move by less
MOST_LOSS = 0.3       # of a cell's Jacobian, by one offset
LEFT = 0.25           # of a cell's Jacobian: what has lost more in all keeps its place


@dataclass(frozen=True)
class Restored:
    """What an offset of the free surface did.

    Attributes
    ----------
    before, after : volume, mm³ (mm² in plane strain)
    distance : how far the free surface went outwards, mm
    shortfall : a sentence where the wanted volume was not reached
    """

    before: float
    after: float
    distance: float
    shortfall: str | None

    @property
    def given_back(self) -> float:
        return self.after - self.before


class FreeSurface:
    """The surface of a body on its mirror planes, ready to be offset; built anew for a new mesh.

    Parameters
    ----------
    surface : the sides of the body, on all ranks or on one
    x : (n, dim) positions of the nodes, mm
    cells : (m, 6 | 10) nodes of the cells of this rank, basix order
    mirrors : axis → coordinate of the mirror planes and, in axisymmetry, of the axis

    Attributes
    ----------
    sides : (f,) which sides of the surface lie on no mirror plane
    nodes : (n,) which nodes lie on those
    on_plane : axis → (n,) which nodes lie on the mirror plane across it
    """

    def __init__(self, surface: Surface, x: np.ndarray, cells: np.ndarray, mirrors: dict[int, float]):
        self.surface, self._cells, self._count = surface, cells, len(x)
        low = lowest(surface.comm, x.min(axis=0, initial=np.inf))
        self.size = float((highest(surface.comm, x.max(axis=0, initial=-np.inf)) - low).max())
        on_plane = {axis: (np.abs(x[surface.sides][..., axis] - value) < 1e-8 * self.size).all(axis=1)
                    for axis, value in mirrors.items()}
        self.mirrors = dict(mirrors)
        self.on_plane = {axis: surface.marked(sides, len(x)) for axis, sides in on_plane.items()}
        self.sides = ~np.any([*on_plane.values(), np.zeros(len(surface.sides), bool)], axis=0)
        self.nodes = surface.marked(self.sides, len(x))
        self._mids, self._ends = mid_nodes(cells, surface.dim)

    @classmethod
    def of_arrays(cls, x: np.ndarray, cells: np.ndarray, sides: np.ndarray, kinematics: Kinematics,
                  mirrors: dict[int, float]) -> FreeSurface:
        """A whole body on this rank alone."""
        return cls(Surface(sides, x, kinematics), x, cells, mirrors)

    @classmethod
    def of_mesh(cls, nodes: Nodes, kinematics: Kinematics, mirrors: dict[int, float]) -> FreeSurface:
        """A body on all the ranks of its mesh. Collective."""
        return cls(Surface.of(nodes, kinematics), nodes.x, nodes.cells, mirrors)

    def volume(self, x: np.ndarray) -> float:
        """Volume of the body, mm³ (mm² in plane strain). Collective."""
        return self.surface.volume(x)

    def offset_to(self, wanted: float, x: np.ndarray, tools=(), *, pressed: np.ndarray | None = None) -> Restored:
        """Move the nodes ``x`` (n, dim), in place, until the body has the ``wanted`` volume. Collective.

        Nodes on a tool and ``pressed`` ones (n,) keep their place, nodes on a mirror plane stay on it and those of the
        axis keep r = 0. Nodes that are driven into a tool are put back onto it, and the others make up for them.
        Mid-nodes below the surface go half-way with the end of their edge, so that a cell loses a tenth of its height
        and no more at once. A cell that little is left of, a lip or the bottom of a notch, keeps its place as well.
        """
        before = volume = self.volume(x)
        moved, free, start = 0.0, np.flatnonzero(self.nodes), x.copy()
        spent = np.zeros(len(x), bool)
        for _ in range(MOST_CALLS["out" if wanted > volume else "in"]):
            if abs(volume - wanted) <= EXACT * wanted:
                break
            held = self._on_tools(x, free, tools) | spent
            direction = self.directions(x, held if pressed is None else held | pressed)
            if self.surface.volume_rate(x, direction) <= 1e-12 * wanted / self.size:
                if highest(self.surface.comm, float(spent.any())) > 0:
                    break
                return Restored(before, volume, moved, "the body has no free surface")
            bound = self._bound(x, direction)
            distance = self._distance(x, direction, wanted, bound)
            share = self._allowed(x, distance * direction)
            if share < 1.0 or abs(distance) >= bound:
                newly = self._spent(start, x, share * distance * direction) & ~spent
                if highest(self.surface.comm, float(newly.any())) > 0:
                    spent |= newly
                    continue
            distance *= share
            x += distance * direction
            moved += distance
            if len(tools):
                level = {axis: x[on, axis] for axis, on in self.on_plane.items()}
                put_on_tools(x, tools, free, {}, 0.0)
                for axis, on in self.on_plane.items():      # where a tool slopes there, its normal leads away from it
                    x[on, axis] = level[axis]
            volume = self.volume(x)
        left, shortfall = volume / wanted - 1.0, None
        if abs(left) > 100 * EXACT:
            shortfall = (f"a volume error of {left:+.1e} is left: the free surface would have to move by more than "
                         f"{abs(moved):.3g} mm")
        return Restored(before, volume, moved, shortfall)

    def offset_around(self, wanted: float, x: np.ndarray, tools=(), *, pressed: np.ndarray | None = None,
                      met: np.ndarray | None = None) -> Restored:
        """The same where nodes ``met`` (n,) lie on another body: they stay, unless the body has no other free surface.
        Collective."""
        if met is None:
            return self.offset_to(wanted, x, tools, pressed=pressed)
        done = self.offset_to(wanted, x, tools, pressed=met if pressed is None else met | pressed)
        if done.shortfall is None:
            return done
        rest = self.offset_to(wanted, x, tools, pressed=pressed)
        return Restored(done.before, rest.after, done.distance + rest.distance, rest.shortfall)

    # ------------------------------------------------------------------ directions
    def directions(self, x: np.ndarray, held: np.ndarray) -> np.ndarray:
        """How every node moves for a unit offset of the free surface, (n, dim); ``held`` (n,) nodes stay. Collective."""
        moving = self.nodes & ~held
        chosen = self.sides & moving[self.surface.sides].any(axis=1)
        direction, cosine = self.surface.normals(x, chosen)
        # an edge goes so far that the sides beside it move by one
        direction[moving] /= np.maximum(cosine[moving], LEAST_COSINE)[:, None]
        direction[~moving] = 0.0
        for axis, on in self.on_plane.items():
            # within the plane, so far that the free surface beside it moves by one
            whole = np.einsum("ni,ni->n", direction[on], direction[on])
            direction[on, axis] = 0.0
            within = np.einsum("ni,ni->n", direction[on], direction[on])
            share = np.maximum(within / np.where(whole > 0, whole, 1.0), LEAST_COSINE**2)
            direction[on] /= share[:, None]
        inner = ~(self.nodes | held)[self._mids]
        ends = direction[self._ends[inner]]
        direction[self._mids[inner]] = 0.5 * (ends[:, 0] + ends[:, 1])
        return direction

    def _on_tools(self, x: np.ndarray, free: np.ndarray, tools) -> np.ndarray:
        held = np.zeros(len(x), bool)
        for tool in tools:
            held[free] |= tool.gap(x[free])[0] <= TOUCHING * self.size
        return held

    # ------------------------------------------------------------------ distance
    def _distance(self, x: np.ndarray, direction: np.ndarray, wanted: float, bound: float) -> float:
        """Newton on the volume, a cubic of the distance at most; cut to ± ``bound``."""
        distance = 0.0
        for _ in range(8):
            at = x + distance * direction
            missing = wanted - self.volume(at)
            if abs(missing) <= EXACT * wanted:
                break
            rate = self.surface.volume_rate(at, direction)
            if rate <= 0:        # farther than the surface can shrink
                return float(np.sign(missing)) * bound
            distance = float(np.clip(distance + missing / rate, -bound, bound))
        return distance

    def _bound(self, x: np.ndarray, direction: np.ndarray) -> float:
        """A tenth of the least height of the cells that change."""
        cells = self._changing(direction)
        p = x[cells[:, : self.surface.dim + 1]]
        least = float(_heights(p).min(initial=np.inf))
        return CAP * lowest(self.surface.comm, least) / max(1.0, self._longest(direction))

    def _longest(self, direction: np.ndarray) -> float:
        return highest(self.surface.comm, float(np.sqrt((direction**2).sum(axis=1)).max(initial=0.0)))

    def _allowed(self, x: np.ndarray, motion: np.ndarray) -> float:
        """Share of a motion, 1, 1/2, …, by which no cell loses more than MOST_LOSS of its Jacobian."""
        cells, share = self._changing(motion), 1.0
        before = _jacobians(x[cells])
        middle = before[:, -1:]
        spare = MOST_LOSS * np.maximum(before / middle, 0.1)       # a vertex may be singular before
        for _ in range(6):
            loss = (before - _jacobians(x[cells] + share * motion[cells])) / middle
            if highest(self.surface.comm, float((loss - spare).max(initial=-1.0))) <= 0:
                break
            share /= 2
        return share

    def _spent(self, start: np.ndarray, x: np.ndarray, motion: np.ndarray) -> np.ndarray:
        """Which nodes (n,) belong to cells that the motion would leave hardly anything of what they were at the start.
        Collective."""
        cells = self._changing(motion)
        before, after = _jacobians(start[cells]), _jacobians(x[cells] + motion[cells])
        flat = (after / before[:, -1:] < LEFT * np.maximum(before / before[:, -1:], 0.1)).any(axis=1)
        return self.surface.summed(np.bincount(cells[flat].ravel(), minlength=len(x)).astype(float)) > 0

    def _changing(self, motion: np.ndarray) -> np.ndarray:
        return self._cells[(motion != 0).any(axis=1)[self._cells].any(axis=1)]


def _heights(p: np.ndarray) -> np.ndarray:
    """Least height of straight-sided cells, (m, dim + 1, dim) → (m,)."""
    edges = p[:, 1:] - p[:, :1]
    if p.shape[2] == 2:
        opposite = np.concatenate([edges[:, 1:] - edges[:, :1], edges], axis=1)
        return np.abs(determinants(edges)) / np.sqrt((opposite**2).sum(axis=2).max(axis=1))
    # the rows of the inverse are the gradients of the barycentric coordinates, one over the heights
    gradients = np.linalg.inv(edges)
    gradients = np.concatenate([-gradients.sum(axis=2, keepdims=True), gradients], axis=2)
    return 1.0 / np.linalg.norm(gradients, axis=1).max(axis=1)


def _jacobians(p: np.ndarray) -> np.ndarray:
    """Determinants of quadratic cells at their vertices and in the middle, (m, 6 | 10, dim) → (m, dim + 2)."""
    dim = p.shape[2]
    at = np.concatenate([np.eye(dim + 1), np.full((1, dim + 1), 1 / (dim + 1))])
    slope = np.swapaxes(slopes(at, dim), 1, 2)
    gradient = slope[:, 1:] - slope[:, :1]
    if dim == 2:
        (a, c), (b, d) = ([p[..., i] @ gradient[:, k].T for k in range(2)] for i in range(2))
        return a * d - b * c
    return np.linalg.det(np.matmul(gradient, p[:, None]))


