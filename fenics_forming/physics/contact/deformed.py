r"""The contact surface of a tool that has deformed: the surface as it was described, and small displacements of it.

A point x of space meets the deformed surface where x pulled back, :math:`x-u(c)`, meets the undeformed one: two searches,
:math:`c_0=\mathrm{closest}(x)`, :math:`c=\mathrm{closest}(x-u(c_0))`, then :math:`g=(x-u(c)-X_c)\cdot n`.  With u = 0.2 mm
on fillets of 1 to 5 mm the gap is right to 2e-5 mm; no tree is built anew.  The normal turns with the sides of the mesh.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from .tool_surface import ToolSurface


class DeformedSurface:
    """Displacements of the surface of a tool, and what they make of its gap.

    Parameters
    ----------
    surface : `ToolSurface`

    Attributes
    ----------
    u : (n, dim) mm, in the frame of the tool
    """

    def __init__(self, surface: ToolSurface):
        self.surface = surface
        self.u = np.zeros((surface.count, surface.dim))
        self._last: tuple | None = None         # points of the last search, and their feet

    def gap(self, undeformed, motion, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signed gap (k,) and normal (k, dim) out of the tool at points in space.

        undeformed : surface of the tool as it was described (``surfaces``)
        """
        y, surface = motion.to_tool(points), self.surface
        gap, normal = undeformed.closest(y)
        self._last = None
        if not self.u.any():
            return gap, motion.turn(normal)
        first = surface.displaced(*surface.feet(y - gap[:, None] * normal)[:2], self.u)
        gap, normal = undeformed.closest(y - first)
        side, shapes, _ = surface.feet(y - first - gap[:, None] * normal)
        self._last = points, side, shapes
        gap -= np.einsum("ki,ki->k", surface.displaced(side, shapes, self.u) - first, normal)
        return gap, motion.turn(surface.turned(normal, side, shapes, self.u))

    def interpolation(self, motion, points: np.ndarray, gap: np.ndarray, normal: np.ndarray,
                      here: np.ndarray) -> sp.csr_matrix:
        """Displacements of the nodes, node by node, in the frame of the tool → those of the surface in space opposite to
        points with these gaps and normals, (k · dim, n · dim); no rows where not ``here`` (k,)."""
        if self._last is not None and self._last[0] is points:
            _, side, shapes = self._last
        else:
            y = motion.to_tool(points - gap[:, None] * normal)
            side, shapes, _ = self.surface.feet(y)
            if self.u.any():
                side, shapes, _ = self.surface.feet(y - self.surface.displaced(side, shapes, self.u))
        blocks = self.surface.interpolation(side, shapes, here)
        if motion.centre is None or motion.angle == 0.0:
            return blocks
        return sp.kron(sp.identity(len(points)), motion.rotation(), format="csr") @ blocks
