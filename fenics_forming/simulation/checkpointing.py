"""A run as a checkpoint, and back again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..physics.gather import scatter_cell_values, scatter_facets, scatter_nodal
from ..physics.tracking import MaterialPoints
from ..process.integration import Flow
from ..results.checkpoint import Checkpoint, save_checkpoint
from .state import State


def save(run, path: Path, state: State) -> None:
    """Write the state so that a run on any number of ranks can go on from it."""
    w, contact = run.body.workpiece, run.body.contact
    numbers, remembered = run.scheme.memory()
    moving, moved = (None, {}) if run.body.inertia is None else run.body.inertia.memory()
    masses = {} if w.mass is None else {"mass": w.mass.of_points}
    if run.deforming:
        from . import tool_states
        tool_states.save(run, path, state.step)
    save_checkpoint(path, run.nodes, scalars={
        "step": state.step, "time": state.time, "paused": state.paused, "cooled": state.cooled,
        "dt": state.dt, "speed": run.body.speed,
        "solved_speed": run.body.solved_speed,
        "mesh_size": run.mesh_size, "mirrors": with_words(run.mirrors), "bodies": run.body.making(),
        "points": _listed(run.points), "flow_lines": _listed(run.lines),
        "start_volume": run.start_volume, "start_extents": run.start_extents,
        "volume_ledger": run.volume_ledger.memory(),
        "power_ledger": run.power_ledger.memory(),
        "heat_ledger": None if run.heat_ledger is None else run.heat_ledger.memory(),
        "heat_tools": None if run.body.heat is None else run.body.heat.tool_memory(state.heat), "folds": run.folds.memory(),
        "contact_sizes": run.contact_sizes.memory(),
        "at_rest": w.is_cold, "penalty": None if contact is None else contact.reference, "inertia": moving,
        "rate_scale": 1.0 if w.last_rate is None else w.last_rate[1], "step_fraction": run.stepper.choice.fraction,
        "rams": run.body.rams.memory(),
        "free": {tool.name: tool.free.memory() for tool in run.body.tools
                 if tool.free is not None and tool.deformation is None},
        "deforming": {d.name: d.memory() for d in run.deforming},
        "size": run.body.size, "reach": run.body.reach, "scheme": numbers,
        "meshing": None if run.keeper is None else run.keeper.memory()},
        nodal={"velocity": w.velocity, "mean_stress": w.mean_stress,
               **{f"history.{name}": values for name, values in state.history.items()},
               **({} if run.body.heat is None else run.body.heat.saved(state.heat, state.flow.rates)),
               **{f"scheme.{name}": values for name, values in remembered.items()},
               **{f"inertia.{name}": values for name, values in moved.items()}},
        cellwise=dict(zip(("stress", "rate"), w.point_data(), strict=True), **masses),
        facetwise=None if contact is None else contact.memory(), facets=None if contact is None else contact.facets,
        between=run.body.between())


def resumed(run, checkpoint: Checkpoint) -> State:
    """The state of a checkpoint; body, scheme and steps of the run go on from there."""
    saved, body, workpiece = checkpoint.scalars, run.body, run.body.workpiece
    local = {name: scatter_nodal(run.nodes, values if run.comm.rank == 0 else None)
             for name, values in checkpoint.nodal.items()}
    run.stepper.choice.resume(saved["step_fraction"])
    run.scheme.remember(saved["scheme"], {name.removeprefix("scheme."): values for name, values in local.items()
                                           if name.startswith("scheme.")})
    body.speed, workpiece.is_cold = saved["speed"], saved["at_rest"]
    body.rams.remember(saved["rams"])
    deforming, stiffness = {d.name: d for d in run.deforming}, {}
    if deforming:
        from . import tool_states
        stiffness = tool_states.remember(run, run.saved_at, saved["step"])
    for tool in body.tools:
        if tool.name in deforming:
            deforming[tool.name].remember(body, saved["deforming"][tool.name], stiffness.get(tool.name))
        elif tool.free is not None:
            tool.free.remember(saved["free"][tool.name])
    if body.contact is not None:
        body.contact.reference = saved["penalty"]
    body.move_tools(saved["time"])
    body.solved_speed, body.size, body.reach = saved["solved_speed"], saved["size"], saved["reach"]
    history = {name: local[f"history.{name}"] for name in body.new_history()}
    cellwise = {name: scatter_cell_values(run.nodes, values if run.comm.rank == 0 else None)
                for name, values in checkpoint.cellwise.items()}
    if workpiece.mass is not None:
        workpiece.mass.remember(cellwise["mass"])
    if body.inertia is not None:
        body.inertia.remember(saved["inertia"], {name.removeprefix("inertia."): values for name, values in local.items()
                                                 if name.startswith("inertia.")})
    workpiece.is_cold = saved["at_rest"]        # tools that yield keep their rates in the search
    body.search(run.scheme.look_ahead * saved["dt"])
    if body.inertia is not None:
        body.speed = saved["speed"]
        body.inertia.remember_speeds(saved["inertia"])
    if saved["at_rest"]:
        flow = body.rest()
    else:
        workpiece.set_start(local["velocity"], local["mean_stress"])
        workpiece.set_point_data(cellwise["stress"], cellwise["rate"], saved["rate_scale"])
        if body.contact is not None:
            body.contact.resume(scatter_facets(run.nodes, body.contact.facets, checkpoint.facetwise),
                                local["velocity"])
        if body.interfaces is not None:
            body.interfaces.resume({name: scatter_facets(run.nodes, contact.points, checkpoint.between[name])["state"]
                                    for name, contact in body.interfaces.by_name.items()}, local["velocity"])
        flow = Flow(workpiece.velocity, body.rates(history), 0)
    heat = None
    if body.heat is not None:
        heat, rates = body.heat.resumed(local, saved["heat_tools"])
        if body.deformations:
            from ..process.heat.expansion import expand
            expand(body, heat)
        flow = replace(flow, rates=flow.rates | rates)
    return State(saved["step"], saved["time"], history, flow, saved["dt"], heat=heat, paused=saved["paused"],
                 cooled=saved["cooled"])


def with_words(table: dict) -> dict:
    """The same nested tables with words for keys, as JSON has them."""
    return {str(key): with_words(value) if isinstance(value, dict) else value for key, value in table.items()}


def _listed(points: MaterialPoints | None) -> dict[str, list]:
    return {} if points is None else {name: places.tolist() for name, places in points.places.items()}
