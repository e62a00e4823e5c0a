"""Pictures of a body in the plane, with matplotlib."""

from __future__ import annotations

import numpy as np


def draw(ax, skin, values, label: str, limits, *, mesh: bool, tools=(), lines=(), view=None) -> None:
    """Draw the body with its colour bar, the sides of its elements, outlines of tools, arrays (k, 2, 2) of
    segments, and flow lines (k, 2). Without ``values`` (n,) the mesh alone, paler under flow lines. ``view``: corners
    (low, high) of what is shown; None: the body and a margin.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.tri import Triangulation

    x, y = skin.points.T
    triangulation = Triangulation(x, y, skin.triangles)
    if values is None:
        ax.tripcolor(triangulation, np.zeros(len(x)), cmap="Greys", vmin=-1, vmax=8, shading="gouraud")
    else:
        good = np.isfinite(values)
        triangulation.set_mask(~good[skin.triangles].all(axis=1))
        spread = np.ptp(skin.points if view is None else view, axis=0)
        _coloured(ax, triangulation, np.where(good, values, 0.0), label, limits, spread)
    inside, rim = skin.sides()
    if mesh or values is None:
        width = 0.5 if values is None else 0.25
        colour = "0.55" if lines else "0.15"
        ax.add_collection(
            LineCollection(_curves(skin.points, inside), colors=colour, linewidths=width, alpha=0.7)
        )
    ax.add_collection(LineCollection(lines, colors="black", linewidths=0.8), autolim=False)
    ax.add_collection(
        LineCollection(_curves(skin.points, rim), colors="black", linewidths=1.0, capstyle="round")
    )
    ax.set_aspect("equal")
    ax.use_sticky_edges = False
    ax.margins(0.04)
    ax.autoscale_view()
    _draw_tools(ax, tools, skin.points)
    if view is not None:
        ax.set(xlim=(view[0][0], view[1][0]), ylim=(view[0][1], view[1][1]))


def _coloured(ax, triangulation, values, label, limits, spread):
    from mpl_toolkits.axes_grid1 import make_axes_locatable

    levels = levels_of(limits, 16)
    inside = values[triangulation.get_masked_triangles()]
    slack = 1e-6 * (levels[-1] - levels[0])
    over = bool(inside.max(initial=levels[0]) > levels[-1] + slack)
    under = bool(inside.min(initial=levels[-1]) < levels[0] - slack)
    extend = {(0, 0): "neither", (1, 0): "max", (0, 1): "min", (1, 1): "both"}[over, under]
    # round-off beyond the last level would leave a blank spot
    values = np.clip(values, None if under else levels[0], None if over else levels[-1])
    drawn = ax.tricontourf(triangulation, values, levels=levels, cmap="viridis", extend=extend)
    drawn.set_edgecolor("face")  # no white hairlines between the bands
    flat = spread[1] < 0.45 * spread[0]
    bar = make_axes_locatable(ax).append_axes("bottom" if flat else "right", 0.15, pad=0.6 if flat else 0.15)
    colourbar = ax.figure.colorbar(
        drawn, cax=bar, orientation="horizontal" if flat else "vertical", ticks=levels[::2]
    )
    peak = [f"highest {_figures(inside.max())}"] * over + [f"lowest {_figures(inside.min())}"] * under
    colourbar.set_label(", ".join([label] + peak))


def _curves(points, sides):
    """The sides of order 2 as short polylines through five points, (k, 5, 2)."""
    s = np.linspace(-1, 1, 5)[:, None]
    shapes = np.hstack([s * (s - 1) / 2, 1 - s**2, s * (s + 1) / 2])
    return np.einsum("sk,nkd->nsd", shapes, points[sides])


def _draw_tools(ax, tools, points):
    from matplotlib.collections import LineCollection

    view = np.array([ax.get_xlim(), ax.get_ylim()])
    for outline in tools:
        lines = LineCollection(outline, colors="0.4", linewidths=2.2, capstyle="round", zorder=0.9)
        ax.add_collection(lines, autolim=False)
    if len(tools):
        view += 0.03 * np.ptp(points, axis=0)[:, None] * [-1, 1]
    ax.set_xlim(*view[0])
    ax.set_ylim(*view[1])


def figure_size(points) -> tuple[float, float]:
    """Width and height in inches that leave little blank around the body."""
    spread = np.ptp(points, axis=0)
    shape = float(np.clip(spread[1] / max(spread[0], 1e-30), 0.2, 3.0))
    width = 7.0 if shape < 0.9 else max(3.8, 6.3 / shape)
    height = width * shape if shape < 0.45 else (width - 1.3) * shape
    return width, float(np.clip(height + (2.0 if shape < 0.45 else 1.2), 3.0, 8.5))


def levels_of(limits, most):
    """Round numbers from below the lower limit to above the upper one."""
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(nbins=most, steps=[1, 2, 2.5, 5, 10]).tick_values(*limits)


def _figures(value):
    """Three figures, no exponent where none is needed, a true minus."""
    return f"{float(f'{value:.3g}'):.6g}".replace("-", "\N{MINUS SIGN}")
