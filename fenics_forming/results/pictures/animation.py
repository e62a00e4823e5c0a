"""A run as a film: one picture for each frame, as a GIF, or as MP4 where ffmpeg is there."""

from __future__ import annotations

import shutil
import subprocess
from io import BytesIO
from pathlib import Path

import numpy as np

from ..files import ResultsError, whole_file
from .drawing import AXES, close, frame_of, limits_of, mirrors_of
from .in_plane import levels_of
from .plotting import plot_fields
from .skin import Skin
from .tools import visible

DPI = 100


def animate(results, field: str | None = "effective_strain", *, path: Path | str, fps: float = 8.0,
            mesh: bool = True, hold: float = 1.5) -> Path:
    """Write a film of a field over all frames, with the same colours and the same view throughout.

    Parameters
    ----------
    results : `Results` of a run with frames
    field : name of a field, with or without its unit; None: the mesh
    path : the film; ``.gif``, or ``.mp4`` where ffmpeg is installed
    fps : frames in a second
    mesh : draw the sides of the elements
    hold : s that the last frame stands still

    Returns
    -------
    the path

    Raises
    ------
    ResultsError
        if there are fewer than two frames, no such field, or no ffmpeg for an MP4.
    """
    path = Path(path)
    if path.suffix not in (".gif", ".mp4"):
        raise ResultsError(f"'{path.name}': a film is a .gif or an .mp4")
    if path.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise ResultsError("an .mp4 needs ffmpeg, which is not installed; write a .gif")
    times = list(dict.fromkeys(time for time, _ in results.frames))
    if len(times) < 2:
        raise ResultsError(f"a film needs two frames and the run wrote {len(times)}; set output.fields_every in the scene")
    skins = [Skin.read(frame_of(results, number)[1]) for number in range(len(times))]
    magnify = visible(results, skins[-1])
    how = {"mesh": mesh, "magnify": magnify, "limits": None if field is None else _common_limits(skins, field)}
    if skins[0].points.shape[1] == 3:
        pictures = [plot_fields(results, field, k, **how) for k in range(len(times))]
    else:
        view = _view(results, [skin.deformed(magnify) for skin in skins])
        pictures = _cut([plot_fields(results, field, k, view=view, **how) for k in range(len(times))])
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as partial:
        (_write_gif if path.suffix == ".gif" else _write_mp4)(partial, pictures, fps, hold)
    return path


def _common_limits(skins, field):
    low, high = np.transpose([limits_of(skin, skin.field(field)[1]) for skin in skins[1:]])
    levels = levels_of((low.min(), high.max()), 16)
    return levels[0], levels[-1]


def _view(results, skins):
    """Corners (low, high) of all the body in all frames, mirrored as it is shown."""
    axes = AXES.get(getattr(results.scene, "geometry", None), "xy")
    corners = []
    for skin in skins:
        for axis, at in mirrors_of(results.scene, axes, skin.points):
            skin = skin.mirrored(axis, at)
        corners += [skin.points.min(axis=0), skin.points.max(axis=0)]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    return low - 0.05 * (high - low).max(), high + 0.05 * (high - low).max()


def _cut(drawn):
    """Pictures (height, width, 3) of all frames, cut to one size, that of the last and its margin."""
    for ax in drawn:
        ax.figure.draw_without_rendering()
        ax.figure.set_layout_engine("none")         # laid out once: a second time would move it by some pixels
    whole = drawn[-1].figure.get_tightbbox().padded(0.12)
    return [_as_array(ax, whole) for ax in drawn]


def _as_array(ax, box):
    from PIL import Image

    with BytesIO() as buffer:
        ax.figure.savefig(buffer, format="png", dpi=DPI, bbox_inches=box)
        close(ax)
        return np.array(Image.open(buffer).convert("RGB"))


def _write_gif(path, pictures, fps, hold):
    from PIL import Image

    images = [Image.fromarray(picture).quantize(128, dither=Image.Dither.NONE) for picture in pictures]
    times = [1000 / fps] * (len(images) - 1) + [1000 / fps + 1000 * hold]
    images[0].save(path, save_all=True, append_images=images[1:], duration=times, loop=0)


def _write_mp4(path, pictures, fps, hold):
    height, width = (size - size % 2 for size in pictures[0].shape[:2])
    pictures = [*pictures, *([pictures[-1]] * round(hold * fps))]
    command = ["ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}",
               "-r", str(fps), "-i", "-", "-pix_fmt", "yuv420p", str(path)]
    raw = b"".join(np.ascontiguousarray(picture[:height, :width]).tobytes() for picture in pictures)
    done = subprocess.run(command, input=raw, capture_output=True)
    if done.returncode:
        raise ResultsError(f"ffmpeg could not write '{path}': {done.stderr.decode(errors='replace').strip()}")
