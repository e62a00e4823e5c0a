"""The return mapping at points, and the elastic-plastic law: closed forms, tangent by differences, tables, unloading."""

import numpy as np
import pytest

from fenics_forming import SceneError, laws
from fenics_forming.physics.plasticity import elastic_tangent, plane_stress_return_map, return_map, von_mises

E, NU = 210e3, 0.3
SHEAR = E / (2 * (1 + NU))
PERFECT = laws.Elasticity(young=E, poisson=NU, yield_stress=300)
LINEAR = laws.Elasticity(young=E, poisson=NU, yield_stress=300, hardening=5e3)
TABLE = laws.Elasticity(young=E, poisson=NU, hardening=[(0, 300), (0.002, 340), (0.01, 400), (0.05, 410)])
LAWS = {"perfect": PERFECT, "linear": LINEAR, "table": TABLE}
MAPS = {"plane, axisymmetric": (4, return_map), "space": (6, return_map), "plane stress": (4, plane_stress_return_map)}


def virgin(strain):
    return np.zeros_like(strain), np.zeros(len(strain))


def strains(components, size=2e-3, count=400):
    return size * np.random.default_rng(3).standard_normal((count, components))


# ---------------------------------------------------------------------- law
def test_yield_curve_of_a_slope_and_of_a_table():
    strain = np.array([0.0, 0.001, 0.002, 0.006, 0.05, 1.0])
    assert LINEAR.yield_stress_at(strain) == pytest.approx(300 + 5e3 * strain)
    assert TABLE.yield_stress_at(strain) == pytest.approx([300, 320, 340, 370, 410, 410])
    assert TABLE.hardening_at(strain) == pytest.approx([2e4, 2e4, 7500, 7500, 0, 0])
    assert np.isinf(laws.Elasticity(young=E, poisson=NU).yield_stress_at(strain)).all()


def test_moduli_are_those_of_isotropic_elasticity():
    law = laws.Elasticity(young="210 GPa", poisson=0.3, expansion="1.2e-5 1/K")
    assert law.shear_modulus == pytest.approx(80769.2308) and law.bulk_modulus == pytest.approx(175e3)
    assert law.lame == pytest.approx(0.3 * 210e3 / (1.3 * 0.4))
    assert not law.yields and PERFECT.yields and TABLE.yields


@pytest.mark.parametrize("law", LAWS)
def test_plastic_strain_meets_trial_stress_and_yield_curve(law):
    """q_trial - 3 G (p - p_0) is the yield stress at p, also across corners of a table."""
    law = LAWS[law]
    before = np.linspace(0, 0.06, 200)
    trial = law.yield_stress_at(before) + np.linspace(1, 5000, 200)
    after = law.plastic_strain_of(trial, before)
    assert (after > before).all()
    assert trial - 3 * SHEAR * (after - before) == pytest.approx(law.yield_stress_at(after), rel=1e-12)


@pytest.mark.parametrize("keys, key, sentence", [
    ({"hardening": 100}, "yield_stress", "is missing"),
    ({"hardening": [(0.1, 300), (0.2, 400)]}, "hardening", "strain 0"),
    ({"hardening": [(0, 300), (0, 400)]}, "hardening", "not rising"),
    ({"hardening": [(0, 300), (1, 200)]}, "hardening", "not rising"),
    ({"hardening": [(0, 300), (1, "2 mm")]}, "hardening", "wrong dimension"),
    ({"hardening": [1, 2]}, "hardening", "pairs"),
    ({"hardening": -3, "yield_stress": 10}, "hardening", "negative"),
    ({"hardening": [(0, 300)], "yield_stress": 200}, "yield_stress", "leave one out"),
])
def test_law_that_cannot_be_meant_is_refused_at_its_key(keys, key, sentence):
    with pytest.raises(SceneError, match=sentence) as caught:
        laws.Elasticity(young=E, poisson=NU, **keys)
    assert caught.value.key == key


def test_law_goes_through_a_table_and_back():
    for law in (*LAWS.values(), laws.Elasticity(young=E, poisson=NU)):
        assert laws.Elasticity.read(law.as_table()) == law
    assert "hardening=5000 MPa" in repr(LINEAR)


# ---------------------------------------------------------------------- return mapping
def test_uniaxial_and_shear_follow_the_yield_curve():
    """Plane stress pulled along x: sigma = E_t-line through the yield point; pure shear in space: sqrt(3) tau = q."""
    strain = np.zeros((50, 4))
    strain[:, 0] = np.linspace(1e-4, 0.02, 50)
    # strains across are not given but found: along y by the slope of the elastic-plastic bar, -nu_eff
    stress_of = np.where(E * strain[:, 0] < 300, E * strain[:, 0], 300 + 5e3 / (1 + 5e3 / E) * (strain[:, 0] - 300 / E))
    elastic = stress_of / E
    strain[:, 1] = -NU * elastic - 0.5 * (strain[:, 0] - elastic)
    found = plane_stress_return_map(LINEAR, strain, *virgin(strain))
    assert found.stress[:, 0] == pytest.approx(stress_of, rel=1e-9)
    assert np.abs(found.stress[:, 1:]).max() < 1e-6 * 300
    assert strain[:, 2] == pytest.approx(strain[:, 1], abs=1e-12), "isotropic: alike in both directions across"

    shear = np.zeros((50, 6))
    shear[:, 5] = np.linspace(1e-4, 0.02, 50)       # sqrt(2) eps_xy
    found = return_map(PERFECT, shear, *virgin(shear))
    assert found.stress[:, 5] / np.sqrt(2) == pytest.approx(np.minimum(2 * SHEAR * shear[:, 5] / np.sqrt(2),
                                                                       300 / np.sqrt(3)), rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("components", [4, 6])
def test_uniform_volume_change_neither_yields_nor_matters(law, components):
    """Von Mises: any mean stress may be added; the deviator and the plastic strain stay what they were."""
    law, strain = LAWS[law], strains(components)
    volume = 0.05 * (np.arange(components) < 3)
    alone = return_map(law, volume[None] * [[1.0]], *virgin(volume[None]))
    assert not alone.yielding.any()
    without, with_it = (return_map(law, s, *virgin(s)) for s in (strain, strain + volume))
    assert with_it.plastic_strain == pytest.approx(without.plastic_strain, abs=1e-15)
    assert with_it.stress - without.stress == pytest.approx(np.broadcast_to(3 * law.bulk_modulus * volume, strain.shape),
                                                            abs=1e-8)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kind", MAPS)
def test_stress_lies_on_the_yield_surface_and_flow_is_normal_to_it(law, kind):
    """von Mises = yield stress; plastic strain increment along the deviator, no volume, its length the effective one."""
    components, mapping = MAPS[kind]
    law, strain = LAWS[law], strains(components)
    found = mapping(law, strain, *virgin(strain))
    assert 0.5 < found.yielding.mean() < 1
    flowing = found.yielding
    assert von_mises(found.stress)[flowing] == pytest.approx(law.yield_stress_at(found.effective)[flowing], rel=1e-10)
    assert (von_mises(found.stress)[~flowing] <= 300 * (1 + 2e-8)).all()
    plastic = found.plastic_strain
    assert np.abs(plastic[:, :3].sum(axis=1)).max() < 1e-16
    assert np.sqrt(2 / 3 * (plastic**2).sum(axis=1)) == pytest.approx(found.effective, abs=1e-16)
    work = np.einsum("pi,pi->p", found.stress, plastic)
    assert work == pytest.approx(von_mises(found.stress) * found.effective, rel=1e-9, abs=1e-12)
    # Hooke's law for the rest of the strain
    assert (strain - plastic) @ elastic_tangent(law, components) == pytest.approx(found.stress, abs=1e-6)
    if kind == "plane stress":
        assert np.abs(found.stress[:, 2]).max() < 1e-6


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kind", MAPS)
def test_tangent_is_the_derivative_of_the_stress(law, kind):
    """Central differences from a state with a history; points that are within the difference of a kink are left out."""
    components, mapping = MAPS[kind]
    law, start, strain, step = LAWS[law], strains(components, 1e-3), strains(components, 3e-3)[::-1], 1e-7
    before = mapping(law, start.copy(), *virgin(start))
    along = strains(components, 1.0)
    if kind == "plane stress":
        along[:, 2] = 0.0       # the strain across is an answer
    state = (before.plastic_strain, before.effective)
    found = mapping(law, strain.copy(), *state)
    high, low = (mapping(law, strain + s * along, *state) for s in (step, -step))
    same = (high.yielding == low.yielding) & (law.hardening_at(high.effective) == law.hardening_at(low.effective))
    assert same.mean() > 0.95
    by_tangent = np.einsum("pij,pj->pi", found.tangent, along)
    # the next term of the differences: step² over the square of the strains, 1e-8 of the slopes of 1e5 MPa; in plane
    # stress the strain across is settled to 1e-13, over the step 1e-6
    assert by_tangent[same] == pytest.approx(((high.stress - low.stress) / (2 * step))[same], abs=2e-6 * E)
    assert found.tangent == pytest.approx(np.swapaxes(found.tangent, 1, 2), abs=1e-9)


@pytest.mark.parametrize("law", LAWS)
def test_unloading_is_elastic_and_reloading_yields_where_it_was_left(law):
    law, strain = LAWS[law], strains(6, 4e-3)
    loaded = return_map(law, strain, *virgin(strain))
    flowing = loaded.yielding
    state = (loaded.plastic_strain[flowing], loaded.effective[flowing])
    # a tenth of the elastic strain less
    elastic = strain[flowing] - state[0]
    back = return_map(law, strain[flowing] - 0.1 * elastic, *state)
    assert not back.yielding.any() and back.plastic_strain is state[0]
    assert back.stress == pytest.approx(0.9 * loaded.stress[flowing], rel=1e-9, abs=1e-7)
    again = return_map(law, strain[flowing], *state)
    assert not again.yielding.any(), "on the yield surface, not beyond"
    assert again.stress == pytest.approx(loaded.stress[flowing], abs=1e-7)
    assert return_map(law, strain[flowing] + 1e-3 * elastic, *state).yielding.all()


def test_rotated_strain_gives_rotated_stress():
    """Isotropy: Mandel vectors turn like vectors under a rotation of the axes."""
    turn = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))[0]
    strain = strains(6)
    found = return_map(TABLE, strain, *virgin(strain))
    turned = return_map(TABLE, mandel(turn @ tensor(strain) @ turn.T), *virgin(strain))
    assert turned.stress == pytest.approx(mandel(turn @ tensor(found.stress) @ turn.T), abs=1e-9)


def tensor(vectors):
    a, b, c, bc, ac, ab = vectors.T
    s = np.sqrt(2)
    return np.moveaxis(np.array([[a, ab / s, ac / s], [ab / s, b, bc / s], [ac / s, bc / s, c]]), 2, 0)


def mandel(tensors):
    s = np.sqrt(2)
    return np.stack([tensors[:, 0, 0], tensors[:, 1, 1], tensors[:, 2, 2], s * tensors[:, 1, 2], s * tensors[:, 0, 2],
                     s * tensors[:, 0, 1]], axis=1)
