"""Drives: how a tool moves by itself. Plain numbers in mm, s and rad; nothing here knows a mesh. One drive a file.

Every drive answers `velocity(t)`, `displacement(t)`, `angular_velocity(t)`, `angle(t)`, `travel(t)` and
`time_of_travel(s, t0)`. The scene starts at t = 0 with displacement 0. A tool without a drive is at rest.
"""

from ..described import one_of
from .crank_press import CrankPressDrive
from .drive import Drive, Spin
from .energy import EnergyDrive
from .force import ForceDrive
from .hammer import HammerDrive
from .hydraulic import HydraulicDrive
from .ratio import Follower, RatioDrive
from .roll import RollDrive
from .rotation import RotationDrive
from .screw_press import ScrewPressDrive
from .speed import SpeedDrive
from .spring import SpringDrive
from .table import TableDrive

DriveLaw = one_of("kind", SpeedDrive, TableDrive, RotationDrive, HydraulicDrive, CrankPressDrive, HammerDrive,
                  ScrewPressDrive, ForceDrive, SpringDrive, RollDrive, RatioDrive, base=Drive)

__all__ = ["CrankPressDrive", "Drive", "DriveLaw", "EnergyDrive", "Follower", "ForceDrive", "HammerDrive",
           "HydraulicDrive", "RatioDrive", "RollDrive", "RotationDrive", "ScrewPressDrive", "SpeedDrive",
           "Spin", "SpringDrive", "TableDrive"]
