"""Stresses of a tool from a forming run: the contact forces of a stored step on the meshed, pre-stressed tool."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

from ..errors import SceneError
from ..physics.tool_body import NodalForces
from ..physics.tool_body.carrying import ContactForces, carried
from ..process.tools.bodies import MeshedTool, tool_body
from ..results.recording.contact_forces import kept_frames, read_contact_forces
from ..results.results import Results
from ..scene import Scene, check
from ..scene.tool_modes import mirror_problems
from .tools_alone import ToolSimulation


def tool_stresses(results: Results | Path | str, tool: str, *, frame: int = -1, path: bool = False,
                  scene: Scene | None = None, out: Path | str | None = None, observer=None,
                  comm=MPI.COMM_WORLD) -> Results:
    """Stresses, displacements and plastic zones of a tool under the contact forces of one frame of a forming run.

    The tool is put together first (interference, displaced supports); then the forces are brought on, in steps where it
    yields. Its own deformation does not act back on the workpiece.

    Parameters
    ----------
    results : of the run, or its folder
    tool : its name; it needs a material with elastic constants, or parts
    frame : number of the frame; negative ones count from the end
    path : go through all frames up to that one, each a step: for a tool that yields, whose state depends on the way
    scene : another scene to take the tool from, such as with a finer mesh or other parts; that of the run if not given
    out : folder for history, frames, summary; without it nothing is written

    Raises
    ------
    SceneError, ResultsError
        if the tool cannot deform or the run has not kept its contact forces.
    ConvergenceError
        if it cannot carry them.
    """
    results = results if isinstance(results, Results) else Results.read(results)
    scene = scene or results.scene
    alone = alone_with(scene, tool)
    if problems := [*mirror_problems(scene, tool)]:
        raise SceneError.joined(problems)
    check(alone)
    meshed = tool_body(scene, tool, comm)
    frames = [frame] if not path else range(len(kept_frames(results.folder))) if frame == -1 else range(frame + 1)
    states = []
    for number in frames:
        step, time, points, forces = read_contact_forces(results.folder, tool, number)
        states.append((time, loaded_by(meshed, ContactForces(points, forces))))
    title = f"{results.title}: {tool} at {time:.4g} s"
    simulation = ToolSimulation(alone.model_copy(update={"title": title}), comm=comm, tools={tool: states[-1][1]},
                                path=[(t, {tool: state.loads}) for t, state in states] if path else ())
    return simulation.run(out, observer=observer)


def alone_with(scene: Scene, tool: str) -> Scene:
    """The scene of one tool alone, with the contacts of its parts and the points in them.

    Raises
    ------
    SceneError
        if there is no such tool, or it is rigid.
    """
    if tool not in scene.tools:
        raise SceneError(f"there is no tool '{tool}'; allowed: {', '.join(scene.tools)}", key=f"tools.{tool}")
    description = scene.tools[tool]
    if not description.has_body:
        raise SceneError("is rigid; give it a 'material' with 'young' and 'poisson', or 'parts'", key=f"tools.{tool}",
                         allowed="a tool that deforms")
    bodies = description.solids(tool)
    named = type(scene.tools)
    materials = {solid.material for solid in bodies.values()}
    return scene.model_copy(update={
        "process": type(scene.process)(), "output": scene.output.model_copy(update={"strokes": ()}),
        "materials": named({name: m for name, m in scene.materials.items() if name in materials}),
        "workpieces": named(), "flow_lines": named(), "steps": None, "stop": None,
        "tools": named({tool: _resting(description)}),
        "points": named({name: point for name, point in scene.points.items() if point.body in bodies}),
        "contacts": tuple(c for c in scene.contacts if set(c.between) <= set(bodies))})


def _resting(tool):
    """A tool without what only forming knows: drive, friction of its surface, exchange of heat."""
    return type(tool)(**{key: getattr(tool, key) for key in tool.model_fields_set - {"drive", "friction", "heat_exchange"}})


def loaded_by(meshed: MeshedTool, acting: ContactForces) -> MeshedTool:
    """The tool with the forces of contact among its loads. Collective."""
    plane = meshed.body.state.name != "axisymmetric"
    nodal = carried(acting, meshed.body.nodes, meshed.surface, with_couples=plane)
    return replace(meshed, loads=(*meshed.loads, NodalForces(nodal)))
