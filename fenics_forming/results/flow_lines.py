"""Flow lines of a run: lines of material points, as VTK files beside the frames and as arrays over the frames."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .files import ResultsError, on_rank_zero, whole_file
from .recording.fields import padded, read_frames, start_frames, step_of, write_pvd

NAME = "flow_lines"


@dataclass(frozen=True)
class FollowedLine:
    """A line of material points through the frames of a run.

    Attributes
    ----------
    steps, times : (frames,), s
    places : (frames, points, dim) mm
    fields : histories such as ``effective_strain`` at the points, (frames, points) by name
    """

    steps: np.ndarray
    times: np.ndarray
    places: np.ndarray
    fields: dict[str, np.ndarray]


class FlowLineWriter:
    """Writes ``flow_lines_000012.vtu`` per frame and ``flow_lines.pvd``: all lines, told apart by the cell field "line".

    Parameters
    ----------
    folder : where the files go
    comm : MPI communicator
    resume_after : as for `FieldWriter`
    """

    def __init__(self, folder: Path, comm, *, resume_after: int | None = None):
        self.folder, self.comm = folder, comm
        self._frames = on_rank_zero(comm, lambda: start_frames(folder, NAME, resume_after))

    def write(self, *, step: int, time: float, places: dict[str, np.ndarray],
              fields: dict[str, dict[str, np.ndarray]]) -> None:
        """Write one frame. Collective.

        Parameters
        ----------
        step, time : number of the step; s
        places : line → (points, dim) mm
        fields : field → line → (points,)
        """
        file = f"{NAME}_{step:06d}.vtu"
        frames = [f for f in self._frames if f[1] != file] + [(float(time), file)]

        def write():
            _write_vtu(self.folder / file, places, fields)
            write_pvd(self.folder / f"{NAME}.pvd", frames)

        on_rank_zero(self.comm, write)
        self._frames = frames


def read_flow_line(results, name: str) -> FollowedLine:
    """A flow line of the scene by its name.

    Raises
    ------
    ResultsError
        if the scene names no such line or the run wrote no frames.
    """
    number, frames = _number_of(results, name), _frames(results)
    if not frames:
        raise ResultsError("the run wrote no flow lines; give it a folder for its results")
    read = [_read(path) for _, path in frames]
    rows = [lines[number] for _, lines in read]
    first = read[0][0].point_data
    return FollowedLine(
        steps=np.array([step_of(path.name, NAME) for _, path in frames]),
        times=np.array([time for time, _ in frames]),
        places=np.stack([frame.points[row, : results.scene.dimension] for (frame, _), row in zip(read, rows, strict=True)]),
        fields={field: np.stack([frame.point_data[field][row] for (frame, _), row in zip(read, rows, strict=True)])
                for field in first})


def lines_at(results, time: float) -> list[np.ndarray]:
    """The flow lines in the frame at a time, (points, dim) each, mm; empty if the run has none."""
    for at, path in _frames(results):
        if at == time:
            frame, lines = _read(path)
            return [frame.points[row, : results.scene.dimension] for row in lines]
    return []


def _frames(results):
    return [] if results.folder is None else read_frames(results.folder, NAME)


def _number_of(results, name):
    names = [] if results.scene is None else list(results.scene.flow_lines)
    if name not in names:
        raise ResultsError(f"the scene has no flow line '{name}'; its flow lines are {', '.join(names) or 'none'}")
    return names.index(name)


def _write_vtu(path, places, fields):
    import meshio

    ends = np.cumsum([0] + [len(row) for row in places.values()])
    sides = [np.arange(start, end - 1) for start, end in zip(ends, ends[1:], strict=False)]
    first = np.concatenate(sides)
    mesh = meshio.Mesh(
        padded(np.concatenate(list(places.values()))),
        [("line", np.stack([first, first + 1], axis=1))],
        point_data={field: np.concatenate([values[line] for line in places]) for field, values in fields.items()},
        cell_data={"line": [np.repeat(np.arange(len(sides)), [len(side) for side in sides])]},
    )
    with whole_file(path) as partial:
        meshio.write(partial, mesh, file_format="vtu", binary=True)


def _read(path):
    """The frame, and the rows of the points of each line in it."""
    import meshio

    try:
        frame = meshio.read(path)
    except (OSError, meshio.ReadError) as error:
        raise ResultsError(f"the frame '{path}' cannot be read: {error}") from None
    cells, numbers = frame.cells_dict["line"], frame.cell_data_dict["line"]["line"]
    return frame, [np.append(cells[numbers == k, 0], cells[numbers == k, 1][-1]) for k in range(numbers.max() + 1)]
