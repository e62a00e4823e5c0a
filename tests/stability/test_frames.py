"""A run does not know where it stands, which way it looks, or in which units it is told.

The same mesh is moved, turned, mirrored or enlarged with its tools, and the answer has to move, turn, be mirrored or
grow along: forces by stress times area, strains not at all.  What is left is rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from fenics_forming import simulate
from fenics_forming.physics.gmsh_arrays import gmsh_model
from fenics_forming.scene import Scene

CLOSE = {2: 1e-9, 3: 1e-4}     # of a force: rounding; in space what it grows to within the tolerance of Newton, 2e-3
TURN = np.deg2rad(37)
INSIDE = (2.9, 2.2, 1.3)


@dataclass(frozen=True)
class Frame:
    """x ↦ length · Q x + shift; stresses are ``stress`` times as large, times ``time`` times as long."""
    matrix: tuple = ()
    shift: tuple = ()
    length: float = 1.0
    stress: float = 1.0
    time: float = 1.0

    def vector(self, v):
        v = np.asarray(v, float)
        return v @ np.reshape(self.matrix, (v.shape[-1],) * 2).T if self.matrix else v

    def point(self, x):
        x = self.length * self.vector(x)
        return x + self.shift if self.shift else x


def turned(axis, angle=TURN):
    """Rotation in the plane (axis None) or about a coordinate axis."""
    c, s = np.cos(angle), np.sin(angle)
    if axis is None:
        return (c, -s, s, c)
    first, second = {0: (1, 2), 1: (2, 0), 2: (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[[first, first, second, second], [first, second, first, second]] = c, -s, s, c
    return tuple(matrix.ravel())


PLANE = {"moved": Frame(shift=(130.0, -70.0)), "turned": Frame(turned(None)), "mirrored": Frame((-1, 0, 0, 1)),
         "turned, moved": Frame(turned(None, 2.6), (3.0, 40.0)), "inches": Frame(length=25.4),
         "microns": Frame(length=1e-3), "soft": Frame(stress=1e-3), "hard and fast": Frame(stress=40.0, time=1e-4),
         "slow": Frame(time=1e4)}
SPACE = {"moved": Frame(shift=(10.0, -70.0, 33.0)), "turned": Frame(turned(0)),
         "mirrored": Frame((1, 0, 0, 0, -1, 0, 0, 0, 1)), "x is the height": Frame((0, 0, 1, 1, 0, 0, 0, 1, 0)),
         "large, hard, slow": Frame(length=100.0, stress=7.0, time=60.0)}


@pytest.fixture(scope="module")
def meshes(tmp_path_factory):
    """Points and cells of an unstructured block in the plane and in space, and a writer of their moved copies."""
    folder = tmp_path_factory.mktemp("meshes")
    read = {}
    for dim, sides in ((2, (8.0, 5.0)), (3, (4.0, 5.0, 3.0))):
        with gmsh_model() as gmsh:
            (gmsh.model.occ.addBox if dim == 3 else gmsh.model.occ.addRectangle)(*[0.0] * 3, *sides)
            gmsh.model.occ.synchronize()
            gmsh.option.setNumber("Mesh.MeshSizeMax", 1.5 if dim == 3 else 1.0)
            gmsh.model.mesh.generate(dim)
            _, points, _ = gmsh.model.mesh.getNodes()
            order = gmsh.model.mesh.getNodes()[0].astype(int)
            _, _, nodes = gmsh.model.mesh.getElements(dim)
            place = np.empty(order.max() + 1, int)
            place[order] = np.arange(len(order))
            read[dim] = np.reshape(points, (-1, 3))[:, :dim], place[np.reshape(nodes[0].astype(int), (-1, dim + 1))]

    def write(dim, frame, name):
        import meshio

        points, cells = read[dim]
        moved = frame.point(points)
        if frame.matrix and np.linalg.det(np.reshape(frame.matrix, (dim, dim))) < 0:
            cells = cells[:, [1, 0, *range(2, dim + 1)]]
        path = folder / f"{name}_{dim}.msh"
        meshio.write(path, meshio.Mesh(np.pad(moved, ((0, 0), (0, 3 - dim))), {"tetra" if dim == 3 else "triangle": cells}),
                     file_format="gmsh22", binary=False)
        return str(path)

    return write


def plane(point, normal):
    return {"shape": {"kind": "plane", "point": list(point), "normal": list(normal)}}


def scene_of(dim, frame: Frame, path: str, shifting: str) -> Scene:
    """A block on a rough bed, pressed by a plate that comes down on it aslant."""
    up, height = ([0, 1], 5.0) if dim == 2 else ([0, 0, 1], 3.0)
    down, top = [-c for c in up], [height * c for c in up]
    come = np.array([0.3, -1.0] if dim == 2 else [0.2, -0.3, -1.0])
    stress, speed = frame.stress, frame.length / frame.time
    return Scene.read({
        "geometry": "3d" if dim == 3 else "plane_strain",
        "materials": {"m": {"flow_stress": {"law": "swift", "K": 500 * stress, "prestrain": 0.05, "n": 0.2}}},
        "workpieces": {"b": {"shape": {"kind": "file", "path": path}, "material": "m"}},
        "points": {"p": {"body": "b", "at": list(frame.point(INSIDE[:dim]))}},
        "tools": {"upper": plane(frame.point(top), frame.vector(down)) | {
                      "drive": {"kind": "speed", "velocity": list(frame.vector(come) * speed)},
                      "friction": {"law": "coulomb", "coefficient": 0.15}},
                  "lower": plane(frame.point([0.0] * dim), frame.vector(up)) | {
                      "friction": {"law": "siebel", "factor": 0.6}}},
        "process": {"shifting": shifting},
        "steps": {"time": 0.1 * frame.time}, "stop": {"time": 0.5 * frame.time}})


def answers(scene: Scene):
    """Forces (steps,) of the upper tool, largest strains (steps,), and where a point has gone (dim,)."""
    results = simulate(scene)
    columns = results.history.columns
    force = next(results.history.column(c) for c in columns if c.startswith("force_upper"))
    gone = [results.history.column(c)[-1] for c in columns if c.startswith("p_") and c.endswith("_mm")]
    return force, results.history.column("max_effective_strain"), np.array(gone)


@pytest.fixture(scope="module")
def at_home(meshes):
    known = {}

    def ask(dim, shifting):
        if (dim, shifting) not in known:
            known[dim, shifting] = answers(scene_of(dim, Frame(), meshes(dim, Frame(), "home"), shifting))
        return known[dim, shifting]

    return ask


@pytest.mark.parametrize("dim, name, shifting", [(2, name, "midpoint") for name in PLANE] + [
    (2, "turned, moved", "etd2"), (2, "turned", "rotation"), (2, "mirrored", "trapezoid"), (2, "inches", "substeps")] + [
    (3, name, "midpoint") for name in SPACE])
def test_the_answer_is_the_same_in_every_frame(dim, name, shifting, meshes, at_home):
    frame = (PLANE if dim == 2 else SPACE)[name]
    force, strain, gone = at_home(dim, shifting)
    seen = answers(scene_of(dim, frame, meshes(dim, frame, name.replace(", ", "_")), shifting))
    scale = frame.stress * frame.length ** (dim - 1)           # in the plane a force is one per depth
    assert seen[0] / scale == pytest.approx(force, abs=CLOSE[dim] * force.max())
    assert seen[1] == pytest.approx(strain, abs=CLOSE[dim] * strain.max())
    assert seen[2] == pytest.approx(frame.point(gone), abs=CLOSE[dim] * frame.length)
