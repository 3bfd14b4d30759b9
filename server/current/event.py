"""What the map of a current tells the other capabilities."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CurrentChanged:
    """What is known of the current of a robot's water changed."""

    robot: str
