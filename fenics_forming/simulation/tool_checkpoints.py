"""A run of tools alone as checkpoints, one file for each tool, and back again."""

from __future__ import annotations

from pathlib import Path

from ..physics.gather import scatter_facets
from ..physics.tool_body.memory import ToolMemory
from ..results.checkpoint import load_checkpoint, save_checkpoint
from ..results.files import ResultsError


def path_of(first: Path, tool: str, tools) -> Path:
    """The file of a tool beside that of the first one."""
    return first if tool == next(iter(tools)) else first.with_name(f"checkpoint_{tool}.npz")


def save(run, folder: Path, step: int) -> None:
    """Write the state of all tools after a step. Collective."""
    for name, tool in reversed(run.tools.items()):      # the first one last: where it is new, all are
        memory, contacts = tool.memory(), list(run.contacts(name).items())
        between = {label: (contact.points, {"state": rows})
                   for (label, contact), rows in zip(contacts, memory.between, strict=True)}
        save_checkpoint(path_of(folder / "checkpoint.npz", name, run.tools), tool.tool.body.nodes,
                        scalars={"step": step, "numbers": memory.numbers}, nodal=memory.nodal, cellwise=memory.cellwise,
                        between=between)


def saved_step(path: Path) -> int:
    """The step after which a checkpoint was written."""
    return int(load_checkpoint(path).scalars["step"])


def resumed(run, path: Path, stages) -> int:
    """Take the tools to where a checkpoint has them; the number of the step. Collective.

    Raises
    ------
    ResultsError
        if the files of several tools are not of one step.
    """
    step = saved_step(path)
    for name, tool in run.tools.items():
        nodes = tool.tool.body.nodes
        found = load_checkpoint(path_of(path, name, run.tools), nodes)
        if found.scalars["step"] != step:
            raise ResultsError(f"the checkpoint of '{name}' is of step {found.scalars['step']}, that of the first tool of "
                               f"step {step}; run without --resume")
        between = [scatter_facets(nodes, contact.points, found.between.get(label))["state"]
                   for label, contact in run.contacts(name).items()]
        wanted = stages[step - 1].wanted if step else None
        tool.remember(ToolMemory(found.scalars["numbers"], found.nodal, found.cellwise, between),
                      loads=wanted[name] if isinstance(wanted, dict) else None)
    return step
