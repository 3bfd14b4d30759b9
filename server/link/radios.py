"""The station's radios, which go on undisturbed while robots come and go."""

import asyncio
import logging
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from typing import Protocol

from db.query.fleet.robots import RobotRecord
from robot_link.camera.fix import CameraFix
from robot_link.clock import Clock
from robot_link.mavlink.mission_item import item_count
from robot_link.messages import (
    CommandKind,
    CommandLevel,
    CommandNumber,
    CommandReport,
    LogId,
    OnboardPlanState,
    PlanHash,
    RobotId,
    SystemId,
    UploadReport,
)
from robot_link.mission import Mission
from robot_link.report import LinkEvent
from robot_link.service.file_store import FileEntry
from robot_link.service.parameter_file import ParameterDescription
from robot_link.service.parameter_table import ParameterValue
from robot_link.service.standard_item import StandardItem
from robot_link.standard_config import StandardCommandConfig
from robot_link.station.drive_client import DriveClient
from robot_link.station.error import OutOfContactError
from robot_link.station.fix_sender import OnSent
from robot_link.station.link import RobotEndpoint, StationLink
from robot_link.station.path import RadioPath
from robot_link.transport.datagram import DatagramTransport
from robot_link.transport.opening import is_radio, open_transport
from robot_link.transport.shelf import Shelf
from server.base.wakeups import Wakeups
from server.link.event import DetectionsStored, SamplesStored
from server.link.link import Radio
from server.link.parameters import ParameterRadio
from server.link.robot_logs import FileRadio
from server.link.signing import RobotSigning
from server.link.waypoints import WaypointRadio

log = logging.getLogger(__name__)


class Link(Radio, ParameterRadio, FileRadio, WaypointRadio, Protocol):
    """A radio that must be run; ``robot_link.station.link.StationLink`` is one."""

    def set_robots(
        self,
        robots: Mapping[RobotId, RobotEndpoint],
        transports: Mapping[str, DatagramTransport],
    ) -> None:
        """Say which robots there are; those whose links are the same are not disturbed."""
        ...

    def set_enabled(self, uri: str, is_enabled: bool) -> None:
        """Enable or disable a link; KeyError if there is no such link."""
        ...

    def acknowledge_samples(self, robot: RobotId, log: LogId, sequences: Iterable[int]) -> None:
        """Tell a robot that these samples are stored."""
        ...

    def give_control(self, robot: RobotId, system: SystemId, *, allows_takeover: bool) -> None:
        """Tell a robot which ground station is to be in control of it."""
        ...

    def answer_control(self, robot: RobotId, system: SystemId, *, is_heard: bool) -> None:
        """Answer another ground station's request, which a robot passed on."""
        ...

    async def let_go(self) -> None:
        """Give up every radio for good, and return once all that was heard has been told."""
        ...

    async def run(self) -> None:
        """Serve until cancelled."""
        ...


LinkFactory = Callable[[Clock, Callable[[LinkEvent], None], RobotSigning], Link]


def open_link(clock: Clock, on_event: Callable[[LinkEvent], None], signing: RobotSigning) -> Link:
    """Return a link to robots that will be named."""
    return StationLink({}, {}, clock, on_event, signing=signing)


def _paths(robot: RobotRecord) -> tuple[RadioPath, ...]:
    """Return the links of a robot that are radios, the preferred one first."""
    return tuple(RadioPath.of(uri) for uri in robot.links if is_radio(uri))


def _origin_deg(robot: RobotRecord) -> tuple[float, float]:
    return robot.site.origin_latitude_deg, robot.site.origin_longitude_deg


def _radios(endpoints: Iterable[RobotEndpoint]) -> set[str]:
    """Return what names the radios of the station by which robots are reached."""
    return {path.transport_uri for end in endpoints for path in end.paths}


class Radios:
    """The ``Radio`` of the services. Belongs to one event loop.

    A robot without a link of its own cannot be told anything: its commands wait here until it
    gets one, when whoever sent them sends them again, or until they expire.
    """

    def __init__(
        self,
        clock: Clock,
        on_event: Callable[[LinkEvent], None],
        make: LinkFactory,
        signing: RobotSigning,
        shelf: Shelf | None = None,
    ) -> None:
        self._clock = clock
        self._shelf = shelf or Shelf()
        self._on_event = on_event
        self._robots: dict[RobotId, RobotEndpoint] = {}
        self._orders: dict[RobotId, StandardCommandConfig] = {}
        self._disabled: set[str] = set()
        """Radios that the operator disabled, of robots there are and others."""
        self._signing = signing
        self._link = make(clock, on_event, signing)
        self._waiting: dict[tuple[RobotId, CommandNumber], datetime] = {}
        """When each command for a robot without a link expires."""
        self._expiry = Wakeups(clock)

    def set_robots(self, robots: Iterable[RobotRecord]) -> bool:
        """Say which robots there are; tell whether they changed."""
        endpoints = {
            robot.id: RobotEndpoint(
                robot.system_id,
                paths,
                self._signing.decisions(robot.id),
                standard=self._orders_of(robot),
                origin_deg=_origin_deg(robot) if robot.is_foreign else None,
            )
            for robot in robots
            if robot.system_id is not None and (paths := _paths(robot))
        }
        if endpoints == self._robots:
            return False
        uris = _radios(endpoints.values())
        transports = {uri: open_transport(uri, self._shelf) for uri in sorted(uris)}
        self._link.set_robots(endpoints, transports)
        self._robots = endpoints
        for uri in self._disabled & uris:
            self._link.set_enabled(uri, False)
        self._waiting = {key: end for key, end in self._waiting.items() if key[0] not in endpoints}
        return True

    def set_orders(self, robot: RobotId, config: StandardCommandConfig) -> None:
        """Say how another maker's vehicle is told orders, from the next ``set_robots`` on."""
        self._orders[robot] = config

    def _orders_of(self, robot: RobotRecord) -> StandardCommandConfig | None:
        if not robot.is_foreign:
            return None
        return self._orders.get(robot.id, StandardCommandConfig())

    def set_enabled(self, uri: str, *, is_enabled: bool) -> None:
        """Enable or disable a link; robots that share its radio share that.

        A radio that comes later, or again, is as it was left.
        """
        radio = RadioPath(uri).transport_uri
        (self._disabled.discard if is_enabled else self._disabled.add)(radio)
        if radio in _radios(self._robots.values()):
            self._link.set_enabled(radio, is_enabled)

    async def let_go(self) -> None:
        """Leave every radio to the shelf, and return once all that was heard has been told."""
        self._shelf.is_open = True
        await self._link.let_go()

    async def run(self) -> None:
        """Serve until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._link.run(), name="link")
            while True:
                self._expire()
                self._expiry.set_due("", min(self._waiting.values(), default=None))
                await self._expiry.next()

    async def upload(
        self, robot: RobotId, mission: Mission, *, may_wait: bool = False
    ) -> UploadReport:
        """Put a mission on board."""
        if robot not in self._robots:
            return UploadReport(
                robot=robot,
                sha256=mission.sha256(),
                items_sent=0,
                items=item_count(mission),
                state=OnboardPlanState.FAILED,
                reason=f"{robot} has no link; give it one.",
                at=self._clock.now(),
            )
        return await self._link.upload(robot, mission, may_wait=may_wait)

    def cancel_upload(self, robot: RobotId, reason: str) -> None:
        """End an upload under way."""
        if robot in self._robots:
            self._link.cancel_upload(robot, reason)

    def send_command(
        self,
        robot: RobotId,
        kind: CommandKind,
        number: CommandNumber,
        expires: datetime,
        plan: PlanHash | None = None,
    ) -> None:
        """Send a command until it is answered or expires."""
        if robot in self._robots:
            self._link.send_command(robot, kind, number, expires, plan)
        else:
            log.warning("%s has no link; its %s order waits", robot, kind)
            self._waiting[robot, number] = expires
            self._expiry.wake()

    def acknowledge(self, stored: SamplesStored | DetectionsStored) -> None:
        """Tell robots which samples they may forget."""
        sequences: dict[tuple[RobotId, LogId], list[int]] = defaultdict(list)
        told = stored.samples if isinstance(stored, SamplesStored) else stored.detections
        for sample in (*told, *stored.refused):
            endpoint = self._robots.get(sample.robot)
            if endpoint is not None and endpoint.standard is None:
                sequences[sample.robot, sample.log].append(sample.sequence)
        for (robot, sample_log), numbers in sequences.items():
            self._link.acknowledge_samples(robot, sample_log, numbers)

    def give_control(self, robot: RobotId, system: SystemId, *, allows_takeover: bool) -> None:
        """Tell one of our robots which ground station is to be in control; see ``StationLink``."""
        if self._speaks_control(robot):
            self._link.give_control(robot, system, allows_takeover=allows_takeover)

    def answer_control(self, robot: RobotId, system: SystemId, *, is_heard: bool) -> None:
        """Answer another ground station's request; see ``StationLink``."""
        if self._speaks_control(robot):
            self._link.answer_control(robot, system, is_heard=is_heard)

    def send_fix(self, fix: CameraFix, on_sent: OnSent) -> str:
        """Tell one of our robots where cameras saw it; see ``StationLink``."""
        if fix.robot not in self._robots:
            return f"{fix.robot} has no radio; give it one"
        return self._link.send_fix(fix, on_sent)

    def _speaks_control(self, robot: RobotId) -> bool:
        endpoint = self._robots.get(robot)
        return endpoint is not None and endpoint.standard is None

    async def read_parameters(self, robot: RobotId) -> Sequence[ParameterValue]:
        """Return every parameter of a robot; see ``StationLink``."""
        return await self._linked(robot).read_parameters(robot)

    async def describe_parameters(self, robot: RobotId) -> Mapping[str, ParameterDescription]:
        """Return what a vehicle says of its own parameters; see ``StationLink``."""
        return await self._linked(robot).describe_parameters(robot)

    async def write_parameter(self, robot: RobotId, name: str, value: float) -> ParameterValue:
        """Set a parameter and return it as it was read back; see ``StationLink``."""
        return await self._linked(robot).write_parameter(robot, name, value)

    async def upload_waypoints(
        self, robot: RobotId, items: Sequence[StandardItem], report: Callable[[int, int], None]
    ) -> None:
        """Put waypoints on board and read them back; see ``StationLink``."""
        await self._linked(robot).upload_waypoints(robot, items, report)

    async def read_waypoints(
        self, robot: RobotId, report: Callable[[int, int], None]
    ) -> Sequence[StandardItem]:
        """Return the waypoints on board; see ``StationLink``."""
        return await self._linked(robot).read_waypoints(robot, report)

    async def list_files(self, robot: RobotId, path: str = "/") -> Sequence[FileEntry]:
        """Return the entries of a folder on board; see ``StationLink``."""
        return await self._linked(robot).list_files(robot, path)

    async def download_file(
        self, robot: RobotId, path: str, *, content: bytearray, report: Callable[[int, int], None]
    ) -> bytes:
        """Return a whole file of a robot; see ``StationLink``."""
        return await self._linked(robot).download_file(robot, path, content=content, report=report)

    def drive(self, robot: RobotId) -> DriveClient:
        """Return what drives a robot by hand; see ``StationLink``."""
        return self._linked(robot).drive(robot)

    def _linked(self, robot: RobotId) -> Link:
        if robot not in self._robots:
            raise OutOfContactError(f"{robot} has no radio; give it one")
        return self._link

    def _expire(self) -> None:
        """Tell of the commands that found no link in time."""
        now = self._clock.now()
        for (robot, number), expires in list(self._waiting.items()):
            if expires <= now:
                del self._waiting[robot, number]
                reason = f"{robot} has no link; give it one."
                level = CommandLevel.EXPIRED
                self._on_event(CommandReport(robot, number, level, now, "", reason))
