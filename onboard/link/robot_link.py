"""The robot's side of every service; what the onboard program talks through."""

import asyncio
import logging
import math
from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime
from functools import partial
from itertools import islice

from onboard.link.channel_announcer import ChannelAnnouncer
from onboard.link.command_desk import CommandDesk, CommandMemory
from onboard.link.drive_desk import DriveDesk, driver_of
from onboard.link.mission_server import Asker
from onboard.link.newest_sender import NewestSender
from onboard.link.operator_desk import OperatorDesk
from onboard.link.plan_desk import PlanDesk, PlanOnBoard
from onboard.link.plan_store import PlanStore, WaitingPlan
from onboard.link.sample_sender import SampleSender
from onboard.link.service_desk import ServiceDesk
from onboard.link.status_text import status_texts
from onboard.link.waypoint_mission import WaypointRules
from robot_link.actuator_check import actuator_fault
from robot_link.channel_table import ChannelTable
from robot_link.clock import Clock, monotonic_s, set_or_after
from robot_link.delivery import deliver
from robot_link.mavlink import actuator, current, detection, several, target, telemetry
from robot_link.mavlink.codec import ROBOT_COMPONENT, STATION_SYSTEM, Codec, WireMessage
from robot_link.mavlink.command import (
    ReceivedCommand,
    received_command,
    result_of,
)
from robot_link.mavlink.drive import DRIVE_FRAME_BYTES
from robot_link.mavlink.fix import FixMessage, received_fix
from robot_link.mavlink.signing import Signing, Verdict
from robot_link.mavlink.wire import grace
from robot_link.messages import (
    CommandKind,
    LogId,
    OnboardPlanState,
    PlanHash,
    PositionNed,
    RobotMode,
    StateReport,
    SystemId,
)
from robot_link.mission import Mission
from robot_link.report import ActuatorReport, CurrentReport, ReceiverReport, TargetReport
from robot_link.robot_program import CommandOutcome, RobotProgram
from robot_link.sample_log import HeardTag, Measurement, SampleLog
from robot_link.service.duplicate import DuplicateWatch
from robot_link.service.file_store import FileStore, NoFiles
from robot_link.service.heartbeat import robot_heartbeat
from robot_link.service.pace import Pace
from robot_link.service.parameter_table import ParameterTable
from robot_link.tag.check import receiver_fault
from robot_link.timing import LinkTiming
from robot_link.transport.datagram import BROADCAST, Address, DatagramTransport, Received

__all__ = ["CommandOutcome", "RobotLink", "RobotProgram"]

_ATTEMPTS = 3
_SILENCES_BEFORE_ANOTHER_STATION = 3
_ANYONE = 0
_REPLIES = 512
"""Answers that may wait for the radio; whoever gets none asks again."""
_MAY_MOVE = True
"""Another station may take over from wherever it is, when the one before has been silent long."""
_STREAM_SHARE = 0.5
"""What standard telemetry may take of a radio; the rest is for what our own station asks."""


_log = logging.getLogger(__name__)
_Command = grace.MAVLink_command_long_message
_CameraFix = grace.MAVLink_grace_fix_message
_MotionCapture = grace.MAVLink_vision_position_estimate_message


class RobotLink:
    """Heartbeat, state, samples, plan and commands of one robot; belongs to one event loop.

    Samples are kept and sent again until the station says that they are stored. A command acts
    once, however often it is heard. A plan replaces the one on board only when it is complete and
    its hash is the offered one. Time-outs are wall seconds; time stamps are the clock's.

    Args:
        system: The robot's MAVLink system id.
        transport: Its radio, which the link runs.
        clock: The robot's clock.
        program: What flies the robot.
        log: Memory of samples.
        plans: Memory of the plan on board; a plan found in it is reported as ON_BOARD.
        parameters: What can be read and set from outside; none without.
        files: What can be downloaded; nothing without.
        command_memory: What the robot remembers of commands when it is restarted.
        waypoints: How it flies missions of other makers' ground stations; without, those are not
            served at all.
        signing: Signs every frame and lets none in that is not signed alike; without, no frame is
            signed or refused for it.
        timing: Time-outs.
    """

    def __init__(
        self,
        system: SystemId,
        transport: DatagramTransport,
        clock: Clock,
        program: RobotProgram,
        *,
        log: SampleLog,
        plans: PlanStore,
        parameters: ParameterTable | None = None,
        files: FileStore | None = None,
        command_memory: CommandMemory | None = None,
        waypoints: WaypointRules | None = None,
        signing: Signing | None = None,
        timing: LinkTiming | None = None,
    ) -> None:
        self.parameters = ParameterTable(()) if parameters is None else parameters
        self.files: FileStore = NoFiles() if files is None else files
        self._system = system
        self._transport = transport
        self._clock = clock
        self._program = program
        self._timing = timing or LinkTiming()
        self._patience_s = _SILENCES_BEFORE_ANOTHER_STATION * self._timing.stale_s
        self._signing = signing
        self._codec = Codec(system, ROBOT_COMPONENT, signing)
        self._pace = Pace(lambda: transport.bytes_per_s)
        self._samples = SampleSender(log, self._codec, transport, self._timing, self._pace)
        self._station: Address | None = None
        self._station_heard_s = -math.inf
        self._station_known = asyncio.Event()
        self._replies: asyncio.Queue[tuple[Address | None, WireMessage]] = asyncio.Queue(_REPLIES)
        self._mode = RobotMode.IDLE
        self._mode_changed = asyncio.Event()
        self._states = self._newest_sender(telemetry.STATE_FRAME_BYTES)
        self._targets = self._newest_sender(target.TARGET_FRAME_BYTES)
        self._currents = self._newest_sender(current.CURRENT_FRAME_BYTES)
        self._actuators = self._newest_sender(actuator.ACTUATOR_FRAME_BYTES)
        self._receivers = self._newest_sender(detection.RECEIVER_FRAME_BYTES)
        self._health = self._newest_sender(several.HEALTH_FRAME_BYTES)
        self._driven = self._newest_sender(DRIVE_FRAME_BYTES)
        self._drive = DriveDesk(system, program, self._driven)
        self.channels = ChannelAnnouncer(
            log,
            clock,
            lambda: transport.max_payload - self._codec.trailer_bytes,
            self._send_page,
            self._timing.announce_s,
        )
        """What the robot says that it measures."""
        self._plan = PlanDesk(
            plans, program, clock, self._timing, lambda message: self._answer(None, message)
        )
        self._commands = CommandDesk(self._plan, command_memory)
        self._operators = OperatorDesk(
            lambda: self.last_heard_station_s <= self._patience_s,
            self._guests,
            self._answer,
            self._timing.heartbeat_s,
        )
        self._services = ServiceDesk(
            system,
            clock,
            self._plan,
            self._drive,
            self._operators,
            parameters=self.parameters,
            files=self.files,
            rules=waypoints,
            answer_s=self._timing.answer_s,
            master_s=self._patience_s,
            reply=self._answer,
            channel_pages=self.channels.pages,
        )
        self._duplicates = DuplicateWatch()
        self.frames_bad = 0
        """Frames dropped for a bad checksum, a foreign sender or impossible content."""

    @property
    def conflict(self) -> str:
        """Sentence on another robot that speaks under this one's system id, or ""."""
        return self._duplicates.sentence(self._system, monotonic_s())

    @property
    def plan_hash(self) -> PlanHash | None:
        """Hash of the plan on board."""
        return self._plan.plan_hash

    @property
    def waiting_plan(self) -> WaitingPlan | None:
        """The plan that waits behind the one on board."""
        return self._plan.queue.waiting

    def begin_next_plan(self) -> None:
        """Begin the plan that waits for this surfacing, if one does."""
        self._plan.begin_next()

    @property
    def unacknowledged_samples(self) -> int:
        """Samples not yet known to be stored ashore."""
        return len(self._samples)

    @property
    def last_heard_station_s(self) -> float:
        """Seconds of the wall since the station was heard; infinite before the first time."""
        return monotonic_s() - self._station_heard_s

    def plan_report(self) -> PlanOnBoard:
        """Return what is to be said of the plan on board, by whatever link."""
        return self._plan.on_board()

    def take_mission(self, mission: Mission, *, start: bool, may_wait: bool = False) -> str:
        """Put a mission on board that came complete by another link than the radio.

        The mission that is on board already, waiting or being flown, is left as it is.

        Args:
            mission: What replaces the plan on board.
            start: Whether to fly it at once, or at the next surfacing where it waits.
            may_wait: Whether it may wait behind a plan that is flown.

        Returns:
            Why it was refused, a sentence; empty if it is on board (and flown, where asked).
        """
        return self._plan.take_mission(mission, start=start, may_wait=may_wait)

    def take_command(self, command: ReceivedCommand) -> CommandOutcome:
        """Act on a command that came by another link; one heard by several links acts once."""
        return self._commands.take(command, monotonic_s())

    async def run(self) -> None:
        """Serve until cancelled."""
        async with asyncio.TaskGroup() as group:
            for name, work in (
                ("radio", self._transport.run()),
                ("listen", self._listen()),
                ("heartbeat", self._beat()),
                ("states", self._states.run()),
                ("targets", self._targets.run()),
                ("currents", self._currents.run()),
                ("actuators", self._actuators.run()),
                ("receivers", self._receivers.run()),
                ("health", self._health.run()),
                ("answers to the stick", self._driven.run()),
                ("channels", self.channels.run()),
                ("plan reports", self._report_plan()),
                ("samples", self._samples.run()),
                ("replies", self._reply()),
                ("mission", self._ask_again()),
                ("operator control", self._operators.run()),
                ("services", self._services.run(self._budget, self._send_service)),
            ):
                group.create_task(work, name=f"system {self._system} {name}")

    def set_mode(self, mode: RobotMode) -> None:
        """Say what the robot does now; a change is sent at once, and then in each heartbeat.

        Announce a dive before the antenna goes under: silence after it counts as submerged.
        """
        if mode is not self._mode:
            self._mode = mode
            self._mode_changed.set()

    def report_state(self, state: StateReport) -> None:
        """Send a state once; while the radio is busy a newer one replaces it.

        ``robot`` and ``received_at`` do not travel.
        """
        self._services.state = state
        self._states.put(partial(telemetry.state_message, state))

    def report_target(self, report: TargetReport) -> None:
        """Send what is known of a target once; while the radio is busy a newer one replaces it.

        ``robot`` and ``received_at`` do not travel. A report that says what cannot be, such as a
        number that is not finite, is dropped: the far side could only drop it too.
        """
        if target.can_travel(report):
            self._targets.put(partial(target.target_message, report))

    def report_actuators(self, report: ActuatorReport) -> None:
        """Send how the actuators follow once, as ``report_target`` sends a target."""
        if not actuator_fault(report):
            self._actuators.put(partial(actuator.actuator_message, report))

    def report_receiver(self, report: ReceiverReport) -> None:
        """Send how the tag receiver fares once, as ``report_target`` sends a target."""
        if not receiver_fault(report):
            self._receivers.put(partial(detection.receiver_message, report))

    def say(self, text: str) -> None:
        """Say a sentence to the station, where one is known; what has no room is dropped."""
        if self._station is not None:
            for message in status_texts(text):
                self._answer(None, message)

    def report_health(self, values: Mapping[str, float], measured_at: datetime) -> None:
        """Send readings of the robot's own condition once; a newer report replaces a waiting one.

        Those that have no room in a packet of the radio are left out, the last ones first.

        Raises:
            KeyError: If a channel is not declared.
        """
        most = several.at_once(self._transport.max_payload - self._codec.trailer_bytes)
        message = several.health_message(dict(islice(values.items(), most)), measured_at)
        if message.count:
            self._health.put(lambda: message)

    def announce(self, table: ChannelTable) -> None:
        """Say what is measured from the next sample on; the same again changes nothing."""
        self.channels.announce(table)

    def report_current(self, report: CurrentReport) -> None:
        """Send what is believed of the current once, as ``report_target`` sends a target."""
        if current.can_travel(report):
            self._currents.put(partial(current.current_message, report))

    def record_sample(
        self,
        variable: str,
        value: float,
        position_ned: PositionNed,
        position_std_m: float,
        measured_at: datetime,
    ) -> int:
        """Keep a sample until it is stored ashore, and send it when the station is in reach.

        Returns:
            Its number in the log.

        Raises:
            ValueError: If a number is not finite.
            KeyError: If no such variable is declared.
        """
        return self._samples.record(
            Measurement(variable, value, position_ned, position_std_m, measured_at)
        )

    def record_detection(self, heard: HeardTag) -> int:
        """Keep a heard tag until it is stored ashore, and send it as a sample is sent.

        Returns:
            Its number in the log.

        Raises:
            ValueError: If it says what cannot be.
        """
        return self._samples.record(heard)

    def report_plan(
        self, state: OnboardPlanState, *, leg: int = 0, energy_used: float = 0.0, reason: str = ""
    ) -> None:
        """Say how the plan on board fares; sent at once, and again every few seconds."""
        self._plan.report(state, leg=leg, energy_used=energy_used, reason=reason)

    async def _listen(self) -> None:
        async for event in self._transport.events():
            if isinstance(event, Received):
                self._receive(event)

    def _receive(self, received: Received) -> None:
        messages, bad = self._codec.unpack(received.data)
        self.frames_bad += bad
        is_far_end = False
        for message in messages:
            if not self._is_welcome(message, received.address):
                self.frames_bad += 1
            elif not is_far_end and not (is_far_end := received.accept(_MAY_MOVE)):
                return
            elif isinstance(message, _CameraFix) and message.target_system != self._system:
                # a place is of one robot: here 0 does not mean everybody
                self._program.refuse_fix(f"the fix is for system {message.target_system}")
            elif getattr(message, "target_system", _ANYONE) in (_ANYONE, self._system):
                self._obey(message, received.address)

    def _is_welcome(self, message: WireMessage, address: Address) -> bool:
        """Tell whether a message is to be believed: signed where it must be, of a known master."""
        if self._signing is not None:
            verdict = self._signing.check(bytes(message.get_msgbuf()))
            if verdict is not Verdict.GOOD:
                return False
        speaker = message.get_srcSystem()
        if speaker == self._system:
            if self._duplicates.note(self._system, address, monotonic_s()):
                _log.warning("%s", self.conflict)
            return False
        if speaker == STATION_SYSTEM:
            return self._is_from_station(address)
        return self._services.welcomes(message, address)

    def _is_from_station(self, address: Address) -> bool:
        """Hold to one station's radio; another may take over when it has been silent long."""
        now_s = monotonic_s()
        is_free = self._station is None or now_s - self._station_heard_s > self._patience_s
        if address != self._station and not is_free:
            return False
        if address != self._station or now_s - self._station_heard_s > self._timing.stale_s:
            self.channels.remind()
        self._station, self._station_heard_s = address, now_s
        self._station_known.set()
        self._samples.contact(address)
        return True

    def _obey(self, message: WireMessage, address: Address) -> None:
        now_s = monotonic_s()
        is_station = message.get_srcSystem() == STATION_SYSTEM
        match message:
            case _Command():
                self._take_command(message, address, now_s)
            case grace.MAVLink_grace_plan_offer_message() if is_station:
                self._plan.take_offer(message, now_s)
            case grace.MAVLink_mission_count_message() if is_station and self._plan.expects(
                message
            ):
                self._plan.take_count(message, now_s)
            case grace.MAVLink_mission_item_int_message() if is_station and self._plan.expects(
                message
            ):
                self._plan.take_item(message, now_s)
            case grace.MAVLink_grace_sample_ack_message() if is_station:
                sequences = telemetry.acknowledged_sequences(message)
                self._samples.stored(LogId(message.log), sequences)
            case grace.MAVLink_heartbeat_message() if is_station:
                return
            case _CameraFix() if is_station:
                self._take_fix(message)
            case _MotionCapture() if is_station or not self._operators.refusal(
                SystemId(message.get_srcSystem())
            ):
                self._take_fix(message)
            case grace.MAVLink_manual_control_message():
                try:
                    self._drive.hear(message, driver_of(message, address))
                except ValueError:
                    self.frames_bad += 1
            case _:
                self._services.hear(message, address)

    def _take_fix(self, message: FixMessage) -> None:
        try:
            fix = received_fix(message)
        except ValueError as error:
            self._program.refuse_fix(str(error))
        else:
            self._program.hear_fix(fix)

    def _take_command(self, message: _Command, address: Address, now_s: float) -> None:
        try:
            command = received_command(message)
        except ValueError:
            self.frames_bad += 1
            return
        if command is None:
            self._services.hear(message, address)
            return
        outcome = CommandOutcome.NOT_NOW
        is_up = command.kind is CommandKind.SURFACE
        if is_up or not self._operators.refusal(SystemId(message.get_srcSystem())):
            outcome = self._commands.take(command, now_s)
        self._answer(
            address,
            grace.MAVLink_command_ack_message(
                command=message.command,
                result=result_of(outcome),
                progress=0,
                result_param2=command.number,
                target_system=message.get_srcSystem(),
                target_component=message.get_srcComponent(),
            ),
        )

    def _guests(self) -> Mapping[Asker, Address]:
        return self._services.guests()

    def _answer(self, address: Address | None, message: WireMessage) -> None:
        """Queue an answer to a radio, the station's where it is None; too many are dropped."""
        with suppress(asyncio.QueueFull):
            self._replies.put_nowait((address, message))

    async def _ask_again(self) -> None:
        while True:
            await asyncio.sleep(self._timing.answer_s / 4)
            self._plan.tick(monotonic_s())

    async def _reply(self) -> None:
        while True:
            address, message = await self._replies.get()
            await self._send(message, _ATTEMPTS, address)

    def _newest_sender(self, frame_bytes: int) -> NewestSender:
        async def wait_for_room() -> None:
            await self._station_known.wait()
            await self._pace.spend(frame_bytes + self._codec.trailer_bytes)

        return NewestSender(wait_for_room, lambda message: self._send(message, 1))

    async def _send_page(self, page: WireMessage) -> None:
        await self._station_known.wait()
        frame = self._codec.pack(page)
        await self._pace.spend(len(frame))
        await deliver(self._transport, self._station or BROADCAST, frame, attempts=_ATTEMPTS)

    async def _report_plan(self) -> None:
        await self._station_known.wait()
        while True:
            self._plan.changed.clear()
            queue, said = self._plan.queue.due(self._plan.plan_hash), self._plan.said
            if queue is not None:
                await self._send(queue, _ATTEMPTS)  # first: it tells how the plan before ended
            await self._send(said, _ATTEMPTS)  # of the same moment
            await set_or_after(self._plan.changed, self._timing.plan_report_s)

    async def _beat(self) -> None:
        while True:
            self._mode_changed.clear()
            heartbeat = robot_heartbeat(self._mode)
            await self._send(heartbeat, _ATTEMPTS)
            guests = self._services.guests().values() if self._station is not None else ()
            for address in guests:
                if address != self._station:
                    await self._send(heartbeat, 1, address)
            await set_or_after(self._mode_changed, self._timing.heartbeat_s)

    def _budget(self) -> float:
        """Return what standard telemetry may take of the radio, bytes per second."""
        return self._transport.bytes_per_s * _STREAM_SHARE

    async def _send_service(self, address: Address, message: WireMessage) -> None:
        await self._send(message, 1, address)

    async def _send(
        self, message: WireMessage, attempts: int, address: Address | None = None
    ) -> None:
        if address is None:
            address = BROADCAST if self._station is None else self._station
        await deliver(self._transport, address, self._codec.pack(message), attempts=attempts)
