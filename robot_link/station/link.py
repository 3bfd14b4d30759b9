"""The station's side of every service: telemetry, commands, mission upload, acknowledgement."""

import asyncio
from collections.abc import Callable, Coroutine, Iterable, Mapping, Sequence
from datetime import datetime
from functools import partial
from typing import Any

from robot_link.camera.fix import CameraFix
from robot_link.clock import Clock
from robot_link.mavlink import telemetry
from robot_link.mavlink.codec import STATION_COMPONENT, STATION_SYSTEM, Codec
from robot_link.mavlink.signing import Signing
from robot_link.mavlink.standard_vehicle import StandardVehicle
from robot_link.messages import (
    CommandKind,
    CommandNumber,
    LinkReport,
    LogId,
    PlanHash,
    RawFrame,
    RobotId,
    SystemId,
    UploadReport,
)
from robot_link.mission import Mission
from robot_link.report import LinkEvent
from robot_link.service.file_store import FileEntry
from robot_link.service.heartbeat import beat
from robot_link.service.parameter_file import ParameterDescription
from robot_link.service.parameter_table import ParameterValue
from robot_link.service.standard_item import StandardItem
from robot_link.station.command_lane import Command, CommandLane
from robot_link.station.drive_client import DriveClient
from robot_link.station.fix_sender import FixPace, OnSent
from robot_link.station.link_watch import LinkWatch
from robot_link.station.path import RadioPath, RobotEndpoint
from robot_link.station.peer import Peer
from robot_link.station.reception import Reception
from robot_link.station.robot_services import RobotServices
from robot_link.station.roster import Member, Roster
from robot_link.station.sample_gate import SampleGate
from robot_link.station.standard_lane import StandardCommandLane
from robot_link.station.standard_mission import put_on_board, read_back
from robot_link.station.upload import Upload
from robot_link.timing import LinkTiming
from robot_link.transport.datagram import (
    DatagramTransport,
)

__all__ = ["RadioPath", "RobotEndpoint", "StationLink", "UploadUnderWayError"]


Work = Callable[[], Coroutine[Any, Any, None]]


class OwnedTasks:
    """Starts the work of an owner when the link runs, and stops it when the owner is gone.

    The failure of a task ends the link, as in any task group.
    """

    def __init__(self) -> None:
        self._work: dict[str, Mapping[str, Work]] = {}
        self._tasks: dict[str, list[asyncio.Task[None]]] = {}
        self._group: asyncio.TaskGroup | None = None

    def add(self, owner: str, work: Mapping[str, Work]) -> None:
        """Take up the work of an owner, by names for people."""
        self._work[owner] = work
        if self._group is not None:
            self._start(self._group, owner)

    def remove(self, owner: str) -> None:
        """Stop the work of an owner."""
        del self._work[owner]
        for task in self._tasks.pop(owner, []):
            task.cancel()

    async def run(self) -> None:
        """Do all work until cancelled."""
        try:
            async with asyncio.TaskGroup() as group:
                self._group = group
                for owner in self._work:
                    self._start(group, owner)
                await asyncio.Event().wait()
        finally:
            self._group = None
            self._tasks.clear()

    def _start(self, group: asyncio.TaskGroup, owner: str) -> None:
        self._tasks[owner] = [
            group.create_task(work(), name=f"{owner} {name}")
            for name, work in self._work[owner].items()
        ]


def _work_of(member: Member) -> dict[str, Work]:
    """Return what is done for a robot; a vehicle of another maker has a clock of its own kind."""
    second = member.services.ask_for_streams if member.vehicle is not None else member.services.run
    return {"commands": member.lane.run, "services": second}


class UploadUnderWayError(Exception):
    """Another upload to the same robot has not ended yet."""


class StationLink:
    """Talks to all robots and tells ``on_event`` what it learns; belongs to one event loop.

    ``on_event`` is called on the loop for every event in order and must return at once. Nothing
    here is persistent: after a restart, the owner sends unfinished commands again under the same
    number and expiry, and uploads the plan again; the robot recognizes both.

    A robot is heard only through the radio that its endpoint names, or that first spoke under its
    system id; frames of others are dropped and counted. What cannot be attributed to a robot is
    counted for every robot of that transport.
    """

    def __init__(
        self,
        transports: Mapping[str, DatagramTransport],
        robots: Mapping[RobotId, RobotEndpoint],
        clock: Clock,
        on_event: Callable[[LinkEvent], None],
        timing: LinkTiming | None = None,
        signing: Callable[[RobotId], Signing | None] = lambda _robot: None,
    ) -> None:
        self._transports: dict[str, DatagramTransport] = {}
        self._clock = clock
        self._on_event = on_event
        self._timing = timing or LinkTiming()
        self._signing = signing
        self._codec = Codec(STATION_SYSTEM, STATION_COMPONENT)
        self._samples = SampleGate()
        self._samples_owed = asyncio.Event()
        self._roster = Roster()
        self._fix_pace = FixPace()
        self._watch = LinkWatch(self._roster, on_event)
        self._reception = Reception(
            self._roster,
            self._codec,
            self._watch,
            self._samples,
            self._samples_owed,
            clock,
            on_event,
        )
        self._tasks = OwnedTasks()
        self.set_robots(robots, transports)

    async def run(self) -> None:
        """Serve until cancelled; ports that close are opened again by themselves."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._tasks.run(), name="radios and robots")
            group.create_task(self._acknowledge(), name="sample acknowledgements")
            group.create_task(self._watch.run(self._timing.report_s), name="link reports")

    def set_robots(
        self,
        robots: Mapping[RobotId, RobotEndpoint],
        transports: Mapping[str, DatagramTransport],
    ) -> None:
        """Say which robots there are; also while serving.

        A robot whose endpoint is the same goes on undisturbed, and so does the transport of a URI
        that is used already: the new one of that URI is not touched. Of a robot that is gone or
        has other links now, an upload under way ends as FAILED, and its commands are dropped
        without a word: the owner sends unfinished ones again.

        Raises:
            KeyError: If a robot's link names no transport.
        """
        for member in list(self._roster):
            if robots.get(member.robot) != member.endpoint:
                self.cancel_upload(member.robot, "the robot's links or its key were changed")
                self._tasks.remove(member.robot)
                self._roster.remove(member.robot)
        for uri in [uri for uri in self._transports if uri not in transports]:
            self._tasks.remove(uri)
            del self._transports[uri]
        for uri, transport in transports.items():
            if uri not in self._transports:
                self._transports[uri] = transport
                self._serve(uri, transport)
        for robot, endpoint in robots.items():
            if self._roster.get(robot) is None:
                member = self._member(robot, endpoint)
                self._roster.add(member)
                self._tasks.add(robot, _work_of(member))

    def _member(self, robot: RobotId, endpoint: RobotEndpoint) -> Member:
        signing = self._signing(robot)
        codec = self._codec
        if signing is not None:
            codec = Codec(STATION_SYSTEM, STATION_COMPONENT, signing)
        peer = Peer(
            robot, endpoint, self._transports, codec, self._clock, self._on_event, self._timing
        )
        if endpoint.standard is None:
            lane = CommandLane(peer, self._on_event)
            return Member(endpoint, peer, lane, codec, signing, self._fix_pace)
        vehicle = StandardVehicle(robot, endpoint.origin_deg, self._clock.speed)
        lane = StandardCommandLane(peer, self._on_event, vehicle, endpoint.standard)
        return Member(endpoint, peer, lane, codec, signing, self._fix_pace, vehicle)

    def _serve(self, uri: str, transport: DatagramTransport) -> None:
        codecs = partial(self._codecs_on, transport)
        told = partial(self._tell_sent, transport)
        period_s = self._timing.heartbeat_s
        work = {
            "port": transport.run,
            "listen": partial(self._reception.listen, transport),
            "heartbeat": partial(beat, transport, codecs, told, period_s),
        }
        self._tasks.add(uri, work)

    def _codecs_on(self, transport: DatagramTransport) -> list[Codec]:
        """Return who packs for the robots of a radio, each once."""
        reached = [one for one in self._roster if one.peer.path_on(transport) is not None]
        return list(dict.fromkeys(one.codec for one in reached)) or [self._codec]

    async def let_go(self) -> None:
        """Give up every radio for good, and return once all that was heard has been told."""
        await asyncio.gather(*(one.let_go() for one in self._transports.values()))

    async def upload(
        self, robot: RobotId, mission: Mission, *, may_wait: bool = False
    ) -> UploadReport:
        """Put a mission on board; progress travels as ``UploadReport`` events.

        Args:
            robot: Which robot.
            mission: What to put on board.
            may_wait: Whether it may wait there behind a plan that is flown.

        Returns:
            The last report: ON_BOARD after the robot echoed the hash, WAITING where it waits behind
            another plan, REFUSED with the robot's reason, or FAILED when it did not answer. The
            same mission again is answered at once.

        Raises:
            UploadUnderWayError: If another upload to this robot has not ended.
            KeyError: If no such robot is known.
        """
        member = self._roster[robot]
        if member.upload is not None:
            raise UploadUnderWayError(f"another upload to {robot} has not ended")
        member.upload = Upload(member.peer, mission, self._on_event, may_wait=may_wait)
        try:
            return await member.upload.run()
        finally:
            member.upload = None

    def cancel_upload(self, robot: RobotId, reason: str) -> None:
        """End an upload under way as FAILED; without one, do nothing."""
        member = self._roster.get(robot)
        if member is not None and member.upload is not None:
            member.upload.cancel(reason)

    def send_command(
        self,
        robot: RobotId,
        kind: CommandKind,
        number: CommandNumber,
        expires: datetime,
        plan: PlanHash | None = None,
    ) -> None:
        """Take a command for a robot; its levels travel as ``CommandReport`` events.

        It is sent at once, and again at each contact, until the robot answers or it expires.
        Commands to one robot go one after another; SURFACE drops all earlier ones as EXPIRED and
        ends an upload under way.

        Args:
            robot: Whom to tell.
            kind: What to tell.
            number: The station's number; with ``expires`` it names the command to the robot,
                which acts once however often it hears it.
            expires: Time of the clock after which the command is never sent.
            plan: The plan that START means.

        Raises:
            KeyError: If no such robot is known.
        """
        lane = self._roster[robot].lane
        if kind is CommandKind.SURFACE:
            self.cancel_upload(robot, "the robot is told to surface")
        lane.submit(Command(kind, number, expires, plan))

    def acknowledge_samples(self, robot: RobotId, log: LogId, sequences: Iterable[int]) -> None:
        """Tell a robot that these samples are stored; call it after the commit, repeats too.

        A sample that was acknowledged and arrives again is acknowledged again and not told;
        one that arrives twice before its acknowledgement is told twice.

        Raises:
            KeyError: If no such robot is known.
        """
        self._samples.store(self._roster[robot].robot, log, sequences)
        self._samples_owed.set()

    async def read_parameters(self, robot: RobotId) -> tuple[ParameterValue, ...]:
        """Return every parameter of a robot, in its own order.

        Raises:
            ServiceError: If it is not in radio contact, falls silent or refuses.
            KeyError: If no such robot is known.
        """
        services = self._roster[robot].services
        services.check_live()
        return await services.parameters.read_all()

    async def describe_parameters(self, robot: RobotId) -> Mapping[str, ParameterDescription]:
        """Return what a vehicle says of its own parameters, by their names.

        Raises:
            ServiceError: If it is not in contact, falls silent, or has no such file.
            KeyError: If no such robot is known.
        """
        services = self._roster[robot].services
        services.check_live()
        return await services.metadata.parameters()

    async def write_parameter(self, robot: RobotId, name: str, value: float) -> ParameterValue:
        """Set a parameter of a robot, and return it as it was read back.

        Raises:
            ValueError: If the value is not of the parameter's type.
            ServiceError: If the robot is not in radio contact, falls silent or refuses.
            KeyError: If no such robot is known.
        """
        services = self._roster[robot].services
        services.check_live()
        return await services.parameters.write(name, value)

    async def list_files(self, robot: RobotId, path: str = "/") -> tuple[FileEntry, ...]:
        """Return the entries of a folder on board.

        Raises:
            ServiceError: If the robot is not in radio contact, falls silent or refuses.
            KeyError: If no such robot is known.
        """
        services = self._roster[robot].services
        services.check_live()
        return await services.files.list(path)

    async def download_file(
        self,
        robot: RobotId,
        path: str,
        *,
        content: bytearray | None = None,
        report: Callable[[int, int], None] = lambda _received, _size: None,
    ) -> bytes:
        """Return a whole file of a robot; its checksum is that of the file on board.

        Args:
            robot: Whose file.
            path: The file, from the root of what the robot offers.
            content: Its first bytes, from an attempt that broke off; grows as the file comes.
            report: Called with the bytes that are there, and the file's size.

        Raises:
            ServiceError: If the robot is not in radio contact, falls silent or refuses.
            KeyError: If no such robot is known.
        """
        services = self._roster[robot].services
        services.check_live()
        return await services.files.download(path, content=content, report=report)

    async def upload_waypoints(
        self,
        robot: RobotId,
        items: Sequence[StandardItem],
        report: Callable[[int, int], None],
    ) -> None:
        """Put waypoints on board of a vehicle of another maker, and prove it by reading them back.

        Raises:
            ServiceError: If it is not in contact, falls silent, refuses or holds something else.
            KeyError: If no such vehicle is known.
        """
        member = self._roster[robot]
        member.services.check_live()
        await put_on_board(member.services.missions, member.foreign(), items, report)

    async def read_waypoints(
        self, robot: RobotId, report: Callable[[int, int], None]
    ) -> Sequence[StandardItem]:
        """Return the mission on board of a vehicle of another maker.

        Raises:
            ServiceError: If it is not in contact, falls silent or refuses.
            KeyError: If no such vehicle is known.
        """
        member = self._roster[robot]
        member.services.check_live()
        return await read_back(member.services.missions, member.foreign(), report)

    def drive(self, robot: RobotId) -> DriveClient:
        """Return what drives a robot by hand.

        Raises:
            ServiceError: If it is not in radio contact.
            KeyError: If no such robot is known.
        """
        services = self._roster[robot].services
        services.check_live()
        return services.drive

    def send_fix(self, fix: CameraFix, on_sent: OnSent) -> str:
        """Tell one of our robots where cameras saw it: newest only, by radio, never resent.

        Args:
            fix: Where its robot was.
            on_sent: Called with the station's time if and when the radio took it; never, where a
                newer fix came before its turn.

        Returns:
            Why it will not be sent, a sentence; empty where it waits for its turn.

        Raises:
            KeyError: If no such robot is known.
        """
        member = self._roster[fix.robot]
        if member.vehicle is not None:
            return f"{fix.robot} is a vehicle of another maker"
        return member.services.fixes.send(fix, on_sent)

    def give_control(self, robot: RobotId, system: SystemId, *, allows_takeover: bool) -> None:
        """Tell one of our robots which ground station is to be in control of it.

        Raises:
            KeyError: If no such robot is known.
        """
        self._roster[robot].services.control.give(system, allows_takeover=allows_takeover)

    def answer_control(self, robot: RobotId, system: SystemId, *, is_heard: bool) -> None:
        """Answer another ground station's request, which a robot passed on.

        Args:
            robot: Whom it asks for.
            system: Who asks.
            is_heard: It is heard and waits for a decision; else it is refused.

        Raises:
            KeyError: If no such robot is known.
        """
        self._roster[robot].services.control.answer(system, is_heard=is_heard)

    def services(self, robot: RobotId) -> RobotServices:
        """Return the clients of a robot: standard missions and commands for other makers' ones.

        Raises:
            KeyError: If no such robot is known.
        """
        return self._roster[robot].services

    def link_report(self, robot: RobotId) -> LinkReport:
        """Return what is known of the best link to a robot now.

        Raises:
            KeyError: If no such robot is known.
        """
        return self._watch.best(self._roster[robot])

    def link_reports(self, robot: RobotId) -> list[LinkReport]:
        """Return what is known of every link to a robot now, the preferred one first.

        Raises:
            KeyError: If no such robot is known.
        """
        return self._watch.reports(self._roster[robot])

    def set_enabled(self, uri: str, is_enabled: bool) -> None:
        """Enable or disable a link; robots that share its radio share that.

        Raises:
            KeyError: If no such link is known.
        """
        self._transports[RadioPath(uri).transport_uri].set_enabled(is_enabled)
        self._watch.tell_all_changes()

    def _tell_sent(self, transport: DatagramTransport, frame: bytes) -> None:
        self._on_event(
            RawFrame(
                robot=None,
                carrier=transport.carrier,
                outgoing=True,
                data=frame,
                at=self._clock.now(),
            )
        )

    async def _acknowledge(self) -> None:
        """Tell the robots what is stored; a lost word is repeated when the sample comes again.

        Each robot is told one thing at a time, and what comes meanwhile together: orders must not
        queue behind acknowledgements that a slow radio has not taken yet.
        """
        busy: set[RobotId] = set()

        async def tell(member: Member, owed: list[tuple[LogId, set[int]]]) -> None:
            system = member.peer.system
            try:
                await member.peer.deliver(
                    message
                    for log, sequences in owed
                    for message in telemetry.acknowledgements(system, log, sequences)
                )
            finally:
                busy.discard(member.robot)
                self._samples_owed.set()

        async with asyncio.TaskGroup() as group:
            while True:
                await self._samples_owed.wait()
                await asyncio.sleep(self._timing.acknowledge_s)
                self._samples_owed.clear()
                for robot, owed in self._samples.take_owed(busy).items():
                    if (member := self._roster.get(robot)) is not None:
                        busy.add(robot)
                        group.create_task(tell(member, owed), name=f"{robot} acknowledgement")
