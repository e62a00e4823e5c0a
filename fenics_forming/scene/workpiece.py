"""A body that is formed, as the scene describes it."""

from pydantic import Field

from ..laws.described import Described
from ..laws.heat_exchange import Air
from ..units import Length, Positive, Temperature
from .initial_velocity import InitialVelocity
from .meshes import Refine, RemeshField
from .names import Axes
from .shapes import BodyShape


class Workpiece(Described):
    """A body that is formed.

    Parameters
    ----------
    shape : a body shape. material : name of a material. symmetry : axes; the body's low face on each is a mirror plane,
    a round body is cut in half through its centre.
    mesh_size : mm, chosen from the shape if not given. remesh : true or a table with the keys of `Remesh`; the mesh is
    never renewed if not given. refine : list of domains with finer elements, for the first mesh and every later one.
    temperature : degC, at the start; it stays where nothing asks for temperatures to be computed. air : what the free
    surface gives heat to. initial_velocity : mm/s, its components, or a table with the
    `kind` "uniform", "homogeneous" or "rotation"; at rest if not given.
    """

    shape: BodyShape = Field(description="a shape such as { kind = 'rectangle', from = [0, 0], to = [10, 15] }")
    material: str = Field(description="the name of a material")
    symmetry: Axes = ()
    mesh_size: Positive(Length) | None = None
    temperature: Temperature | None = None
    air: Air | None = None
    remesh: RemeshField = None
    refine: Refine = ()
    initial_velocity: InitialVelocity | None = None
