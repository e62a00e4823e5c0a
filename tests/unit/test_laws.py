"""Laws: values against closed forms, exact rate derivatives, no NaN anywhere, UFL equals numpy."""

import math
from typing import Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fenics_forming import laws
from fenics_forming.errors import FormingError, SceneError
from fenics_forming.laws.functions import maximum, power
from fenics_forming.units import Positive, Stress

GRID = {"strain": [0, 0.5, 2], "rate": [0.1, 1, 100], "temperature": [20, 1200]}
STRESSES = [[[100 + 50 * i + 10 * j - 30 * k for k in range(2)] for j in range(3)] for i in range(3)]
ALUMINIUM = {"alpha": "0.04 1/MPa", "n": 5.385, "activation_energy": "141.55 kJ/mol", "ln_A": 22.5}
STEEL = {"A": 1200, "m1": -0.0025, "m2": 0.02, "m3": 0.13, "m4": -0.02}
LAWS = [
    laws.Constant(value="100 MPa"),
    laws.Linear(initial=700, hardening=300),
    laws.Ludwik(initial=100, K=50, n=0.3),
    laws.Hollomon(K=200, n=0.2),
    laws.Swift(K=100 * 5**0.3, prestrain=0.2, n=0.3),
    laws.Voce(initial=100, saturation=200, rate=5),
    laws.NortonHoff(K=150, m=0.15),
    laws.Power(K=200, n=0.2, m=0.1),
    laws.JohnsonCook(A=350, B=275, n=0.36, C=0.022, m=1.0, melting_temperature=1500),
    laws.JohnsonCook(A=350, B=275, n=0.36),
    laws.HenselSpittel(**STEEL),
    laws.HenselSpittel(A=1200, m1=-0.0025, m2=0.02, m3=0.1, m4=-0.02, m5=1e-4, m7=-0.1, m8=1e-5, m9=0.05),
    laws.HenselSpittel(A=5050.22, m1=-0.003126, m2=0.359206, m3=-0.168624, m7=-0.702119, m8=0.000278),
    laws.HenselSpittel(A=5954, m1=-0.0033576, m2=0.2641, m3=-0.0868, m4=0.00022688, m8=0.0002264),
    laws.Sinh(**ALUMINIUM),
    laws.Table(**GRID, stress=STRESSES),
    laws.Table(**GRID, stress=STRESSES, rate_scale="logarithmic"),
    laws.Table(strain=[0, 1], stress=[100, 200]),
]


def named(law):
    return f"{law.law}-{len(law.model_fields_set)}"


@pytest.mark.parametrize(
    ("law", "stress"),
    [
        (laws.Constant(value=100), 100),
        (laws.Linear(initial=100, hardening=50), 100 + 50 * 0.4),
        (laws.Ludwik(initial=100, K=50, n=0.5), 100 + 50 * math.sqrt(0.4)),
        (laws.Hollomon(K=200, n=0.2), 200 * 0.4**0.2),
        (laws.Swift(K="162.06565966927624 MPa", prestrain=0.2, n=0.3), 100 * (1 + 5 * 0.4) ** 0.3),
        (laws.Voce(initial=100, saturation=200, rate=5), 200 - 100 * math.exp(-2)),
        (laws.NortonHoff(K=150, m=0.15), 150 * 3**0.15),
        (laws.Power(K=200, n=0.2, m=0.1), 200 * 0.4**0.2 * 3**0.1),
        (
            laws.JohnsonCook(A=350, B=275, n=0.36, C=0.022, m=1, melting_temperature=1520),
            (350 + 275 * 0.4**0.36) * (1 + 0.022 * math.log(3)) * (1 - 1130 / 1500),
        ),
        (
            laws.HenselSpittel(**STEEL, m5=-1e-4, m7=-0.1, m8=1e-5, m9=0.05),
            1200
            * math.exp(-0.0025 * 1150)
            * 1150**0.05
            * 0.4**0.02
            * math.exp(-0.02 / 0.4)
            * 1.4 ** (-1e-4 * 1150)
            * math.exp(-0.1 * 0.4)
            * 3**0.13
            * 3 ** (1e-5 * 1150),
        ),
        (
            laws.Sinh(**ALUMINIUM),
            math.asinh(math.exp((math.log(3) + 141550 / 8.314462618 / (1150 + 273.15) - 22.5) / 5.385)) / 0.04,
        ),
    ],
    ids=lambda value: value.law if isinstance(value, laws.FlowStress) else "",
)
def test_value_is_the_published_formula(law, stress):
    assert law(0.4, 3.0, 1150.0) == pytest.approx(stress, rel=1e-13)


def test_the_hyperbolic_sine_is_a_power_law_when_it_is_hot_and_slow_and_a_logarithm_when_it_is_cold_and_fast():
    law = laws.Sinh(**ALUMINIUM)
    assert law(0.0, 1e-8, 600.0) / law(0.0, 1e-9, 600.0) == pytest.approx(10 ** (1 / 5.385), rel=1e-3)
    # one decade of the rate adds ln(10) / (alpha n), whatever the rate
    assert law(0.0, 1e5, 20.0) - law(0.0, 1e4, 20.0) == pytest.approx(math.log(10) / (0.04 * 5.385), rel=1e-3)
    assert law(0.0, 2.0, 450.0) == pytest.approx(
        laws.Sinh(**{**ALUMINIUM, "ln_A": None}, A=math.exp(22.5))(9.0, 2.0, 450.0), rel=1e-13
    )


def test_a_table_with_a_logarithmic_scale_is_exact_for_a_logarithm_of_the_rate():
    rates = [0.01, 1.0, 100.0]
    table = laws.Table(strain=[0, 1], rate=rates, stress=[[100 + 20 * math.log10(r) for r in rates]] * 2,
                       rate_scale="logarithmic")
    rate = np.array([0.01, 0.1, 3.0, 99.0])
    np.testing.assert_allclose(table(0.5, rate), 100 + 20 * np.log10(rate), rtol=1e-12)
    np.testing.assert_allclose(table.rate_derivative(0.5, rate), 20 / math.log(10) / rate, rtol=1e-12)
    assert table(0.5, 1e-9) == pytest.approx(60) and table.rate_derivative(0.5, 1e-9) == 0, "the edge holds"


def test_force_of_the_frictionless_cylinder_follows_from_the_law():
    # REFERENCES.md 1.1: h 20 -> 10, v = 1 mm/s, area 2 * pi * 100 mm^2
    area, strain, rate = 200 * math.pi, math.log(2), 0.1
    assert laws.Power(K=200, n=0.2, m=0.1)(strain, rate) * area == pytest.approx(92763.04, rel=1e-7)
    assert laws.NortonHoff(K=150, m=0.15)(strain, rate) * area == pytest.approx(66722.32, rel=1e-7)
    assert laws.Swift(K=100 * 5**0.3, prestrain=0.2, n=0.3)(strain, rate) * area == pytest.approx(98434.60, rel=1e-7)


@pytest.mark.parametrize("law", LAWS, ids=named)
def test_rate_derivative_is_the_slope_of_the_law(law):
    strain, temperature = np.array([0.0, 0.1, 0.7, 3.0]), 900.0
    for rate in (0.02, 0.5, 1.7, 40.0):
        h = 1e-6 * rate
        slope = (law(strain, rate + h, temperature) - law(strain, rate - h, temperature)) / (2 * h)
        exact = law.rate_derivative(strain, rate, temperature)
        # central difference: round-off eps * sigma / h
        np.testing.assert_allclose(exact, slope, rtol=1e-7, atol=1e-9 * 1e3 / rate)
        assert np.shape(exact) == (4,)
        assert law.depends_on_rate or not np.any(exact)


@pytest.mark.parametrize("law", LAWS, ids=named)
@given(
    strain=st.one_of(st.just(0.0), st.floats(0, 20)),
    rate=st.one_of(st.sampled_from([1e-12, 1e-6]), st.floats(1e-12, 1e6)),
    temperature=st.floats(-100, 1600),
)
def test_flow_stress_is_finite_and_not_negative(law, strain, rate, temperature):
    stress, slope = law(strain, rate, temperature), law.rate_derivative(strain, rate, temperature)
    assert np.isfinite(stress)
    assert stress >= 0
    assert np.isfinite(slope)


@pytest.mark.parametrize("law", LAWS, ids=named)
def test_what_a_law_says_it_depends_on_is_what_changes_it(law):
    here = law(0.3, 2.0, 900.0)
    assert (law(0.6, 2.0, 900.0) != here) == law.depends_on_strain
    assert (law(0.3, 4.0, 900.0) != here) == law.depends_on_rate
    assert (law(0.3, 2.0, 950.0) != here) == law.depends_on_temperature
    if law.depends_on_temperature:
        with pytest.raises(FormingError, match="temperature"):
            law(0.3, 2.0)
    else:
        assert law(0.3, 2.0) == here


@pytest.mark.parametrize("law", LAWS, ids=named)
def test_arrays_give_what_numbers_give(law):
    strain, rate = np.array([[0.0], [0.4]]), np.array([0.1, 1.0, 7.0])
    stress = law(strain, rate, 900.0)
    assert stress.shape == (2, 3)
    assert stress[1, 2] == pytest.approx(law(0.4, 7.0, 900.0), rel=1e-14)
    assert law.shear_yield_stress(0.4, 7.0, 900.0) == pytest.approx(stress[1, 2] / math.sqrt(3))


@pytest.mark.parametrize("law", [law for law in LAWS if law.law != "table"], ids=named)
def test_ufl_gives_what_numpy_gives(law):
    ufl = pytest.importorskip("ufl")
    basix = pytest.importorskip("basix.ufl")
    x = ufl.SpatialCoordinate(ufl.Mesh(basix.element("Lagrange", "triangle", 1, shape=(2,))))
    for strain, rate in ((0.0, 0.5), (0.4, 3.0), (-1e-9, 1e-12)):
        for take in (law, law.rate_derivative):
            form = take(x[0], x[1], 900.0)
            value = form if isinstance(form, float) else float(form((strain, rate)))
            assert value == pytest.approx(float(take(strain, rate, 900.0)), rel=1e-12)


def test_table_says_that_it_cannot_take_ufl():
    ufl = pytest.importorskip("ufl")
    with pytest.raises(FormingError, match="not UFL"):
        LAWS[-1](ufl.as_ufl(0.3), 1.0)


def test_table_reproduces_its_values_and_a_multilinear_function():
    table = laws.Table(**GRID, stress=STRESSES)
    for i, strain in enumerate(GRID["strain"]):
        for j, rate in enumerate(GRID["rate"]):
            for k, temperature in enumerate(GRID["temperature"]):
                assert table(strain, rate, temperature) == STRESSES[i][j][k]
    assert table(0.25, 0.55, 610.0) == pytest.approx(100 + 25 + 5 - 15)
    assert table(99.0, 1e9, -50.0) == STRESSES[2][2][0]
    assert table.rate_derivative(0.0, 1e9, 20.0) == 0


def test_table_from_a_file_equals_the_lists(tmp_path):
    rows = ["temperature [K],stress [GPa],strain,rate [1/s]"]
    for i, strain in enumerate(GRID["strain"]):
        for j, rate in enumerate(GRID["rate"]):
            for k, temperature in enumerate(GRID["temperature"]):
                rows.append(f"{temperature + 273.15},{STRESSES[i][j][k] / 1000},{strain},{rate}")
    file = tmp_path / "steel.csv"
    file.write_text("\n".join(reversed(rows[1:])).join([rows[0] + "\n", "\n"]))
    lists, read = laws.Table(**GRID, stress=STRESSES), laws.Table(file=str(file))
    assert read(0.7, 13.0, 333.0) == pytest.approx(lists(0.7, 13.0, 333.0), rel=1e-12)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("strain,stress\n0,100\n0,200\n", "full grid"),
        ("strain,rate,stress\n0,1,100\n1,2,200\n", "full grid"),
        ("strain,stres\n0,100\n", "did you mean 'stress'"),
        ("strain,stress\n0,x\n", "row 2, column 'stress'"),
        ("strain,stress\n0\n", "1 cells, not 2"),
        ("strain,stress\n0,-5\n", "positive stress"),
        ("strain\n0\n", "no column 'stress'"),
        ("strain,stress\n", "at least one row"),
        ("strain,stress [mm]\n0,1\n", "row 2"),
    ],
)
def test_bad_table_file_is_refused_with_its_place(tmp_path, text, why):
    file = tmp_path / "bad.csv"
    file.write_text(text)
    with pytest.raises(SceneError, match="file: ") as error:
        laws.Table(file=str(file))
    assert why in str(error.value)


class Ramberg(laws.FlowStress):
    law: Literal["ramberg"] = "ramberg"
    initial: Positive(Stress)
    m: float
    depends_on_rate = True

    def __call__(self, strain, rate, temperature=None):
        return self.initial * (1 + power(maximum(rate, 1e-12), self.m))


def test_a_law_of_ones_own_needs_no_more_than_its_formula():
    law = Ramberg(initial="100 MPa", m=0.5)
    assert law(0.0, 4.0) == 300
    assert law.rate_derivative(0.0, 4.0) == pytest.approx(25, rel=1e-6)
    assert not law.depends_on_strain
    with pytest.raises(SceneError, match="did you mean 'initial'"):
        Ramberg(inital=3, m=1)


def test_laws_are_frozen_equal_by_value_and_keyword_only():
    law = laws.Linear(initial="0.7 GPa", hardening=300)
    assert law == laws.Linear(initial=700, hardening="300 MPa") != laws.Ludwik(initial=700, K=300, n=1)
    assert hash(law) == hash(law.replaced()) != hash(law.replaced(initial=1))
    assert repr(law) == "Linear(initial=700 MPa, hardening=300 MPa)"
    with pytest.raises(ValueError, match="frozen"):
        law.initial = 3
    with pytest.raises(TypeError):
        laws.Linear(700, 300)


def test_friction_limits():
    k = 100 / math.sqrt(3)
    pressure = np.array([-10.0, 0.0, 50.0, 1e6])
    assert laws.NoFriction().limit(pressure, 100.0).tolist() == [0, 0, 0, 0]
    np.testing.assert_allclose(laws.Siebel(factor=0.3).limit(pressure, 100.0), 0.3 * k)
    np.testing.assert_allclose(laws.Coulomb(coefficient=0.1).limit(pressure, 100.0), [0, 0, 5, k])
    limits = [0, 0, 0.4 * k * (1 - math.exp(-0.625)), 0.4 * k]
    np.testing.assert_allclose(laws.Levanov(factor=0.4).limit(pressure, 100.0), limits)
    assert np.all(np.isinf(laws.Sticking().limit(pressure, 100.0)))
    assert [f.depends_on_pressure for f in (laws.Siebel(factor=1), laws.Coulomb(coefficient=2))] == [False, True]
    assert laws.Sticking().sticks
    assert not laws.NoFriction().acts


@pytest.mark.parametrize("law", [laws.Siebel(factor=0.3), laws.Coulomb(coefficient=0.1), laws.Levanov(factor=0.4)])
@given(st.floats(0, 1e4), st.floats(1, 1e4))
def test_friction_stress_is_at_most_the_shear_yield_stress(law, pressure, flow_stress):
    assert 0 <= law.limit(pressure, flow_stress) <= flow_stress / math.sqrt(3) * (1 + 1e-12)


SPIN = {"speed": "30 rpm", "centre": [0, 0]}
DRIVES = [
    laws.SpeedDrive(velocity=[0, "-2 mm/s"]),
    laws.SpeedDrive(velocity=[3, 4], rotation=SPIN),
    laws.TableDrive(direction=[0, -2], times=[0, 1, 3, 4], displacement=[0, 2, 2, 1]),
    laws.TableDrive(direction=[0, -1], times=[0, 1, 2, 4], speed=[1, -1, -1, 0]),
    laws.TableDrive(direction=[0, -1], times=[0, 1, 2], speed=[0, 3, 0], rotation=SPIN),
    laws.RotationDrive(speed="40 rpm", centre=[0, 5]),
    laws.RotationDrive(speed="40 rpm", centre=[0, 5, 0], axis=[0, 2, 0]),
]


@pytest.mark.parametrize("drive", DRIVES, ids=lambda d: d.kind)
def test_displacement_and_stroke_are_the_integrals_of_velocity(drive):
    times = np.linspace(0, 5, 20001)
    middles = (times[1:] + times[:-1]) / 2
    velocity = np.array([drive.velocity(t) for t in middles])
    step = times[1] - times[0]
    # midpoint rule, kinks on grid points or (one zero crossing) inside a step: error of order step^2
    np.testing.assert_allclose(drive.displacement(5.0), velocity.sum(axis=0) * step, atol=1e-6)
    assert drive.travel(5.0) == pytest.approx(np.linalg.norm(velocity, axis=1).sum() * step, abs=1e-6)
    assert drive.angle(5.0) == pytest.approx(5 * drive.angular_velocity(2.0))
    assert not np.any(drive.displacement(0.0))


@pytest.mark.parametrize("drive", DRIVES[:5], ids=lambda d: d.kind)
@given(st.floats(1e-6, 0.999), st.floats(0, 0.9))
def test_time_of_travel_is_the_inverse_of_travel(drive, share, start):
    stroke = share * drive.travel(5.0)
    time = drive.time_of_travel(stroke)
    assert drive.travel(time) == pytest.approx(stroke, rel=1e-9)
    assert drive.time_of_travel(stroke, start * time) == pytest.approx(time)
    assert drive.time_of_travel(stroke, time + 1) == time + 1


def test_a_stroke_beyond_the_table_is_never_reached():
    assert math.isinf(DRIVES[2].time_of_travel(3.1))
    assert DRIVES[2].time_of_travel(3.0) == 4.0
    assert math.isinf(DRIVES[5].time_of_travel(1.0))
    assert math.isinf(laws.SpeedDrive(velocity=[0, 0]).time_of_travel(1.0))


def test_drives_tell_their_direction_and_axis():
    assert DRIVES[0].direction.tolist() == [0, -1]
    assert DRIVES[2].direction.tolist() == [0, -1]
    assert DRIVES[5].direction is None
    assert DRIVES[5].moves
    assert not laws.SpeedDrive(velocity=[0, 0]).moves
    assert DRIVES[6].rotation_axis.tolist() == [0, 1, 0]
    assert DRIVES[1].rotation_centre.tolist() == [0, 0]
    assert DRIVES[5].angular_velocity(0) == pytest.approx(4 * math.pi / 3)


def test_drive_table_from_a_file_equals_the_lists(tmp_path):
    file = tmp_path / "press.csv"
    file.write_text("time [ms],displacement [m]\n0,0\n1000,0.002\n3000,0.002\n4000,0.001\n")
    drive = laws.TableDrive(direction=[0, -2], file=str(file))
    for time in (0.3, 1.0, 2.2, 3.7, 9.0):
        np.testing.assert_allclose(drive.displacement(time), DRIVES[2].displacement(time), atol=1e-12)
        np.testing.assert_allclose(drive.velocity(time), DRIVES[2].velocity(time), atol=1e-12)


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: laws.TableDrive(direction=[0, 0], times=[0, 1], speed=[1, 1]), "direction"),
        (lambda: laws.TableDrive(direction=[0, 1], times=[0, 1], speed=[1, 1], displacement=[0, 1]), "displacement"),
        (lambda: laws.TableDrive(direction=[0, 1], times=[0, 1]), "displacement"),
        (lambda: laws.TableDrive(direction=[0, 1], speed=[0, 1]), "times"),
        (lambda: laws.TableDrive(direction=[0, 1], times=[0, 1, 1], speed=[0, 1, 2]), "times"),
        (lambda: laws.TableDrive(direction=[0, 1], times=[1, 2], speed=[0, 1]), "times"),
        (lambda: laws.TableDrive(direction=[0, 1], times=[0, 1], displacement=[1, 2]), "displacement"),
        (lambda: laws.TableDrive(direction=[0, 1], times=[0, 1], speed=[0, 1, 2]), "speed"),
        (lambda: laws.TableDrive(direction=[0, 1], file="nowhere.csv"), "file"),
        (lambda: laws.RotationDrive(speed=1, centre=[0, 0, 0]), "axis"),
        (lambda: laws.RotationDrive(speed=1, centre=[0, 0], axis=[0, 0, 1]), "axis"),
        (lambda: laws.SpeedDrive(velocity=[0, 0, 1], rotation=SPIN), "rotation.centre"),
        (lambda: laws.JohnsonCook(A=1, B=1, n=0.1, m=1), "melting_temperature"),
        (lambda: laws.HenselSpittel(A=1, m3=-0.1), "m3"),
        (lambda: laws.JohnsonCook(A=1, B=1, n=0.1, m=1, melting_temperature=10), "melting_temperature"),
        (lambda: laws.HenselSpittel(A=1, m6=0.1), "m6"),
        (lambda: laws.HenselSpittel(A=1, m3=-0.1), "m3"),
        (lambda: laws.Sinh(**{**ALUMINIUM, "ln_A": None}), "ln_A"),
        (lambda: laws.Sinh(**ALUMINIUM, A=1e9), "ln_A"),
        (lambda: laws.Sinh(**{**ALUMINIUM, "activation_energy": 141.55}), "activation_energy"),
        (lambda: laws.Table(strain=[0, 1], stress=[1, 2], rate_scale="logarithmic"), "rate_scale"),
        (lambda: laws.Table(strain=[0], rate=[0, 1], stress=[[1, 2]], rate_scale="logarithmic"), "rate"),
        (lambda: laws.Hollomon(K=1, n=2), "n"),
        (lambda: laws.Table(strain=[0, 1], stress=[[1, 2]]), "stress"),
        (lambda: laws.Table(strain=[1, 0], stress=[1, 2]), "strain"),
        (lambda: laws.Table(stress=[1, 2]), "strain"),
        (lambda: laws.Table(strain=[0], stress=[1], file="x.csv"), "file"),
    ],
)
def test_a_law_that_cannot_be_meant_is_refused_with_its_key(make, key):
    with pytest.raises(SceneError) as error:
        make()
    assert error.value.key == key
