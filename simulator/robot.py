"""One simulated robot: a body in its water, and the onboard program that moves it."""

from collections.abc import Callable
from datetime import datetime

import numpy as np

from autonomy.frames import wgs84_from_ned
from onboard.flight.hardware import Readings, SetPoints
from onboard.program import PERIOD_S, Radio
from simulator.aboard import program_of
from simulator.battery import Battery
from simulator.conditions import WaterConditions
from simulator.current import DriftingCurrent
from simulator.fault import FaultyActuators
from simulator.fleet import RobotDefinition
from simulator.plant import Plant
from simulator.sensor import Sensors


class SimulatedBody:
    """Plant, sensors and battery behind the hardware interface of the onboard program.

    Args:
        definition: Which robot.
        seed: Starting point of its randomness.
        conditions: Layers and waves of the water; by default mixed and calm.
        water_s: Time of the water when its life begins, s.
    """

    def __init__(
        self,
        definition: RobotDefinition,
        seed: int,
        conditions: WaterConditions | None = None,
        water_s: float = 0.0,
    ) -> None:
        current, sensors = np.random.default_rng([seed, definition.system_id]).spawn(2)
        self.battery = Battery(definition.battery)
        self.sensors = Sensors(definition.sensors, definition.site.variable, sensors)
        """Its instruments, and what their feedback is wrong by."""
        self._set_points = SetPoints(0.0, 0.0)
        self._actuators = FaultyActuators(definition.faults, PERIOD_S)
        self.plant = Plant(
            definition.faults.true(definition.vehicle),
            (conditions or WaterConditions()).surroundings(definition.site),
            DriftingCurrent(
                definition.drift_m_sqrt_s,
                definition.current_correlation_s,
                current,
                definition.current_ne_m_s,
            ),
            definition.start_ne_m,
            definition.heading_rad,
            definition.site,
            definition.flow,
            water_s,
        )
        """The truth, which the onboard program never sees."""
        self._definition = definition

    @property
    def has_sky(self) -> bool:
        """Whether its antennas are out of the water now."""
        return self.plant.position_ned[2] <= self._definition.antenna_depth_m

    @property
    def is_in_reach(self) -> bool:
        """Whether radio passes between the robot and its station now."""
        north, east, _ = self.plant.position_ned
        is_dry = self._definition.site.radio_under_water or self.has_sky
        return is_dry and self._definition.is_in_range(north, east)

    @property
    def place_deg(self) -> tuple[float, float]:
        """Latitude and longitude of where it truly is."""
        site = self._definition.site
        latitude, longitude = wgs84_from_ned(
            self.plant.position_ned[:2], site.origin_latitude_deg, site.origin_longitude_deg
        )
        return float(latitude), float(longitude)

    def read(self) -> Readings:
        """Return the newest readings of all sensors."""
        return self.sensors.read(self.plant.time_s, self.plant.state, self.battery)

    def measure_field(self) -> float:
        """Return one measurement of the field where the robot truly is."""
        return self.sensors.measure_field(self.plant.position_ned)

    def actuate(self, command: SetPoints) -> None:
        """Give the actuators new set points."""
        self._set_points = self.sensors.driven_to(command)

    def advance(self, duration_s: float) -> None:
        """Let time pass."""
        plant = self.plant
        acted_on = self._actuators.reached(self._set_points, plant.state, plant.time_s)
        self.battery.use(plant.advance(acted_on, duration_s))


class SimulatedRobot:
    """A robot that lives as fast as it is stepped; the same seed lives the same life.

    Args:
        definition: Which robot.
        seed: Starting point of its randomness.
        started_at: Its clock at the beginning.
        conditions: Layers and waves of the water; by default mixed and calm.
        stamp: Tells the time by its own clock; by default the steps are counted.
        water_s: Time of the water when its life begins, s.
    """

    def __init__(
        self,
        definition: RobotDefinition,
        seed: int,
        started_at: datetime,
        conditions: WaterConditions | None = None,
        stamp: Callable[[], datetime] | None = None,
        water_s: float = 0.0,
    ) -> None:
        self.definition = definition
        self.body = SimulatedBody(definition, seed, conditions, water_s)
        self.program = program_of(definition, self.body, started_at, stamp)

    @property
    def is_in_reach(self) -> bool:
        """Whether radio passes between the robot and its station now."""
        return self.body.is_in_reach

    def step(self, radio: Radio) -> None:
        """Let one period of the onboard program pass."""
        self.body.advance(PERIOD_S)
        self.program.step(radio)
