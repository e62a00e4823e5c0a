"""Checks of drives that concern more than one key: tools that follow others, and stops that only some drives know."""

from ..errors import SceneError
from ..laws import RatioDrive
from ..laws.described import unknown_word


def ratio_problems(scene):
    """Tools that follow others which do not move along a direction, or follow in a circle."""
    for name, tool in scene.tools.items():
        passed, follower = [name], tool.drive
        while isinstance(follower, RatioDrive):
            key, of = f"tools.{passed[-1]}.drive.of", follower.of
            if of not in scene.tools:
                yield unknown_word(f"'{of}' is not the name of a tool", of, scene.tools, key)
                break
            leader = scene.tools[of].drive
            if (why := "follows this one" if of in passed else _unfit(leader)) is not None:
                allowed = [n for n, t in scene.tools.items() if t.drive is not None and t.drive.direction is not None]
                yield SceneError(f"'{of}' {why}; expected a tool that moves along a direction", key=key, got=of,
                                 allowed=[n for n in allowed if n not in passed])
                break
            passed, follower = [*passed, of], leader


def _unfit(leader):
    """Why no tool can follow this drive; None if one can."""
    if leader is None:
        return "rests"
    if isinstance(leader, RatioDrive):
        return None
    if leader.force_limit is not None or leader.kind == "spring":
        return "yields at its force limit" if leader.force_limit is not None else "yields to its spring"
    return "only turns" if leader.direction is None else None


def stop_problems(scene, drive, name):
    """Stops that the drive of the tool that counts does not know."""
    stop = scene.stop
    if stop.dead_centre and drive.dead_centre_time is None:
        sentence = f"the drive '{drive.kind}' of the tool '{name}' has no dead centre; expected a crank_press"
        yield SceneError(sentence, key="stop.dead_centre", got=drive.kind, allowed="the drive 'crank_press'")
    if stop.energy_spent and not drive.spends_energy:
        sentence = f"the drive '{drive.kind}' of the tool '{name}' brings no energy; expected a hammer or screw_press"
        yield SceneError(sentence, key="stop.energy_spent", got=drive.kind, allowed="the drives 'hammer', 'screw_press'")
