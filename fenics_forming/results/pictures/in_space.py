"""Pictures of a body in space, off-screen with pyvista."""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np

from ..files import ResultsError, whole_file

SHADES = 40     # entries of the table of colours for a band


def draw(
    skin, values, label: str, levels, title: str, *, mesh: bool, lines=(), tools=(), path: Path | str | None
) -> np.ndarray:
    """Render the skin and the tools, triangles (k, 3, 3) each, and return the picture (height, width, 3).

    Where ``values`` (n,) are given they are shown in bands between ``levels``. With flow ``lines``, (k, 3) each, the
    body is seen through.

    Raises
    ------
    ResultsError
        if there is no display and none can be started.
    """
    _have_display()
    import pyvista

    def poly(points, triangles):
        return pyvista.PolyData(points, np.insert(triangles, 0, 3, axis=1).ravel())

    plotter = pyvista.Plotter(off_screen=True, window_size=(1200, 900))
    try:
        plotter.set_background("white")
        surface = poly(skin.points, skin.triangles)
        if values is None:
            seen_through = {"opacity": 0.4} if lines else {}
            plotter.add_mesh(surface, color="lightsteelblue", ambient=0.4, diffuse=0.6, specular=0.0, **seen_through)
        else:
            surface[label] = values
            bar = dict(
                title=label,
                color="black",
                vertical=True,
                position_x=0.84,
                position_y=0.2,
                height=0.6,
                width=0.08,
                n_labels=len(levels),
                fmt="%.4g",
                title_font_size=26,
                label_font_size=24,
                unconstrained_font_size=True,
            )
            plotter.add_mesh(
                surface,
                scalars=label,
                clim=(levels[0], levels[-1]),
                cmap=_bands(len(levels) - 1),
                ambient=0.55,
                diffuse=0.45,
                specular=0.0,
                scalar_bar_args=bar,
            )
        if mesh or values is None:
            sides = np.concatenate(skin.sides())
            net = pyvista.PolyData(skin.points, lines=np.insert(sides, 0, 3, axis=1).ravel())
            opacity = 0.2 if lines else 0.6
            drawn = plotter.add_mesh(net, color="black", line_width=1.5, opacity=opacity, lighting=False)
            # the lines lie in the surface: bring them forward, or half of them are lost
            drawn.mapper.SetResolveCoincidentTopologyToPolygonOffset()
            drawn.mapper.SetRelativeCoincidentTopologyLineOffsetParameters(0.0, -6.0)
        for triangles in tools:
            tool = poly(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)).clean()
            shown = plotter.add_mesh(tool, color="slategray", opacity=0.18, lighting=False)
            # where it touches the body it lies in its surface: push it back, or colours below it are veiled
            shown.mapper.SetResolveCoincidentTopologyToPolygonOffset()
            shown.mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(4.0, 4.0)
            edges = tool.extract_feature_edges(feature_angle=20, manifold_edges=False, boundary_edges=False)
            if edges.n_points:
                plotter.add_mesh(edges, color="slategray", line_width=1.5, lighting=False)
        for line in lines:
            plotter.add_mesh(pyvista.lines_from_points(line), color="black", line_width=2.0, lighting=False)
        plotter.add_text(title, position=(0.03, 0.9), viewport=True, font_size=11, color="black")
        plotter.add_axes(color="black", line_width=3)
        plotter.camera_position = "iso"
        plotter.enable_parallel_projection()
        plotter.enable_anti_aliasing("ssaa")
        plotter.camera.zoom(1.0)
        if path is None:
            return plotter.screenshot(return_img=True)
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path.with_suffix(path.suffix or ".png")) as partial:
            return plotter.screenshot(str(partial), return_img=True)
    finally:
        plotter.close()


def _bands(count: int) -> list[str]:
    """Colours of so many bands, each many times over: the bar blends neighbouring entries, and of a few its first and last
    bands would be twice as wide as the others."""
    import matplotlib

    shades = matplotlib.colormaps["viridis"](np.linspace(0.0, 1.0, count))
    return [matplotlib.colors.to_hex(shade) for shade in shades for _ in range(SHADES)]


def _have_display():
    """Start an X server without a screen where there is none; it ends with this process."""
    if os.environ.get("DISPLAY") or os.name != "posix":
        return
    if shutil.which("Xvfb") is None:
        raise ResultsError(
            "a picture of a body in space needs a display, and this machine has neither one nor Xvfb; "
            "install the package xvfb, or open fields.pvd in ParaView"
        )
    reading, writing = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(writing), "-screen", "0", "1280x1024x24", "-nolisten", "tcp"],
        pass_fds=(writing,),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(writing)
    with os.fdopen(reading) as pipe:
        number = pipe.readline().strip()
    if not number:
        raise ResultsError(
            "Xvfb did not start, and a picture of a body in space needs a display; "
            "set DISPLAY, or open fields.pvd in ParaView"
        )
    atexit.register(server.terminate)
    os.environ["DISPLAY"] = f":{number}"
