"""A tool as an elastic or elastic-plastic body: displacements, small strains, von Mises with isotropic hardening."""

from .body import ToolBody
from .elastic import ElasticSolver
from .field import ToolField, fields, solve_tool, solver_of
from .loads import BodyForce, Centrifugal, NodalForces, Pressure, Traction
from .plastic import PlasticSolver, ToolSettings
from .supports import FixedDisplacement, FixedPoint, PointSprings, Springs

__all__ = ["BodyForce", "Centrifugal", "ElasticSolver", "FixedDisplacement", "FixedPoint", "NodalForces", "PlasticSolver",
           "PointSprings", "Pressure", "Springs", "ToolBody", "ToolField", "ToolSettings", "Traction", "fields",
           "solve_tool", "solver_of"]
