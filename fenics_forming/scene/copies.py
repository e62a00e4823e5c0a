"""How much of the whole body the modelled part stands for."""


def copies(scene, direction=None, name=None):
    """Parts of the whole body that the mesh stands for; with a direction, those on which the same tool pushes.

    A mirror plane across the direction of the force has another tool on its far side. Without the `name` of a body those
    of all together.
    """
    bodies = scene.workpieces.values() if name is None else [scene.workpieces[name]]
    axes = {scene.axes.index(a) for body in bodies for a in body.symmetry}
    return 2 ** sum(direction is None or abs(direction[a]) < 0.5 for a in axes)
