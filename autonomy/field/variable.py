"""The quantities that a robot can map, each declared once."""

from dataclasses import dataclass
from typing import Literal

Scale = Literal["linear", "log"]
"""Whether a Gaussian process sees a value or its natural logarithm."""


@dataclass(frozen=True, slots=True)
class Variable:
    """One scalar field that a sensor measures."""

    key: str
    title: str
    unit: str
    scale: Scale
    """How a Gaussian process sees the value where the map's settings do not say otherwise."""
    wire_index: int
    """Number of the variable in a ``GRACE_SAMPLE`` message."""


VARIABLES: dict[str, Variable] = {
    variable.key: variable
    for variable in (
        Variable("blue_light", "Blue light", "counts", "log", 1),
        Variable("chlorophyll", "Chlorophyll", "ug/L", "linear", 2),
        Variable("temperature", "Temperature", "degC", "linear", 3),
    )
}
"""Every known variable by its key."""
