"""Settings of the simulator's process; a settings file holds them as one JSON object."""

from pathlib import Path
from typing import Self

from pydantic import AwareDatetime, Field, field_validator, model_validator

from autonomy.configuration import Configuration
from autonomy.vehicle.water import Wave
from robot_link.clock import ScaledClock
from robot_link.messages import RobotId
from simulator.conditions import WaterConditions
from simulator.fleet import FLEET, USUAL_ROBOTS, robots_named
from simulator.xbee_network import AirConditions


class SimulatorSettings(Configuration):
    """Where the emulated radios appear, whose clock the robots live by, how bad the links are."""

    link_folder: Path
    """Folder in which each network's station radio appears as a pseudo-terminal (``tank``,
    ``lake``)."""
    wall_anchor: AwareDatetime
    """Wall time at which the robots' clock shows ``time_anchor``."""
    time_anchor: AwareDatetime
    """Time that the robots' clock shows at ``wall_anchor``."""
    speed: float = Field(default=1.0, ge=0.1, le=50.0)
    """Seconds of the robots per second of the wall."""
    robots: tuple[RobotId, ...] = USUAL_ROBOTS
    """Which robots live."""
    seed: int = Field(default=0, ge=0)
    """Starting point of all randomness: currents, sensors, links."""
    parent_pid: int | None = Field(default=None, gt=0)
    """The simulator ends when the process with this id does."""
    loss: float = Field(default=0.02, ge=0.0, lt=1.0)
    """Part of the radio frames that are lost."""
    delay_s: float = Field(default=0.02, ge=0.0, le=10.0)
    """Mean delay of a radio frame, wall seconds."""
    duplication: float = Field(default=0.01, ge=0.0, lt=1.0)
    """Part of the radio frames that arrive twice."""
    temperature_drop_c: float = Field(default=0.0, ge=0.0, le=20.0)
    """How much colder, and so denser, a lake is below its thermocline; 0 is mixed water."""
    wave_height_m: float = Field(default=0.0, ge=0.0, le=2.0)
    """Height of the waves on a lake, from trough to crest; 0 is calm."""
    wave_period_s: float = Field(default=2.0, gt=0.0, le=10.0)
    """Period of the waves."""

    @field_validator("robots")
    @classmethod
    def _robots_exist(cls, robots: tuple[RobotId, ...]) -> tuple[RobotId, ...]:
        return robots_named(robots)

    @model_validator(mode="after")
    def _waves_do_not_break(self) -> Self:
        Wave(self.wave_height_m, self.wave_period_s)
        return self

    def clock(self) -> ScaledClock:
        """Return the clock that station and robots share."""
        return ScaledClock(self.wall_anchor, self.time_anchor, self.speed)

    def air(self) -> AirConditions:
        """Return how the emulated radios treat a frame."""
        return AirConditions(
            loss=self.loss,
            duplication=self.duplication,
            delay_s=0.5 * self.delay_s,
            jitter_s=self.delay_s,
        )

    def conditions(self) -> WaterConditions:
        """Return what the open water is like."""
        return WaterConditions(
            temperature_drop_c=self.temperature_drop_c,
            wave_height_m=self.wave_height_m,
            wave_period_s=self.wave_period_s,
        )

    def link_path(self, robot: RobotId) -> Path:
        """Return the path of the station radio's pseudo-terminal in a robot's network."""
        return self.link_folder / FLEET[robot].link_name
