"""Settings of the simulator's process; a settings file holds them as one JSON object."""

from dataclasses import replace
from pathlib import Path
from typing import Self

from pydantic import AwareDatetime, Field, field_validator, model_validator

from autonomy.configuration import Configuration
from autonomy.site import TANK
from autonomy.vehicle.water import Wave
from robot_link.clock import ScaledClock
from robot_link.messages import RobotId
from simulator.acoustic_modem import AcousticConditions
from simulator.conditions import WaterConditions
from simulator.fault import CausedFault, RobotFaults
from simulator.fleet import (
    FLEET,
    USUAL_ROBOTS,
    RobotDefinition,
    fault_names_of,
    robots_named,
    sub_definition,
)
from simulator.flow import read_flow
from simulator.instrument import CTD
from simulator.iridium.conditions import SatelliteConditions
from simulator.sub.definition import SubDefinition
from simulator.xbee_network import AirConditions

PORT_SUFFIX = ".udp"
"""Of the file below the link folder that holds the UDP port of a vehicle that is not ours."""


class GatewaySettings(Configuration):
    """The emulated RockBLOCK gateway: where it is, who its customer is, and how it signs."""

    port: int = Field(ge=1, le=65535)
    """Loopback port at which it takes messages to robots."""
    push_url: str
    """Where it pushes the messages of robots."""
    username: str
    """Name of the customer's account."""
    password: str = Field(repr=False)
    """Password of the customer's account."""
    private_key_pem: str = Field(repr=False)
    """The key with which it signs what it pushes."""


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
    memory_folder: Path | None = None
    """Folder with a folder for each robot: what it remembers while it is switched off, its key
    and its logs. Without one robots forget, and have no satellite link."""
    is_far: bool = False
    """Robots that can begin out of radio range do."""
    fixed_by_cameras: tuple[RobotId, ...] = ()
    """Robots that cameras see: no sensor of theirs tells them where they are. Below emulated
    cameras all robots of the tank are."""
    surface_depth_m: float | None = Field(default=None, ge=0.01, le=2.0)
    """Deeper than this those robots take no fix at first, until their parameter FIX_DEPTH_M is
    changed; as delivered without."""
    has_ctd: bool = False
    """GRACE robots carry a CTD: salinity, conductivity and pressure beside their instruments."""
    has_own_cameras: bool = False
    """Robots of the tank carry a camera of their own, find themselves by the visual tags on its
    walls, and are told of their place by nobody else."""
    has_programs: bool = True
    """Whether the robots' onboard programs run here. Without them the robots' nodes and radios
    wait for programs of their own."""
    gateway: GatewaySettings | None = None
    """The satellite gateway; without one messages of robots lead nowhere."""
    satellite_memory: Path | None = None
    """File in which the satellite network keeps its queues while the simulator does not run."""
    satellite_loss: float = Field(default=0.05, ge=0.0, lt=1.0)
    """Part of the satellite messages that are lost on the way to a robot, and from it."""
    satellite_duplication: float = Field(default=0.02, ge=0.0, lt=1.0)
    """Part of the satellite messages that come twice."""
    satellite_session_s: float = Field(default=12.0, gt=0.0, le=120.0)
    """Length of a satellite session, by the robots' clock."""
    acoustic_loss: float = Field(default=0.0, ge=0.0, lt=1.0)
    """Part of the sounds under water that are not heard; a ping and its answer are two."""
    acoustic_garbling: float = Field(default=0.0, ge=0.0, lt=1.0)
    """Part of the sounds that are heard and not understood."""
    acoustic_outliers: float = Field(default=0.0, ge=0.0, lt=1.0)
    """Part of the ranges that are those of an echo."""
    processes: int | None = Field(default=None, ge=1, le=64)
    """In how many processes the robots live; by default a few live in one, and more in as many as
    there are cores (``simulator.shard``)."""
    has_modems_elsewhere: bool = False
    """Whether the robots' satellite modems, and the network, belong to another process."""
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
    faults: tuple[str, ...] = ()
    """What breaks, each as ``[ROBOT:]NAME@SECONDS`` (``simulator.fault``)."""
    desk_port: int | None = Field(default=None, ge=1, le=65535)
    """Loopback port at which faults are caused while robots live (``simulator.fault_desk``); by
    default a free one, which nobody is told."""
    cameras: int = Field(default=0, ge=0, le=3)
    """How many emulated cameras hang over the tank (``simulator.camera``)."""
    camera_port: int | None = Field(default=None, ge=1, le=65535)
    """Loopback port at which they send their pictures; by default a free one, which the
    log tells."""
    current: str = ""
    """Flow of the water (``simulator.flow.GRAMMAR``); empty for none. Robots and station are not
    told."""

    @field_validator("robots")
    @classmethod
    def _robots_exist(cls, robots: tuple[RobotId, ...]) -> tuple[RobotId, ...]:
        return robots_named(robots)

    @model_validator(mode="after")
    def _seen_robots_live(self) -> Self:
        if strangers := set(self.fixed_by_cameras) - set(self.robots):
            raise ValueError(f"fixed_by_cameras names robots that do not live: {sorted(strangers)}")
        return self

    @field_validator("current")
    @classmethod
    def _flow_can_be_read(cls, current: str) -> str:
        if current:
            read_flow(current, TANK)
        return current

    @model_validator(mode="after")
    def _faults_meet_a_robot(self) -> Self:
        names = fault_names_of(self.robots)
        for fault in map(CausedFault.of, self.faults):
            if refusal := fault.refusal(names):
                raise ValueError(refusal)
        return self

    @model_validator(mode="after")
    def _cameras_are_written_down(self) -> Self:
        if self.has_own_cameras and self.memory_folder is None:
            raise ValueError("robots keep what they know of their own cameras in memory_folder")
        return self

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

    def satellite(self) -> SatelliteConditions:
        """Return how bad the satellite service is."""
        return SatelliteConditions(
            loss=self.satellite_loss,
            mobile_originated_loss=self.satellite_loss,
            duplication=self.satellite_duplication,
            reordering=self.satellite_duplication,
            session_s=self.satellite_session_s,
        )

    def acoustics(self, definition: RobotDefinition) -> AcousticConditions:
        """Return how sound goes in a robot's water."""
        return replace(
            definition.acoustics,
            loss=self.acoustic_loss,
            garbling=self.acoustic_garbling,
            outliers=self.acoustic_outliers,
        )

    def definition(self, robot: RobotId) -> RobotDefinition:
        """Return a robot as it begins."""
        definition = FLEET[robot]
        if self.current:
            definition = replace(definition, flow=read_flow(self.current, definition.site))
        definition = replace(definition, faults=self._caused(robot, definition.faults))
        if self.has_ctd and definition.vehicle.key == "grace3":
            ctd = tuple(one for one in CTD if one.channel != definition.site.variable)
            definition = replace(definition, instruments=definition.instruments + ctd)
        if self.has_own_cameras and definition.site.kind == "tank":
            seeing = replace(definition, has_own_camera=True)
            definition = seeing.fixed_by_cameras(definition.surface_depth_m)
        hangs_before_cameras = self.cameras > 0 and definition.site.kind == "tank"
        if hangs_before_cameras or robot in self.fixed_by_cameras:
            definition = definition.fixed_by_cameras(self.surface_depth_m)
        return definition.far_away() if self.is_far else definition

    def sub(self, robot: RobotId) -> SubDefinition:
        """Return a vehicle that is not ours as it begins."""
        definition = sub_definition(robot)
        return replace(definition, faults=self._caused(robot, definition.faults))

    def _caused(self, robot: RobotId, faults: RobotFaults) -> RobotFaults:
        """Return faults with those that are to meet a robot, and that it can have."""
        can_have = fault_names_of((robot,))[robot]
        for fault in map(CausedFault.of, self.faults):
            if fault.meets(robot) and fault.name in can_have:
                faults = fault.added(faults)
        return faults

    def memory(self, robot: RobotId) -> Path | None:
        """Return the folder of a robot's memory; None where robots forget."""
        return None if self.memory_folder is None else self.memory_folder / robot

    def device_path(self, robot: RobotId, device: str) -> Path:
        """Return the path of the line to one of a robot's devices."""
        return self.link_folder / f"{robot}-{device}"

    def sub_port(self, robot: RobotId) -> int:
        """Return the UDP port of a vehicle that is not ours: as agreed on in its file, or usual."""
        try:
            return int((self.link_folder / f"{robot}{PORT_SUFFIX}").read_text())
        except FileNotFoundError:
            return sub_definition(robot).usual_port

    def link_path(self, robot: RobotId) -> Path:
        """Return the path of the station radio's pseudo-terminal in a robot's network."""
        return self.link_folder / FLEET[robot].link_name
