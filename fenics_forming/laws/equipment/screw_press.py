"""A screw press: the flywheel and the ram that it drives."""

from typing import Literal

from ...units import Positive, Speed
from .energy import EnergyDrive


class ScrewPressDrive(EnergyDrive):
    r"""A ram that is tied to a flywheel by its screw: it slows down as the flywheel gives its energy away.

    The speed is :math:`w_0\sqrt{E_{left}/E}`: all that turns and moves together stands for the mass :math:`2E/w_0^2`.

    Parameters
    ----------
    energy : of flywheel and ram at the start of a stroke, mJ or "200 J"; a list for several. speed : of the ram with the
    largest of them, mm/s. direction : any length. efficiency : share of the energy that forms and stretches the frame; the
    rest is lost in screw and guides. blows : number of strokes. pause : between them, s. lift : of the ram above the body
    in a pause, mm. rotation : optional `Spin`. In plane strain energies are those of one mm of width.

    References
    ----------
    REFERENCES.md 11.
    """

    kind: Literal["screw_press"] = "screw_press"
    speed: Positive(Speed)

    @property
    def moving_mass(self):
        return 2 * max(self.energies) / self.speed**2
