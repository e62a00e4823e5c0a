"""Formulas and their parameters: flow stress, friction, equipment. No mesh, no MPI; units of `units.py`."""

from .damage import CockcroftLatham, Damage, DamageLaw
from .described import Described, one_of
from .elasticity import Elasticity
from .equipment import (
    CrankPressDrive,
    Drive,
    DriveLaw,
    EnergyDrive,
    Follower,
    HammerDrive,
    HydraulicDrive,
    RatioDrive,
    RotationDrive,
    ScrewPressDrive,
    SpeedDrive,
    Spin,
    TableDrive,
)
from .flow_stress import (
    RATE_FLOOR,
    SHEAR,
    STRAIN_FLOOR,
    Constant,
    FlowStress,
    Hollomon,
    Linear,
    Ludwik,
    NortonHoff,
    Power,
    Swift,
    Voce,
)
from .flow_stress_hot import HenselSpittel, JohnsonCook
from .flow_stress_table import Table
from .friction import Coulomb, Friction, FrictionLaw, Levanov, NoFriction, Siebel, Sticking

FlowStressLaw = one_of(
    "law",
    Constant,
    Linear,
    Ludwik,
    Hollomon,
    Swift,
    Voce,
    NortonHoff,
    Power,
    JohnsonCook,
    HenselSpittel,
    Table,
    base=FlowStress,
)
"""Annotation of a field that holds any flow-stress law, also one that a user derived from `FlowStress`."""

__all__ = [
    "RATE_FLOOR",
    "SHEAR",
    "STRAIN_FLOOR",
    "CockcroftLatham",
    "Constant",
    "Coulomb",
    "CrankPressDrive",
    "Damage",
    "DamageLaw",
    "Described",
    "Drive",
    "DriveLaw",
    "Elasticity",
    "EnergyDrive",
    "FlowStress",
    "FlowStressLaw",
    "Follower",
    "Friction",
    "FrictionLaw",
    "HammerDrive",
    "HenselSpittel",
    "Hollomon",
    "HydraulicDrive",
    "JohnsonCook",
    "Levanov",
    "Linear",
    "Ludwik",
    "NoFriction",
    "NortonHoff",
    "Power",
    "RatioDrive",
    "RotationDrive",
    "ScrewPressDrive",
    "Siebel",
    "SpeedDrive",
    "Spin",
    "Sticking",
    "Swift",
    "Table",
    "TableDrive",
    "Voce",
]
