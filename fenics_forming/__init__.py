"""fenics_forming: metal forming on FEniCSx.

    import fenics_forming as ff
    results = ff.simulate(ff.read_scene("billet_upsetting.toml"))

Parts are imported when they are first used, so that reading and checking a scene needs no dolfinx.
"""

from __future__ import annotations

from importlib import import_module

__version__ = "0.1.0"

_HOMES = {
    "Scene": "scene", "read_scene": "scene", "write_scene": "scene", "check": "scene",
    "FormingError": "errors", "SceneError": "errors", "ConvergenceError": "errors", "MeshError": "errors",
    "Simulation": "simulation", "simulate": "simulation", "tool_stresses": "simulation.tool_stresses",
    "Results": "results.results", "History": "results.history",
    "plot_force_stroke": "results.pictures.plotting", "plot_fields": "results.pictures.plotting",
    "plot_revolved": "results.pictures.revolved", "plot_history": "results.pictures.curves",
    "animate": "results.pictures.animation",
    "write_report": "results.report",
    "plot_contact_pressure": "results.surface", "contact_pressure": "results.surface",
    "solve_flow": "physics.flow", "FixedVelocity": "physics.flow", "FlowField": "physics.flow",
    "NewtonSettings": "physics.settings",
    **dict.fromkeys(("solve_tool", "ToolField", "ToolSettings", "FixedDisplacement", "FixedPoint", "Springs",
                     "PointSprings", "Pressure", "Traction", "BodyForce", "Centrifugal", "NodalForces"),
                    "physics.tool_body"),
    "library": "laws.library",
    "laws": "laws", "scene": "scene", "meshing": "physics.meshing", "kinematics": "physics.kinematics",
}
_MODULES = {"laws", "scene", "meshing", "kinematics"}

__all__ = [*_HOMES, "__version__"]


def __getattr__(name: str):
    if name not in _HOMES:
        raise AttributeError(f"module 'fenics_forming' has no attribute '{name}'")
    module = import_module(f".{_HOMES[name]}", __name__)
    return module if name in _MODULES else getattr(module, name)


def __dir__():
    return sorted(__all__)
