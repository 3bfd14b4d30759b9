"""One simulated robot: a body in its water, and the onboard program that moves it."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime

import numpy as np

from autonomy.frames import TrueNorth, wgs84_from_ned
from onboard.flight.hardware import Readings, SetPoints
from onboard.program import PERIOD_S, Radio
from simulator.aboard import program_of
from simulator.battery import Battery
from simulator.conditions import WaterConditions
from simulator.current import DriftingCurrent
from simulator.fault import (
    CAUSED_FAULTS,
    DEPTH_OFF_M,
    FLAT_FRACTION,
    OXYGEN,
    FaultKind,
    FaultyActuators,
    RobotFaults,
    begin_of,
    caused_at,
    drifted_share,
)
from simulator.fleet import RobotDefinition
from simulator.housekeeping import Housekeeping
from simulator.instrument import Instruments, instrument
from simulator.plant import Plant
from simulator.sensor import Sensors
from simulator.water_field import PLANNED, WaterField


class SimulatedBody:
    """Plant, sensors and battery behind the hardware interface of the onboard program.

    Args:
        definition: Which robot.
        seed: Starting point of its randomness.
        conditions: Layers and waves of the water; by default mixed and calm.
        water_s: Time of the water when its life begins, s.
        randomness: Generators of its eddies, its sensors and its instruments, in place of the
            seed's.
    """

    def __init__(
        self,
        definition: RobotDefinition,
        seed: int,
        conditions: WaterConditions | None = None,
        water_s: float = 0.0,
        randomness: Sequence[np.random.Generator] | None = None,
    ) -> None:
        generator = np.random.default_rng([seed, definition.system_id])
        current, sensors, instruments = randomness or generator.spawn(3)
        self.battery = Battery(definition.battery)
        north = TrueNorth(definition.site.origin_latitude_deg)
        self.sensors = Sensors(definition.sensors, definition.site.variable, sensors, north)
        """What it steers by, and what its feedback is wrong by."""
        self._instruments = Instruments(
            definition.instruments, WaterField(definition.site), instruments
        )
        self._planned = Instruments(
            [instrument(definition.site.variable, 0.0)],
            WaterField(definition.site),
            instruments,
        )
        self._set_points = SetPoints(0.0, 0.0)
        self._actuators = FaultyActuators(definition.faults, PERIOD_S)
        self._housekeeping = Housekeeping(definition.vehicle, WaterField(definition.site))
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
    def faults(self) -> RobotFaults:
        """What is wrong with it, and from when of its life on."""
        return self._actuators.faults

    @property
    def fault_kinds(self) -> Mapping[str, FaultKind]:
        """Which of ``CAUSED_FAULTS`` it can have."""
        return {name: CAUSED_FAULTS[name] for name in self._definition.fault_names}

    def begin_s(self, name: str) -> float:
        """Return when a fault comes, of its life; infinity if it does not."""
        return begin_of(self.faults, name)

    @property
    def lived_s(self) -> float:
        """Seconds that it has lived."""
        return self.plant.time_s

    @property
    def is_in_reach_of_hands(self) -> bool:
        """Whether it lies at the surface."""
        return self.has_sky

    def cause(self, name: str) -> None:
        """Let a fault come now."""
        self._actuators.faults = caused_at(self.faults, name, self.plant.time_s)

    def mend(self, name: str) -> None:
        """Undo a fault; a battery that went flat is changed for a full one."""
        if name == "battery" and self.plant.time_s >= self.faults.battery_flat_s:
            self.battery.fraction = 1.0
        self._actuators.faults = caused_at(self.faults, name, math.inf)

    @property
    def has_sky(self) -> bool:
        """Whether its antennas are out of the water now."""
        return self.plant.position_ned[2] <= self._definition.antenna_depth_m

    @property
    def has_gps(self) -> bool:
        """Whether its receiver hears GPS now."""
        return self.has_sky and self.plant.time_s < self.faults.gps_lost_s

    @property
    def has_antennas(self) -> bool:
        """Whether what it sends leaves it, if it is not under water."""
        return self.plant.time_s < self.faults.antenna_lost_s

    @property
    def has_satellite(self) -> bool:
        """Whether its modem can call now."""
        return self.has_sky and self.has_antennas

    @property
    def is_in_reach(self) -> bool:
        """Whether radio passes between the robot and its station now."""
        north, east, _ = self.plant.position_ned
        is_dry = self._definition.site.radio_under_water or self.has_sky
        return is_dry and self.has_antennas and self._definition.is_in_range(north, east)

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
        readings = self.sensors.read(self.plant.time_s, self.plant.state, self.battery)
        if self.plant.time_s >= self.faults.depth_off_s:
            readings = replace(readings, depth_m=readings.depth_m + DEPTH_OFF_M)
        is_lost = self.plant.time_s >= self.faults.gps_lost_s
        return replace(readings, fix_ne_m=None) if is_lost else readings

    def measure_field(self) -> float | None:
        """Return one measurement of the field where the robot truly is, None of a dead sensor."""
        if self.plant.time_s >= self.faults.sensor_dies_s:
            return None
        variable, here = self._definition.site.variable, self.plant.position_ned
        if variable in PLANNED:
            return self.sensors.measure_field(here)
        return self._drifted(self._planned.measure([variable], here))[variable]

    @property
    def instruments(self) -> Mapping[str, float]:
        """How often each further instrument wants to be asked, s, by its channel."""
        return self._instruments.periods_s

    def measure(self, channels: Iterable[str]) -> Mapping[str, float]:
        """Return a measurement by each of these instruments where the robot truly is."""
        return self._drifted(self._instruments.measure(channels, self.plant.position_ned))

    def condition(self) -> dict[str, float]:
        """Return readings of the robot itself by the keys of their channels."""
        return self._housekeeping.read(
            self.plant.time_s,
            self.plant.position_ned,
            self.battery.voltage_v,
            self.plant.time_s - self.faults.leak_s,
            None if self._definition.site.kind == "tank" else self.has_gps,
        )

    def _drifted(self, measured: dict[str, float]) -> dict[str, float]:
        """Return measurements as an optode that drifts makes them."""
        share = drifted_share(self.plant.time_s - self.faults.optode_drifts_s)
        return {key: share * value if key in OXYGEN else value for key, value in measured.items()}

    def actuate(self, command: SetPoints) -> None:
        """Give the actuators new set points."""
        self._set_points = self.sensors.driven_to(command)

    def advance(self, duration_s: float) -> None:
        """Let time pass."""
        plant = self.plant
        acted_on = self._actuators.reached(self._set_points, plant.state, plant.time_s)
        before = plant.state
        used_j = plant.advance(acted_on, duration_s)
        self._housekeeping.advance(before, plant.state, used_j, duration_s)
        self.battery.use(used_j)
        if plant.time_s >= self.faults.battery_flat_s:
            self.battery.fraction = min(self.battery.fraction, FLAT_FRACTION)


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
