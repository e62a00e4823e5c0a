"""Contact forces at single points, kept with the frames of a run: what the stresses of a tool are computed from."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ..files import ResultsError, on_rank_zero, whole_file

PATTERN = r"contact_(\d+)\.npz"


def wanted(scene) -> list[str]:
    """Tools whose contact forces are kept: those that are given as bodies with elastic constants."""
    return [name for name, tool in scene.tools.items() if tool.has_body and
            all(scene.materials[solid.material].elasticity is not None for solid in tool.solids(name).values())]


class ContactForceWriter:
    """Writes ``contact_000012.npz`` beside every frame.

    Parameters
    ----------
    folder : of the run · tools : names of the tools whose forces are kept
    resume_after : step after which a resumed run goes on; files of later steps are removed, all for a new run
    """

    def __init__(self, folder: Path, comm, tools, *, resume_after: int | None = None):
        self.folder, self.comm, self.tools = Path(folder), comm, list(tools)
        on_rank_zero(comm, lambda: remove_after(self.folder, -1 if resume_after is None else resume_after))

    @classmethod
    def of(cls, scene, folder: Path, comm, resume_after: int | None) -> ContactForceWriter | None:
        """One for the tools of a scene, None where there is none whose forces are wanted. Collective."""
        tools = wanted(scene)
        return cls(folder, comm, tools, resume_after=resume_after) if tools else None

    def write(self, contact, *, step: int, time: float, share: float) -> None:
        """``share`` of the forces of the last solve on the tools of a contact, in the frame of each. Collective."""
        arrays = {"time": np.array(time)}
        for tool in (t for t in contact.tools if t.name in self.tools):
            force = -share * tool.traction * contact.weights[:, None]
            acting = np.flatnonzero((force != 0).any(axis=1))
            motion = tool.motion
            turned = force[acting] if motion.centre is None else force[acting] @ motion.rotation()
            rows = self.comm.gather(np.column_stack([motion.to_tool(contact.points[acting]), turned]), 0)
            if rows is not None:
                points_and_forces = np.concatenate(rows)
                arrays[tool.name] = points_and_forces[np.lexsort(points_and_forces.T)]
        path = self.folder / f"contact_{step:06d}.npz"

        def save():
            with whole_file(path) as partial, open(partial, "wb") as file:
                np.savez(file, **arrays)

        on_rank_zero(self.comm, save)


def remove_after(folder: Path, step: int) -> None:
    """Remove the files of later steps."""
    for path in folder.glob("contact_*.npz"):
        found = re.fullmatch(PATTERN, path.name)
        if found and int(found[1]) > step:
            path.unlink(missing_ok=True)


def kept_frames(folder: Path | str) -> list[Path]:
    """The files with the contact forces of a run, in order."""
    return sorted(path for path in Path(folder).glob("contact_*.npz") if re.fullmatch(PATTERN, path.name))


def read_contact_forces(folder: Path | str, tool: str, frame: int = -1) -> tuple[int, float, np.ndarray, np.ndarray]:
    """Step, time (s), points (k, dim) mm and forces (k, dim) N of a frame; negative frames count from the end.

    Raises
    ------
    ResultsError
        if the run has kept none, or none of this tool.
    """
    paths = kept_frames(folder)
    if not -len(paths) <= frame < len(paths):
        kept = f"the run kept those of {len(paths)} frames" if paths else \
            "the run kept none; it keeps those of tools that have a material with elastic constants, or parts"
        raise ResultsError(f"there are no contact forces of frame {frame}: {kept}")
    path = paths[frame]
    with np.load(path, allow_pickle=False) as file:
        if tool not in file.files:
            names = ", ".join(name for name in file.files if name != "time") or "none"
            raise ResultsError(f"'{path.name}' holds no forces on the tool '{tool}'; it has those on {names}")
        rows = file[tool]
        time = float(file["time"])
    dim = rows.shape[1] // 2
    return int(re.fullmatch(PATTERN, path.name)[1]), time, rows[:, :dim], rows[:, dim:]
