"""The submarines of the simulation that are not ours."""

from dataclasses import dataclass

from autonomy.site import LAKE, Site
from robot_link.messages import RobotId, SystemId
from simulator.fault import NO_FAULTS, RobotFaults
from simulator.instrument import Instrument, instrument


@dataclass(frozen=True, slots=True)
class SubDefinition:
    """One of them, with the water around it."""

    robot: RobotId
    system_id: SystemId
    site: Site
    start_ne_m: tuple[float, float]
    heading_rad: float
    instruments: tuple[Instrument, ...] = ()
    """What it says by NAMED_VALUE_FLOAT, whose names have at most ten letters."""
    faults: RobotFaults = NO_FAULTS
    """What breaks, which nobody is told."""
    fault_names: tuple[str, ...] = ("leak", "sensor", "battery", "gps")
    """Which of ``CAUSED_FAULTS`` it can have."""

    @property
    def usual_port(self) -> int:
        """UDP port at which it is called where nobody chose another."""
        return 14_600 + self.system_id


SUB_1 = SubDefinition(
    robot=RobotId("sub-1"),
    system_id=SystemId(4),
    site=LAKE,
    start_ne_m=(150.0, 110.0),
    heading_rad=0.6,
    instruments=tuple(instrument(channel, 2.0) for channel in ("salinity", "turbidity", "ph")),
)
"""A submarine of six thrusters in the practice lake, on a tether."""
