"""Forms are compiled once in a process, whatever mesh they are on."""

import pytest
import ufl
from dolfinx import fem, jit

from fenics_forming.physics import meshing
from fenics_forming.physics.compiling import remembering


def integral(mesh, power):
    x = ufl.SpatialCoordinate(mesh)
    return x[0]**power * ufl.dx(domain=mesh, metadata={"quadrature_degree": 4})


def test_a_form_is_compiled_once_and_belongs_to_its_own_mesh(monkeypatch):
    compiled = []

    def compile_form(comm, form, **options):
        compiled.append(form)
        return original(comm, form, **options)

    original = jit.ffcx_jit.__wrapped__
    monkeypatch.setattr(jit, "ffcx_jit", remembering(compile_form))
    meshes = [meshing.rectangle((0, 0), (width, 1), (2, 2)) for width in (1.0, 3.0)]
    for power in (1, 2):
        found = [fem.assemble_scalar(fem.form(integral(mesh, power))) for mesh in meshes]
        assert found == pytest.approx([1 / (power + 1), 3 ** (power + 1) / (power + 1)])
    assert len(compiled) == 2
