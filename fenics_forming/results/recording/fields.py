"""Fields of a run as VTK files: ``fields_000012.vtu`` per frame and ``fields.pvd`` with the times."""

from __future__ import annotations

import re
import xml.etree.ElementTree as xml
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...physics.gather import gather_cell_values, gather_cells, gather_nodal
from ..files import ResultsError, on_rank_zero, whole_file

if TYPE_CHECKING:  # results are read without dolfinx
    from ...physics.nodes import Nodes

CELL_TYPES = {2: "triangle6", 3: "tetra10"}
# basix numbers the mid-nodes by the opposite vertices, VTK goes round: its node k is the basix node here
_TO_VTK = {2: [0, 1, 2, 5, 3, 4], 3: [0, 1, 2, 3, 9, 6, 8, 7, 5, 4]}
# the same VTK cell seen from the other side (vertices 1 and 2 exchanged): basix cells have no orientation
_REFLECTED = {2: [0, 2, 1, 5, 4, 3], 3: [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]}


class FieldWriter:
    """Writes the frames of a run; they do not depend on the number of ranks.

    Parameters
    ----------
    folder : where the files go; made if missing
    comm : MPI communicator
    series : first word of the names of the files
    resume_after : step after which a resumed run goes on: earlier frames are kept. None: a new run, which
        removes the frames that the ``fields.pvd`` of an earlier run lists.
    """

    def __init__(self, folder: Path | str, comm, *, series: str = "fields", resume_after: int | None = None):
        self.folder, self.comm, self._series = Path(folder), comm, series
        import meshio  # noqa: F401  a tenth of a second, before the run and not in its first step

        self._frames = on_rank_zero(comm, lambda: start_frames(self.folder, series, resume_after))

    def write(
        self,
        nodes: Nodes,
        *,
        step: int,
        time: float,
        point_data: dict[str, np.ndarray],
        cell_data: dict[str, np.ndarray] | None = None,
        body: str = "",
        positions: np.ndarray | None = None,
    ) -> Path:
        """Write one frame with the mesh as it lies now. Collective.

        Parameters
        ----------
        nodes : the mesh
        step, time : number of the step; s
        point_data : values at the nodes, (count,) or (count, dim), or one number for all; vectors get a third
            component
        cell_data : values per owned cell, (cells,) or (cells, k)
        body : name of the body, where a frame has several: one file for each
        positions : of the nodes, (count, dim) mm, where they are not those of the mesh
        """
        name = f"{self._series}_{step:06d}{'_' * bool(body)}{body}.vtu"
        points = gather_nodal(nodes, nodes.x if positions is None else positions)
        cells = gather_cells(nodes)
        at_nodes = {
            key: gather_nodal(nodes, values if np.ndim(values) else np.full(nodes.count, values))
            for key, values in point_data.items()
        }
        in_cells = {key: gather_cell_values(nodes, values) for key, values in (cell_data or {}).items()}
        frames = [f for f in self._frames if f[1] != name] + [(float(time), name)]
        on_rank_zero(self.comm, lambda: self._write(name, frames, points, cells, at_nodes, in_cells))
        self._frames = frames
        return self.folder / name

    def _write(self, name, frames, points, cells, at_nodes, in_cells):
        dim = points.shape[1]
        write_vtu(self.folder / name, points, vtk_cells(cells, points), at_nodes, in_cells, dim)
        write_pvd(self.folder / f"{self._series}.pvd", frames)


def start_frames(folder: Path, name: str, resume_after: int | None) -> list[tuple[float, str]]:
    """(time, file) of the frames ``NAME_000012.vtu`` up to a step, that are kept; removes the others that
    ``NAME.pvd`` lists, all of them where there is no step to resume after.
    """
    folder.mkdir(parents=True, exist_ok=True)
    old = [(time, path.name) for time, path in read_frames(folder, name)]
    kept = [f for f in old if resume_after is not None and step_of(f[1], name) <= resume_after]
    if kept:
        write_pvd(folder / f"{name}.pvd", kept)
    else:
        (folder / f"{name}.pvd").unlink(missing_ok=True)
    for frame in set(old) - set(kept):
        (folder / frame[1]).unlink(missing_ok=True)
    return kept


def step_of(file: str, name: str) -> int:
    """Number of the step in the name of a frame."""
    return int(re.match(rf"{name}_(\d+)", file)[1])


def vtk_cells(cells: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Cells of basix order in the order of VTK, all with positive volume."""
    dim = points.shape[1]
    out = cells[:, _TO_VTK[dim]]
    corners = points[out[:, : dim + 1]]
    inverted = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
    out[inverted] = out[inverted][:, _REFLECTED[dim]]
    return out


def write_vtu(path: Path, points, cells, at_nodes, in_cells, dim: int) -> None:
    """One binary VTK file of order-2 cells in VTK order; points and vectors get three components."""
    import meshio

    mesh = meshio.Mesh(
        padded(points),
        [(CELL_TYPES[dim], cells)],
        point_data={key: padded(values) for key, values in at_nodes.items()},
        cell_data={key: [padded(values)] for key, values in in_cells.items()},
    )
    with whole_file(path) as partial:
        meshio.write(partial, mesh, file_format="vtu", binary=True)


def read_frames(folder: Path | str, name: str = "fields") -> list[tuple[float, Path]]:
    """(time in s, path) of the frames that ``NAME.pvd`` lists; empty if there is none."""
    pvd = Path(folder) / f"{name}.pvd"
    if not pvd.exists():
        return []
    try:
        entries = xml.parse(pvd).getroot().iter("DataSet")
        return [(float(entry.attrib["timestep"]), pvd.parent / entry.attrib["file"]) for entry in entries]
    except (xml.ParseError, KeyError, ValueError) as error:
        raise ResultsError(f"'{pvd}' is not a list of frames: {error}") from None


def write_pvd(path: Path, frames: list[tuple[float, str]]) -> None:
    """The list of frames, (time, file); several files of one time are its parts."""
    root = xml.Element("VTKFile", type="Collection", version="0.1")
    collection = xml.SubElement(root, "Collection")
    parts: dict[float, int] = {}
    for time, name in frames:
        parts[time] = parts.get(time, -1) + 1
        xml.SubElement(collection, "DataSet", timestep=repr(time), part=str(parts[time]), file=name)
    xml.indent(root)
    with whole_file(path) as partial:
        xml.ElementTree(root).write(partial, xml_declaration=True, encoding="utf-8")


def padded(values) -> np.ndarray:
    """Vectors of the plane with a third component, as VTK has them; anything else as it is."""
    values = np.asarray(values)
    if values.ndim == 2 and values.shape[1] == 2:
        return np.column_stack([values, np.zeros(len(values))])
    return values
