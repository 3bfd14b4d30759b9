"""What the onboard program may know and do: readings of its sensors, commands to its actuators.

Both are the messages of the robot's hardware nodes (thesis section 2.1.2). The simulated robot
implements ``Hardware``; a program that talks to real nodes would implement it over their sockets.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Readings:
    """What all sensors say at one moment; noisy, and never the truth."""

    depth_m: float
    """From pressure; may be slightly negative at the surface."""
    roll_rad: float
    pitch_rad: float
    heading_rad: float
    """From true north; in the site's frame it differs by ``autonomy.frames.convergence_rad``."""
    gyro_rad_s: tuple[float, float, float]
    """Body rates about the forward, starboard and down axes."""
    net_buoyancy_kg: float
    """Feedback of the buoyancy actuator; positive sinks."""
    mass_position_m: float
    tail_rad: float
    battery_fraction: float
    battery_v: float
    fix_ne_m: tuple[float, float] | None
    """Horizontal position from outside (GPS, cameras) in the site frame; None under water and
    between two fixes."""


@dataclass(frozen=True, slots=True)
class SetPoints:
    """What the actuators shall do; end stops and rates are their own."""

    net_buoyancy_kg: float
    mass_position_m: float
    tail_rad: float = 0.0
    """Mean tail angle; positive turns to port."""
    tail_amplitude_rad: float = 0.0
    """Amplitude of the flapping about the mean; 0 is a rudder."""
    tail_frequency_hz: float = 0.0


class Hardware(Protocol):
    """The robot's body as the onboard program sees it."""

    def read(self) -> Readings:
        """Return the newest readings of all sensors."""
        ...

    def measure_field(self) -> float | None:
        """Return one measurement of the field that is being mapped, in the variable's unit.

        None where its instrument does not answer.
        """
        ...

    @property
    def instruments(self) -> Mapping[str, float]:
        """How often each instrument beside that field's wants to be asked, s, by its channel."""
        ...

    def measure(self, channels: Iterable[str]) -> Mapping[str, float]:
        """Return a measurement of each of these channels; those that do not answer are left out."""
        ...

    def condition(self) -> Mapping[str, float]:
        """Return readings of the robot's own condition by the keys of their channels."""
        ...

    def actuate(self, command: SetPoints) -> None:
        """Give the actuators new set points, which hold until the next ones."""
        ...
