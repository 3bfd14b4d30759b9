"""The robots of the simulation: what they are, where they float, and how good they are."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from autonomy.estimation.config import ESTIMATOR_PRESETS, EstimatorConfig, estimator_preset
from autonomy.planner.config import EnergyConfig, PlannerConfig
from autonomy.planner.preset import PLANNER_PRESETS
from autonomy.site import LAKE, TANK, Site
from autonomy.vehicle.battery import BATTERY_PRESETS
from autonomy.vehicle.config import VEHICLES, Vehicle
from onboard.clock import ClockModel
from robot_link.messages import RobotId, SystemId
from robot_link.satellite.config import SatelliteConfig
from robot_link.transport.datagram import Address
from simulator.acoustic_modem import AcousticConditions
from simulator.battery import BatteryModel
from simulator.fault import CAUSED_FAULTS, NO_FAULTS, OXYGEN, RobotFaults
from simulator.flow import Flow
from simulator.instrument import Instrument, instrument
from simulator.sensor import SensorModel
from simulator.sub.definition import SUB_1, SubDefinition
from simulator.tag import LAKE_TAGS, SimulatedTag
from simulator.target import LAKE_TARGETS, TANK_TARGETS, AcousticTarget

STATION_ADDRESS = 1
"""Address of the station's acoustic modem."""
STATION_ACOUSTIC = "acoustic-station"
"""Name, among a robot's devices, of the line at which the station finds that modem."""


@dataclass(frozen=True, slots=True)
class RobotDefinition:
    """One robot of the simulation, with the water around it."""

    robot: RobotId
    system_id: SystemId
    radio_address: Address
    """64-bit address of its radio."""
    station_address: Address
    """64-bit address of the station's radio in its network."""
    link_name: str
    """File name of the station radio's pseudo-terminal in the link folder."""
    vehicle: Vehicle
    site: Site
    start_ne_m: tuple[float, float]
    heading_rad: float
    drift_m_sqrt_s: float
    """How fast the water carries the robot away, m per sqrt(s); the filter assumes the same."""
    current_correlation_s: float
    antenna_depth_m: float
    """Deeper than this no radio passes, unless the site lets it."""
    sensors: SensorModel
    battery: BatteryModel
    instruments: tuple[Instrument, ...] = ()
    """What it measures beside the planned field of its water."""
    current_ne_m_s: tuple[float, float] = (0.0, 0.0)
    """Current that stays, which the robot does not know of."""
    flow: Flow | None = None
    """What else moves its water, by place, depth and time; nobody is told of it."""
    faults: RobotFaults = NO_FAULTS
    """What is wrong with its actuators, which nobody is told."""
    antenna_ne_m: tuple[float, float] = (0.0, 0.0)
    """Where the station's antenna stands."""
    radio_range_m: float = math.inf
    """Farther from that antenna no radio passes."""
    far_ne_m: tuple[float, float] | None = None
    """Where the robot floats at first if it is to begin out of radio range."""
    imei: str = ""
    """Number of its satellite modem; empty without one."""
    satellite: SatelliteConfig = field(default_factory=SatelliteConfig)
    """How it uses that modem, as built; its parameters change it."""
    clock: ClockModel | None = None
    """How wrong its clock is between GPS pulses; None is a robot that is given the time."""
    acoustic_address: int | None = None
    """Address of its acoustic modem; None without one."""
    has_station_acoustics: bool = False
    """Whether the station has an acoustic modem in its water."""
    tag_receiver: int | None = None
    """Serial number of its receiver of acoustic tags; None without one."""
    tags: tuple[SimulatedTag, ...] = ()
    """Tags in its water."""
    has_own_camera: bool = False
    """Whether it carries a camera that sees the visual tags on the walls of its tank."""
    targets: tuple[AcousticTarget, ...] = ()
    """What else answers pings in its water."""
    acoustics: AcousticConditions = field(default_factory=AcousticConditions)
    """How sound goes in its water."""

    surface_depth_m: float | None = None
    """Deeper than this its program takes no fix; None is as delivered for its vehicle."""

    @property
    def fault_names(self) -> tuple[str, ...]:
        """Which of ``CAUSED_FAULTS`` it can have."""
        carried = {self.site.variable, *(one.channel for one in self.instruments)}
        has_optode = not carried.isdisjoint(OXYGEN)
        return tuple(name for name in CAUSED_FAULTS if name != "optode" or has_optode)

    @property
    def estimator(self) -> EstimatorConfig:
        """Settings of its onboard filters."""
        preset = estimator_preset(self.vehicle.key, self.site.kind)
        if self.surface_depth_m is None:
            return preset
        return preset.model_copy(update={"surface_depth_m": self.surface_depth_m})

    @property
    def energy(self) -> EnergyConfig:
        """Prices of its primitives."""
        return PLANNER_PRESETS.get(self.vehicle.key, PlannerConfig()).energy

    def fixed_by_cameras(self, surface_depth_m: float | None) -> "RobotDefinition":
        """Return the robot as it is where cameras see it: no sensor of its own tells its place.

        Args:
            surface_depth_m: Deeper than this it takes no fix; None is as delivered.
        """
        blind = replace(self.sensors, fix_depth_m=-math.inf)
        return replace(self, sensors=blind, surface_depth_m=surface_depth_m)

    def far_away(self) -> "RobotDefinition":
        """Return the robot as it begins out of radio range, where it has such a place."""
        return self if self.far_ne_m is None else replace(self, start_ne_m=self.far_ne_m)

    def is_in_range(self, north_m: float, east_m: float) -> bool:
        """Tell whether a place is near enough to the station's antenna for radio."""
        north, east = self.antenna_ne_m
        return math.hypot(north_m - north, east_m - east) <= self.radio_range_m


MINI_1 = RobotDefinition(
    robot=RobotId("mini-1"),
    system_id=SystemId(1),
    radio_address=Address(0x0013A20041F00001),
    station_address=Address(0x0013A20041F000A1),
    link_name="tank",
    vehicle=VEHICLES["miniglider"],
    site=TANK,
    start_ne_m=(0.5, 0.5),
    heading_rad=0.5,
    drift_m_sqrt_s=ESTIMATOR_PRESETS["miniglider"].drift_m_sqrt_s,
    current_correlation_s=3.0,
    antenna_depth_m=0.1,
    sensors=SensorModel(
        depth_std_m=0.003,
        tilt_std_rad=math.radians(0.5),
        heading_std_rad=math.radians(2.0),
        gyro_std_rad_s=0.005,
        buoyancy_bias_kg=0.0003,
        buoyancy_std_kg=0.00005,
        mass_position_bias_m=0.0005,
        mass_position_std_m=0.0002,
        tail_std_rad=0.005,
        battery_std_v=0.01,
        fix_std_m=0.01,
        fix_depth_m=0.04,
        fix_period_s=0.1,
    ),
    battery=BatteryModel(
        capacity_wh=BATTERY_PRESETS["miniglider"].capacity_wh,
        full_v=10.8,
        empty_v=8.8,
    ),
    instruments=(instrument("temperature", 2.0),),
    acoustic_address=3,
    targets=TANK_TARGETS,
    acoustics=AcousticConditions(travel_time_std_s=2e-4, echo_s=0.004, range_m=20.0),
)
"""Miniglider in the tank; three overhead cameras fix its position at the surface."""

MINI_2 = replace(
    MINI_1,
    robot=RobotId("mini-2"),
    system_id=SystemId(3),
    radio_address=Address(0x0013A20041F00003),
    station_address=Address(0x0013A20041F000A3),
    link_name="tank-2",
    start_ne_m=(2.1, 0.9),
    heading_rad=-2.6,
    acoustic_address=4,
)
"""A second Miniglider in the same tank, for surveys by several robots."""

GRACE_1 = RobotDefinition(
    robot=RobotId("grace-1"),
    system_id=SystemId(2),
    radio_address=Address(0x0013A20041F00002),
    station_address=Address(0x0013A20041F000A2),
    link_name="lake",
    vehicle=VEHICLES["grace3"],
    site=LAKE,
    start_ne_m=(120.0, 120.0),
    heading_rad=0.8,
    drift_m_sqrt_s=ESTIMATOR_PRESETS["grace3"].drift_m_sqrt_s,
    current_correlation_s=20.0,
    antenna_depth_m=0.25,
    sensors=SensorModel(
        depth_std_m=0.01,
        tilt_std_rad=math.radians(0.3),
        heading_std_rad=math.radians(1.5),
        gyro_std_rad_s=0.002,
        buoyancy_bias_kg=0.002,
        buoyancy_std_kg=0.0004,
        mass_position_bias_m=0.001,
        mass_position_std_m=0.0005,
        tail_std_rad=0.005,
        battery_std_v=0.02,
        fix_std_m=1.5,
        fix_depth_m=0.25,
        fix_period_s=1.0,
    ),
    battery=BatteryModel(
        capacity_wh=BATTERY_PRESETS["grace3"].capacity_wh,
        full_v=21.0,
        empty_v=16.0,
    ),
    instruments=tuple(
        instrument(channel, 10.0)
        for channel in ("dissolved_oxygen", "temperature", "par", "blue_green_algae")
    ),
    antenna_ne_m=(60.0, 90.0),
    radio_range_m=150.0,
    far_ne_m=(360.0, 350.0),
    imei="300234000000020",
    satellite=SatelliteConfig(session_period_s=300.0, messages_per_day=1000),
    clock=ClockModel(rate_std_ppm=20.0),
    acoustic_address=2,
    has_station_acoustics=True,
    targets=LAKE_TARGETS,
    tag_receiver=480123,
    tags=LAKE_TAGS,
)
"""GRACE 3 in the practice lake; GPS fixes its position at the surface.

The station's antenna stands on a jetty in the south-west; beyond its range the satellite is left.
"""

_KINDS = {"miniglider": "mini", "grace3": "grace", "sub": "sub"}
"""What robots of a kind are called, with a number behind a dash."""
_FIRST_SYSTEM = {"mini": 20, "grace": 80, "sub": 140}
"""System ids of the robots beyond those that are written out above begin behind these."""
_KIND_MAX = 50
_SEVERAL = re.compile(r"(?P<prefix>mini|grace|sub)-(?P<first>\d{1,3})\.\.(?P<last>\d{1,3})")
_LEAST_FLOOR_M = 0.5


class _Fleet(dict[RobotId, RobotDefinition]):
    """The robots that are written out; others of their kinds are made as they are asked for."""

    def __missing__(self, robot: RobotId) -> RobotDefinition:
        prefix = robot.partition("-")[0]
        like = {"mini": MINI_1, "grace": GRACE_1}.get(prefix)
        if like is None:
            raise KeyError(robot)
        number = _number(robot, prefix)
        system = _FIRST_SYSTEM[prefix] + number
        return replace(
            like,
            robot=robot,
            system_id=SystemId(system),
            radio_address=Address(0x0013A20041F00000 + system),
            station_address=Address(0x0013A20041F10000 + system),
            link_name=f"{like.link_name}-{robot}",
            start_ne_m=_start(like.site, number),
            heading_rad=math.remainder(2.4 * number, 2.0 * math.pi),
            far_ne_m=None,
            radio_range_m=math.inf,
            imei=f"3002340000{system:05d}" if like.imei else "",
            acoustic_address=None,
            has_station_acoustics=False,
            targets=(),
        )


FLEET = _Fleet({definition.robot: definition for definition in (MINI_1, MINI_2, GRACE_1)})
"""Every simulated robot by its name: those that have one of their own, and ``mini-7`` on demand."""

SUBS = {SUB_1.robot: SUB_1}
"""Vehicles that are not ours, by their names."""

USUAL_ROBOTS: tuple[RobotId, ...] = (MINI_1.robot, GRACE_1.robot)
"""Those that are simulated where nobody asks for others."""
DEMO_ROBOTS: tuple[RobotId, ...] = (*USUAL_ROBOTS, SUB_1.robot)
"""Those of a demo: beside ours a vehicle that is not."""


def robots_named(names: Iterable[str]) -> tuple[RobotId, ...]:
    """Return robots by their names, each once; words for several are those of ``expanded``.

    Raises:
        ValueError: If there is no robot of a name, or none is named; the sentence lists all.
    """
    wanted = tuple(map(RobotId, expanded(names)))
    unknown = [name for name in wanted if name not in SUBS and not is_known(name)]
    if unknown or not wanted:
        known = ", ".join((*FLEET, *SUBS))
        kinds = ", ".join(f"{kind}:N" for kind in _KINDS)
        text = f"no robot {', '.join(unknown) or 'named'}; there are {known}, and {kinds}"
        raise ValueError(f"{text} for the first N of a kind, at most {_KIND_MAX}")
    return wanted


def is_sub(robot: str) -> bool:
    """Tell whether a robot is a submarine that speaks standard MAVLink."""
    return robot.startswith("sub-")


def sub_definition(robot: str) -> SubDefinition:
    """Return a submarine; those beyond the first are like it, elsewhere in the lake.

    Raises:
        KeyError: If there is none of this name.
    """
    if robot in SUBS:
        return SUBS[RobotId(robot)]
    number = _number(robot, "sub")
    return replace(
        SUB_1,
        robot=RobotId(robot),
        system_id=SystemId(_FIRST_SYSTEM["sub"] + number),
        start_ne_m=_start(SUB_1.site, _FIRST_SYSTEM["sub"] + number),
    )


def expanded(names: Iterable[str]) -> tuple[str, ...]:
    """Return the robots that the words of a list name, each once, whether there are such or not.

    A word is a name, the first so many of a kind (``miniglider:3``), or several of one prefix
    (``mini-4..9``).
    """
    return tuple(dict.fromkeys(one for name in names for one in _counted(name)))


def fleet_of(count: int) -> tuple[RobotId, ...]:
    """Return so many robots, in equal parts Minigliders in the tank and GRACEs in the lake.

    Raises:
        ValueError: If so many of a kind do not exist.
    """
    if not 1 <= count <= 2 * _KIND_MAX:
        raise ValueError(f"{count} robots; there are 1 to {2 * _KIND_MAX}")
    return robots_named([f"mini-1..{(count + 1) // 2}", f"grace-1..{count // 2}"][: min(count, 2)])


def _counted(name: str) -> Iterable[str]:
    """Return the robots that one word of a list names."""
    kind, colon, count = name.partition(":")
    if colon and kind in _KINDS and count.isdecimal():
        return (f"{_KINDS[kind]}-{number}" for number in range(1, int(count) + 1))
    several = _SEVERAL.fullmatch(name)
    if several is None:
        return (name,)
    first, last = int(several["first"]), int(several["last"])
    return (f"{several['prefix']}-{number}" for number in range(first, last + 1))


def is_known(name: str) -> bool:
    """Tell whether the simulator has a robot of this name."""
    try:
        sub_definition(name) if is_sub(name) else FLEET[RobotId(name)]
    except KeyError:
        return False
    return True


def _number(name: str, prefix: str) -> int:
    """Return the number in a robot's name.

    Raises:
        KeyError: If it is no name of this kind.
    """
    found, dash, number = name.partition("-")
    is_number = dash and number.isdecimal() and number == str(int(number))
    if found != prefix or not is_number or not 1 <= int(number) <= _KIND_MAX:
        raise KeyError(name)
    return int(number)


def _start(site: Site, number: int) -> tuple[float, float]:
    """Return a place inside a water, each number another one, spread evenly."""
    domain, tries = site.domain, 0
    while True:
        at = number + _KIND_MAX * tries
        north = domain.x_min_m + _halton(at, 2) * (domain.x_max_m - domain.x_min_m)
        east = domain.y_min_m + _halton(at, 3) * (domain.y_max_m - domain.y_min_m)
        if site.clearance_m(north, east) > 0.0 and site.floor_m(north, east) > _LEAST_FLOOR_M:
            return round(north, 2), round(east, 2)
        tries += 1


def _halton(index: int, base: int) -> float:
    """Return a number of the sequence that fills 0..1 evenly."""
    value, share = 0.0, 1.0
    while index:
        share /= base
        index, digit = divmod(index, base)
        value += share * digit
    return value


def fault_names_of(robots: Iterable[RobotId]) -> dict[str, tuple[str, ...]]:
    """Return which of ``CAUSED_FAULTS`` each robot can have."""
    return {
        robot: (sub_definition(robot) if is_sub(robot) else FLEET[robot]).fault_names
        for robot in robots
    }
