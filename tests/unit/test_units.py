"""Quantities at the border: what a user may write becomes mm, s, t, N, MPa, mJ, degC, rad, or a clear refusal."""

import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from fenics_forming import units
from fenics_forming.units import format_quantity


def read(quantity, value):
    return TypeAdapter(quantity).validate_python(value)


@pytest.mark.parametrize(
    ("quantity", "text", "inside"),
    [
        (units.Length, "1 in", 25.4),
        (units.Length, "-2.5e-1 cm", -2.5),
        (units.Stress, "210 GPa", 210e3),
        (units.Stress, "3 N/mm^2", 3.0),
        (units.Density, "7833 kg/m^3", 7.833e-9),
        (units.Density, "7.8 g/cm**3", 7.8e-9),
        (units.AngularSpeed, "40 rpm", 40 * math.tau / 60),
        (units.Angle, "30 deg", math.pi / 6),
        (units.Speed, "-1 m/s", -1000.0),
        (units.Force, "30 kN", 30e3),
        (units.Energy, "400 J", 400e3),
        (units.Mass, "100 kg", 0.1),
        (units.Time, "2 min", 120.0),
        (units.Temperature, "1150 degC", 1150.0),
        (units.Temperature, "273.15 K", 0.0),
        (units.Temperature, "212 degF", 100.0),
        (units.Conductivity, "28 W/m/K", 28.0),
        (units.SpecificHeat, "650 J/kg/K", 650e6),
        (units.HeatTransferCoefficient, "10000 W/m^2/K", 10.0),
        (units.HeatTransferCoefficient, "10 kW/(m² K)", 10.0),
        (units.Rate, "3 1/s", 3.0),
        (units.Expansion, "1.2e-5 1/K", 1.2e-5),
        (units.Number, "15 %", 0.15),
        (units.ForceOrLineForce, "3 kN/mm", 3000.0),
    ],
)
def test_text_with_a_unit_is_converted(quantity, text, inside):
    assert read(quantity, text) == pytest.approx(inside, rel=1e-14, abs=1e-10)


def test_conversion_leaves_no_round_off_from_the_factors():
    assert read(units.Density, "7833 kg/m^3") == 7.833e-9


@given(st.floats(-1e9, 1e9))
def test_a_bare_number_is_taken_in_internal_units(number):
    assert read(units.Length, number) == number
    assert read(units.Length, np.float64(number)) == number


@given(st.text(max_size=12))
def test_any_text_is_a_quantity_or_a_refusal_never_a_crash(text):
    try:
        assert math.isfinite(read(units.Length, text))
    except ValidationError as error:
        assert "a length such as '1 mm'" in str(error)


@pytest.mark.parametrize(
    ("quantity", "value", "why"),
    [
        (units.Length, "1 kN", "wrong dimension"),
        (units.Length, "1 mmm", "unknown unit 'mmm'"),
        (units.Length, "1", "no unit"),
        (units.Length, "", "cannot be read"),
        (units.Length, "wide", "cannot be read"),
        (units.Length, True, "true"),
        (units.Length, None, "None"),
        (units.Length, [1], "[1]"),
        (units.Length, math.nan, "not finite"),
        (units.Length, "nan mm", "not finite"),
        (units.Length, "-inf mm", "not finite"),
        (units.Length, "1e400 mm", "not finite"),
        (units.Length, 10**400, "not finite"),
        (units.Length, 1e200, "beyond every sensible size"),
        (units.Positive(units.Length), "1e-200 mm", "beyond every sensible size"),
        (units.Length, "1 mm**(9**9**9)", "unknown unit"),
        (units.Length, "1 __import__('os')", "unknown unit"),
        (units.AngularSpeed, "40 Hz", "wrong dimension"),
        (units.Rate, "40 rpm", "wrong dimension"),
        (units.Number, "30 deg", "wrong dimension"),
        (units.Temperature, "-300 degC", "out of range"),
        (units.Temperature, "5 mm", "wrong dimension"),
        (units.Positive(units.Length), 0, "not positive"),
        (units.Positive(units.Length), "-1 mm", "a positive length"),
        (units.NonNegative(units.Stress), -1, "negative"),
        (units.Within(units.Number, 0, 1), 1.5, "from 0 to 1"),
        (units.Vector(units.Length), [1], "1 component"),
        (units.Vector(units.Length), [1, 2, 3, 4], "4 components"),
        (units.Vector(units.Length, 3), [1, 2], "three components"),
        (units.Vector(units.Length), "1 mm", "not a list"),
        (units.Vector(units.Length), [1, "2 kN"], "'2 kN' has the wrong dimension"),
        (units.List(units.Time), [], "too short"),
        (units.Count, -1, "a whole number"),
        (units.Count, 1.5, "a whole number"),
        (units.Count, True, "a whole number"),
        (units.Flag, "yes", "true or false"),
    ],
)
def test_a_refusal_says_what_it_got_and_what_it_wants(quantity, value, why):
    with pytest.raises(ValidationError) as refusal:
        read(quantity, value)
    message = refusal.value.errors()[0]["msg"]
    assert why in message
    assert "expected" in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(1.5, "mm", "1.5 mm"), ((0.0, -1.0), "mm/s", "(0, -1) mm/s"), (0.3, "", "0.3"), (-0.0, "N", "0 N")],
)
def test_format(value, unit, text):
    assert format_quantity(value, unit) == text


def test_pint_is_imported_only_for_text():
    script = (
        "import sys; from fenics_forming import units; from pydantic import TypeAdapter as T;"
        "T(units.Length).validate_python(1.0); assert 'pint' not in sys.modules;"
        "T(units.Length).validate_python('1 mm'); assert 'pint' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


def test_shelf_imports_nothing_heavy():
    heavy = ("dolfinx", "ufl", "gmsh", "petsc4py", "numba", "scipy", "pint")
    script = f"import sys, fenics_forming.scene; bad = [m for m in {heavy} if m in sys.modules]; assert not bad, bad"
    subprocess.run([sys.executable, "-c", script], check=True)
