"""Tools that yield or have parts, in the checkpoints of a forming run: a file for each beside that of the workpiece."""

from __future__ import annotations

from pathlib import Path

from ..physics.gather import scatter_facets
from ..physics.tool_body.memory import ToolMemory
from ..results.checkpoint import load_checkpoint, save_checkpoint
from ..results.files import ResultsError


def _with_a_state(run) -> list:
    """The tools of a run with an inner state that is not in what their surface remembers."""
    return [d for d in run.deforming if d.tool is not None and d.tool.follows_a_tangent]


def _path(checkpoint: Path | str, name: str) -> Path:
    return Path(checkpoint).with_name(f"{Path(checkpoint).stem}_{name}.npz")


def _contacts(tool) -> dict:
    return dict(zip(tool.meshed.contact_names, getattr(tool.solver, "contacts", ()), strict=True))


def save(run, checkpoint: Path, step: int) -> None:
    """Write the states of the tools after a step, before the checkpoint that belongs to them. Collective."""
    for deformation in _with_a_state(run):
        tool = deformation.tool
        memory = tool.memory()
        between = {label: (contact.points, {"state": rows})
                   for (label, contact), rows in zip(_contacts(tool).items(), memory.between, strict=True)}
        save_checkpoint(_path(checkpoint, deformation.name), tool.body.nodes,
                        scalars={"step": step, "numbers": memory.numbers}, nodal=memory.nodal, cellwise=memory.cellwise,
                        between=between, whole={"stiffness": deformation.motions.stiffness})


def remember(run, checkpoint: Path, step: int) -> dict:
    """Take the tools to where a checkpoint has them: by name the stiffness of their unknown displacements then, which is
    that of their last tangent. What their surfaces remember comes after. Collective.

    Raises
    ------
    ResultsError
        if the file of a tool is not of this step.
    """
    stiffness = {}
    for deformation in _with_a_state(run):
        tool, path = deformation.tool, _path(checkpoint, deformation.name)
        nodes = tool.body.nodes
        found = load_checkpoint(path, nodes)
        if found.scalars["step"] != step:
            raise ResultsError(f"the checkpoint '{path}' of the tool '{deformation.name}' is of step "
                               f"{found.scalars['step']}, that of the workpiece of step {step}; run without --resume")
        between = [scatter_facets(nodes, contact.points, found.between.get(label))["state"]
                   for label, contact in _contacts(tool).items()]
        tool.remember(ToolMemory(found.scalars["numbers"], found.nodal, found.cellwise, between))
        stiffness[deformation.name] = found.whole["stiffness"]
    return stiffness
