"""The quantities that a robot can map, each declared once."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Variable:
    """One scalar field that a sensor measures."""

    key: str
    title: str
    unit: str
    scale: Literal["linear", "log"]
    """Whether the Gaussian process sees the value or its natural logarithm."""
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
