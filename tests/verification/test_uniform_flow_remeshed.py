"""A flow that is uniform stays uniform through new meshes: nothing of the transfer may show in it."""

import pytest

import fenics_forming as ff


def compressed(scheme: str, remesh: dict | None) -> ff.Results:
    """A quarter of a block of 14 x 36 mm, halved without friction in 24 steps, its volume left as it comes."""
    body = {"shape": {"kind": "rectangle", "from": [0, 0], "to": [7, 18]}, "symmetry": ["x", "y"], "material": "m",
            "mesh_size": 2.4}
    return ff.simulate(ff.Scene.read({
        "geometry": "plane_strain",
        "materials": {"m": {"flow_stress": {"law": "swift", "K": 300, "prestrain": 0.05, "n": 0.25}}},
        "workpieces": {"b": body if remesh is None else body | {"remesh": remesh}},
        "tools": {"t": {"shape": {"kind": "plane", "point": [0, 18], "normal": [0, -1]},
                        "drive": {"kind": "speed", "velocity": [0, -2]}}},
        "points": {"p": {"body": "b", "at": [3, 4]}, "q": {"body": "b", "at": [5, 15]}},
        "process": {"volume_constancy": False}, "steps": {"stroke": 9 / 24, "scheme": scheme}, "stop": {"stroke": 9},
        "output": {"fields_every": 0}}))


@pytest.mark.parametrize("scheme", ["explicit", "etd2"])
def test_points_go_the_same_way_whether_the_mesh_is_renewed_in_every_step_or_never(scheme):
    """Of one solve a step, the nodes move with what is found right after the remeshing. 2e-4 measured; 1e-2 where the
    pressure under the rim of the platen was carried over as its mean with that of the free side, which has none."""
    once, always = (compressed(scheme, remesh).history for remesh in (None, {"every": 1}))
    for column in ("p_x_mm", "p_y_mm", "q_x_mm", "q_y_mm", "p_effective_strain"):
        assert always.column(column)[-1] == pytest.approx(once.column(column)[-1], rel=5e-4), column
