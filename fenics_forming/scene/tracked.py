"""Material points and lines that are followed through the run."""


from pydantic import Field, model_validator

from ..laws.described import Described, at_key
from ..units import CountFrom, Length, Vector


class TrackedPoint(Described):
    """A material point whose place and state go into the history.

    Parameters
    ----------
    body : name of a workpiece; of tools that deform, name of the tool or part. at : its place at the start, mm.
    """

    body: str = Field(description="the name of a workpiece")
    at: Vector(Length)


class FlowLine(Described):
    """A straight line of material points at the start, followed through the run.

    Parameters
    ----------
    body : name of a workpiece. from_ (key `from`), to : its ends, mm. points : their number, ends included.
    """

    body: str = Field(description="the name of a workpiece")
    from_: Vector(Length) = Field(alias="from")
    to: Vector(Length)
    points: CountFrom(2) = 100

    @model_validator(mode="after")
    def _has_a_length(self):
        if len(self.from_) != len(self.to):
            raise at_key("to", f"has {len(self.to)} components, 'from' has {len(self.from_)}", self.to)
        if self.from_ == self.to:
            raise at_key("to", "is the same point as 'from'; the line has no length", self.to)
        return self
