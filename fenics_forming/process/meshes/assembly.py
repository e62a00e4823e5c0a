"""Renewing the meshes of some of several bodies: the others stay as they are, in one new mesh with them."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from ...errors import MeshError
from ...physics.gather import gather_cells, gather_nodal
from ...physics.meshing import from_arrays
from ...physics.parallel import on_first_rank
from ...physics.remeshing import BodyArrays
from ..body import FlowingBody
from .meeting import Meeting
from .neighbours import Neighbour, Neighbours
from .renewing import LANDED, Carried, Renewed, cells_width, renewed_arrays


def renew_bodies(body: FlowingBody, carried: Carried, wishes: dict[str, dict], mirrors: dict[str, dict[int, float]],
                 pairs: dict[str, tuple[str, str]]) -> Renewed:
    """New meshes of the bodies in ``wishes``, with the fields ``carried`` on the nodes of all; as ``remeshing.renew``.

    Parameters
    ----------
    wishes : body → what its new mesh must be like (``MeshKeeper.wishes``) · mirrors : of every body
    pairs : contact → the two bodies, which meet again where they pressed on one another

    Raises
    ------
    MeshError
        if one of them cannot be meshed; the sentence names it.
    """
    start = perf_counter()
    felt = {} if body.interfaces is None else {
        name: gather_nodal(body.nodes, mark) for name, mark in body.interfaces.pressed_by_pair().items()}
    nodes, kinematics, parts = body.nodes, body.workpiece.kinematics, body.parts
    x, cells = gather_nodal(nodes, nodes.x), gather_cells(nodes)
    given = carried.gathered(nodes)
    landed = LANDED * body.contact.facets.size()

    def meeting_of(pair: str, name: str) -> Meeting:
        contact = body.interfaces.by_name[pair]
        return Meeting(kinematics, contact.element, contact.interference, holds=body.interfaces.slaves[pair] == name)

    def make():
        pieces, volume, lost, engines, healed = [], {}, {}, [], []
        now = {name: _part(x, own) for name, own in
               zip(parts.names, np.split(cells, np.cumsum(parts.counts)[:-1]), strict=True)}
        before = dict(now)
        for name, (rows, old) in before.items():
            of_body = Carried(*({field: values[rows] for field, values in kind.items()}
                                for kind in (given.linear, given.quadratic)))
            if name not in wishes:
                pieces.append((old.x, old.cells, of_body.linear | of_body.quadratic))
                continue
            others = [Neighbour(now[other][1], felt[pair][rows], before[other][1], felt[pair][before[other][0]],
                                meeting_of(pair, name))
                      for pair, between in pairs.items() if name in between for other in between if other != name]
            try:
                placed, made, fields, volume[name], changes = renewed_arrays(
                    old, of_body, body.tools, kinematics, mirrors=mirrors[name], landed=landed,
                    neighbours=Neighbours(old, others, mirrors[name]) if others else None, **wishes[name])
            except MeshError as error:
                raise MeshError(f"'{name}': {error}") from error
            lost |= {f"{name}.{field}": change for field, change in changes.items()}
            engines.append(made.engine)
            healed += [f"'{name}': {sentence}" for sentence in made.healed]
            now[name] = rows, BodyArrays(placed, made.cells)
            pieces.append((placed, made.cells, fields))
        return pieces, volume, lost, engines, healed

    found = on_first_rank(nodes.comm, make)
    if found is None:
        joined, every, fields, told = np.empty((0, nodes.dim)), np.empty((0, cells_width(nodes.dim)), np.int64), None, None
    else:
        pieces, volume, lost, engines, healed = found
        first = np.cumsum([0, *(len(piece[0]) for piece in pieces)])
        joined = np.concatenate([piece[0] for piece in pieces])
        every = np.concatenate([piece[1] + n for piece, n in zip(pieces, first, strict=False)])
        fields = {name: np.concatenate([piece[2][name] for piece in pieces]) for name in pieces[0][2]}
        told = (volume, lost, (len(cells), len(every)), ", ".join(dict.fromkeys(engines)), tuple(healed),
                perf_counter() - start, [len(piece[1]) for piece in pieces])
    told = nodes.comm.bcast(told, 0)
    return Renewed(from_arrays(joined, every, nodes.comm), fields, *told)


def _part(x: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, BodyArrays]:
    """Rows of the nodes of some cells, and these alone as a body."""
    rows, local = np.unique(cells, return_inverse=True)
    return rows, BodyArrays(x[rows], local.reshape(cells.shape))
