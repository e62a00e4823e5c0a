"""A tool as an elastic or elastic-plastic body: displacements, small strains, von Mises with isotropic hardening."""

from .assembled import AssembledSolver, PartContact
from .body import ToolBody
from .compliance import global_dofs
from .elastic import ElasticSolver
from .field import ToolField, fields, solve_tool, solver_of
from .loads import BodyForce, Centrifugal, NodalForces, PointTractions, Pressure, Traction
from .plastic import PlasticSolver, ToolSettings
from .supports import FixedDisplacement, FixedPoint, PointSprings, Springs

__all__ = ["AssembledSolver", "BodyForce", "Centrifugal", "ElasticSolver", "FixedDisplacement", "FixedPoint",
           "NodalForces", "PartContact", "PlasticSolver", "PointSprings", "PointTractions", "Pressure", "Springs",
           "ToolBody", "ToolField", "ToolSettings", "Traction", "fields", "global_dofs", "solve_tool", "solver_of"]
