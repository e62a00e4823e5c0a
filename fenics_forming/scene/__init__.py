"""What the user writes: frozen, comparable, printable, the same from Python and from TOML. Knows no mesh."""

from .checks import check
from .description import (
    AXES,
    SCHEMES,
    Adaptive,
    Material,
    Output,
    Process,
    Remesh,
    Scene,
    Solver,
    Steps,
    Stop,
    Tool,
    TrackedPoint,
    Workpiece,
)
from .scene_file import read_scene, write_scene
from .shapes import BodyFile, Box, Circle, Cylinder, Polygon, Rectangle, Shape
from .tool_shapes import CircleTool, CylinderTool, Plane, Polyline, SphereTool, Stl

__all__ = [
    "AXES",
    "SCHEMES",
    "Adaptive",
    "BodyFile",
    "Box",
    "Circle",
    "CircleTool",
    "Cylinder",
    "CylinderTool",
    "Material",
    "Output",
    "Plane",
    "Polygon",
    "Polyline",
    "Process",
    "Rectangle",
    "Remesh",
    "Scene",
    "Shape",
    "Solver",
    "SphereTool",
    "Steps",
    "Stl",
    "Stop",
    "Tool",
    "TrackedPoint",
    "Workpiece",
    "check",
    "read_scene",
    "write_scene",
]
