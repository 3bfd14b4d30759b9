"""The station's side of every service: telemetry, commands, mission upload, acknowledgement."""

import asyncio
from collections.abc import Callable, Iterable, Mapping
from datetime import datetime
from functools import partial

from robot_link.clock import Clock
from robot_link.command_lane import Command, CommandLane
from robot_link.delivery import deliver
from robot_link.mavlink import telemetry
from robot_link.mavlink.codec import STATION_COMPONENT, STATION_SYSTEM, Codec, WireMessage
from robot_link.mavlink.decode import Value, decoded, robot_time
from robot_link.mavlink.wire import grace
from robot_link.messages import (
    CommandKind,
    CommandNumber,
    LinkEvent,
    LinkReport,
    LinkState,
    LogId,
    OnboardPlanState,
    PlanHash,
    PlanReport,
    RawFrame,
    RobotId,
    RobotMode,
    Sample,
    StateReport,
    SystemId,
    UploadReport,
)
from robot_link.mission import Mission
from robot_link.path import RadioPath, RobotEndpoint
from robot_link.peer import Peer
from robot_link.sample_gate import SampleGate
from robot_link.timing import LinkTiming
from robot_link.transport.datagram import (
    BROADCAST,
    Address,
    DatagramTransport,
    Garbled,
    PortChanged,
    Received,
)
from robot_link.upload import Upload

__all__ = ["RadioPath", "RobotEndpoint", "StationLink", "UploadUnderWayError"]


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
    ) -> None:
        self._transports = transports
        self._clock = clock
        self._on_event = on_event
        self._timing = timing or LinkTiming()
        self._codec = Codec(STATION_SYSTEM, STATION_COMPONENT)
        self._samples = SampleGate()
        self._samples_owed = asyncio.Event()
        self._uploads: dict[RobotId, Upload] = {}
        self._told_state: dict[tuple[RobotId, str], LinkState] = {}
        self._peers = {
            robot: Peer(
                robot,
                endpoint,
                transports,
                self._codec,
                clock,
                on_event,
                self._timing,
            )
            for robot, endpoint in robots.items()
        }
        self._lanes = {robot: CommandLane(peer, on_event) for robot, peer in self._peers.items()}
        self._peer_of_system: dict[SystemId, Peer] = {
            peer.system: peer for peer in self._peers.values()
        }

    async def run(self) -> None:
        """Serve until cancelled; ports that close are opened again by themselves."""
        async with asyncio.TaskGroup() as group:
            for uri, transport in self._transports.items():
                group.create_task(transport.run(), name=f"{uri} port")
                group.create_task(self._listen(transport), name=f"{uri} listen")
                group.create_task(self._beat(transport), name=f"{uri} heartbeat")
            for robot, lane in self._lanes.items():
                group.create_task(lane.run(), name=f"{robot} commands")
            group.create_task(self._acknowledge(), name="sample acknowledgements")
            group.create_task(self._report_links(), name="link reports")

    async def upload(self, robot: RobotId, mission: Mission) -> UploadReport:
        """Put a mission on board; progress travels as ``UploadReport`` events.

        Returns:
            The last report: ON_BOARD after the robot echoed the hash, REFUSED with the robot's
            reason, or FAILED when it did not answer. The same mission again is answered at once.

        Raises:
            UploadUnderWayError: If another upload to this robot has not ended.
            KeyError: If no such robot is known.
        """
        peer = self._peers[robot]
        if robot in self._uploads:
            raise UploadUnderWayError(f"another upload to {robot} has not ended")
        upload = Upload(peer, mission, self._on_event)
        self._uploads[robot] = upload
        try:
            return await upload.run()
        finally:
            del self._uploads[robot]

    def cancel_upload(self, robot: RobotId, reason: str) -> None:
        """End an upload under way as FAILED; without one, do nothing."""
        upload = self._uploads.get(robot)
        if upload is not None:
            upload.cancel(reason)

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
        lane = self._lanes[robot]
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
        self._samples.store(self._peers[robot].robot, log, sequences)
        self._samples_owed.set()

    def link_report(self, robot: RobotId) -> LinkReport:
        """Return what is known of the best road to a robot now.

        Raises:
            KeyError: If no such robot is known.
        """
        return self._peers[robot].link_report()

    def link_reports(self, robot: RobotId) -> list[LinkReport]:
        """Return what is known of every road to a robot now, the preferred one first.

        Raises:
            KeyError: If no such robot is known.
        """
        return self._peers[robot].link_reports()

    def choose_link(self, robot: RobotId, uri: str | None) -> None:
        """Talk to a robot by this link only; None leaves the choice to what is live.

        Raises:
            KeyError: If no such robot is known, or it has no such link.
        """
        self._peers[robot].choose(uri)

    def set_plugged(self, uri: str, is_plugged: bool) -> None:
        """Pull the plug of a link, or put it back; robots that share the radio share the plug.

        Raises:
            KeyError: If no such link is known.
        """
        self._transports[RadioPath(uri).transport_uri].set_plugged(is_plugged)
        for peer in self._peers.values():
            self._report_if_changed(peer)

    async def _listen(self, transport: DatagramTransport) -> None:
        async for event in transport.events():
            match event:
                case Received():
                    self._receive(transport, event)
                case PortChanged():
                    for peer in self._peers.values():
                        self._report_if_changed(peer)
                case Garbled(frames, data):
                    self._count_bad(transport, None, frames)
                    at = self._clock.now()
                    self._on_event(RawFrame(None, transport.carrier, False, data, at))

    def _receive(self, transport: DatagramTransport, received: Received) -> None:
        at = self._clock.now()
        sender = self._peer_at(transport, received.address)
        messages, bad = self._codec.unpack(received.data)
        if sender is None and messages:
            sender = self._bind(transport, messages[0])
        self._on_event(
            RawFrame(
                robot=None if sender is None else sender.robot,
                carrier=transport.carrier,
                outgoing=False,
                data=received.data,
                at=at,
                robot_at=robot_time(messages),
            )
        )
        if sender is None:
            self._count_bad(transport, None, max(1, bad + len(messages)))
            return
        own = [message for message in messages if message.get_srcSystem() == sender.system]
        self._count_bad(transport, sender, bad + len(messages) - len(own))
        if own:
            sender.heard(transport, received, len(own))
            self._report_if_changed(sender)
            for message in own:
                self._interpret(transport, sender, message, at)
            self._lanes[sender.robot].contact()

    def _peer_at(self, transport: DatagramTransport, address: Address) -> Peer | None:
        for peer in self._peers.values():
            if peer.speaks_at(transport, address):
                return peer
        return None

    def _bind(self, transport: DatagramTransport, message: WireMessage) -> Peer | None:
        """Return the robot that an unknown radio speaks for, if that robot has no radio yet."""
        peer = self._peer_of_system.get(SystemId(message.get_srcSystem()))
        return peer if peer is not None and peer.is_unbound_on(transport) else None

    def _count_bad(self, transport: DatagramTransport, sender: Peer | None, frames: int) -> None:
        for peer in self._peers.values() if sender is None else (sender,):
            peer.count_bad(transport, frames)

    def _interpret(
        self, transport: DatagramTransport, peer: Peer, message: WireMessage, at: datetime
    ) -> None:
        match message:
            case grace.MAVLink_command_ack_message():
                self._lanes[peer.robot].answered(message)
            case grace.MAVLink_mission_request_int_message():
                if (upload := self._uploads.get(peer.robot)) is not None:
                    upload.hear(message)
            case _:
                try:
                    value = decoded(message, peer.robot, at)
                except ValueError:
                    peer.count_bad(transport, 1)
                else:
                    self._take(peer, value)

    def _take(self, peer: Peer, value: Value) -> None:
        match value:
            case RobotMode():
                peer.mode = value
            case StateReport():
                peer.mode = value.mode
                self._on_event(value)
            case Sample():
                if self._samples.admit(value):
                    self._on_event(value)
                else:
                    self._samples_owed.set()
            case PlanReport():
                self._take_plan_report(peer, value)
            case None:
                pass

    def _take_plan_report(self, peer: Peer, report: PlanReport) -> None:
        """Tell what is on board; the fate of an offer is its upload's business alone."""
        if (upload := self._uploads.get(peer.robot)) is not None:
            upload.hear(report)
        if report.state not in (OnboardPlanState.RECEIVING, OnboardPlanState.REFUSED):
            self._on_event(report)

    async def _beat(self, transport: DatagramTransport) -> None:
        while True:
            if transport.max_payload:
                message = grace.MAVLink_heartbeat_message(
                    type=grace.MAV_TYPE_GCS,
                    autopilot=grace.MAV_AUTOPILOT_INVALID,
                    base_mode=0,
                    custom_mode=0,
                    system_status=grace.MAV_STATE_ACTIVE,
                    mavlink_version=3,
                )
                frame = self._codec.pack(message)
                taken = partial(self._tell_sent, transport, frame)
                await deliver(transport, BROADCAST, frame, on_taken=taken)
            await asyncio.sleep(self._timing.heartbeat_s)

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
        """Tell the robots what is stored; a lost word is repeated when the sample comes again."""
        async with asyncio.TaskGroup() as group:
            while True:
                await self._samples_owed.wait()
                await asyncio.sleep(self._timing.acknowledge_s)
                self._samples_owed.clear()
                for (robot, log), sequences in self._samples.take_owed().items():
                    peer = self._peers[robot]
                    messages = telemetry.acknowledgements(peer.system, log, sequences)
                    group.create_task(peer.deliver(messages), name=f"{robot} acknowledgement")

    async def _report_links(self) -> None:
        while True:
            for peer in self._peers.values():
                self._report_link(peer)
            await asyncio.sleep(self._timing.report_s)

    def _report_if_changed(self, peer: Peer) -> None:
        for report in peer.link_reports():
            if self._told_state.get((peer.robot, report.uri)) is not report.state:
                self._tell_link(report)

    def _report_link(self, peer: Peer) -> None:
        for report in peer.link_reports():
            self._tell_link(report)

    def _tell_link(self, report: LinkReport) -> None:
        self._told_state[report.robot, report.uri] = report.state
        self._on_event(report)
