"""What the user writes: frozen, comparable, printable, the same from Python and from TOML. Knows no mesh."""

from .checks import check
from .contacts import Contact
from .copies import copies
from .description import AXES, Scene
from .material import Material
from .meshes import BoxDomain, CylinderDomain, NearSurface, NearTool, Remesh, SphereDomain
from .process import SCHEMES, Adaptive, Process, Shifting, Steps, Stop
from .scene_file import read_scene, write_scene
from .settings import Output, Solver
from .shapes import BodyFile, Box, Circle, Cylinder, Polygon, Rectangle, Shape
from .solids import FaceLoad, FaceSprings, MeshSize, Part
from .tool import Tool
from .tool_shapes import CircleTool, CylinderTool, Plane, Polyline, SphereTool, Stl
from .tracked import FlowLine, TrackedPoint
from .workpiece import Workpiece

__all__ = [
    "Part",
    "MeshSize",
    "FaceSprings",
    "FaceLoad",
    "AXES",
    "SCHEMES",
    "Adaptive",
    "BodyFile",
    "Box",
    "BoxDomain",
    "Circle",
    "CircleTool",
    "Contact",
    "Cylinder",
    "CylinderDomain",
    "CylinderTool",
    "FlowLine",
    "Material",
    "NearSurface",
    "NearTool",
    "Output",
    "Plane",
    "Polygon",
    "Polyline",
    "Process",
    "Rectangle",
    "Remesh",
    "Scene",
    "Shape",
    "Shifting",
    "Solver",
    "SphereDomain",
    "SphereTool",
    "Steps",
    "Stl",
    "Stop",
    "Tool",
    "TrackedPoint",
    "Workpiece",
    "check",
    "copies",
    "read_scene",
    "write_scene",
]
