"""What radios bring to the station: journaled, attributed to a robot, decoded, passed on."""

import asyncio
from collections.abc import Callable
from datetime import datetime

from robot_link.channel_table import ChannelPage
from robot_link.clock import Clock
from robot_link.mavlink.codec import Codec, WireMessage
from robot_link.mavlink.decode import Value, decoded, robot_time
from robot_link.mavlink.operator_control import told
from robot_link.mavlink.wire import grace
from robot_link.messages import (
    OnboardPlanState,
    PlanQueue,
    PlanReport,
    RawFrame,
    RobotMode,
    Sample,
    StateReport,
)
from robot_link.report import (
    ActuatorReport,
    ControlAsked,
    ControlReport,
    CurrentReport,
    Detection,
    LinkEvent,
    Reading,
    ReceiverReport,
    TargetReport,
    VehicleWord,
)
from robot_link.station.link_watch import LinkWatch
from robot_link.station.roster import Member, Roster
from robot_link.station.sample_gate import SampleGate
from robot_link.transport.datagram import (
    DatagramTransport,
    Garbled,
    PortChanged,
    Received,
    Stranger,
)

_OF_OFFERS = (OnboardPlanState.RECEIVING, OnboardPlanState.REFUSED, OnboardPlanState.WAITING)
"""Answers to offers, which say nothing of the plan on board."""


class Reception:
    """Belongs to one event loop.

    Args:
        roster: The robots.
        codec: Decodes frames.
        watch: Told when a link may have changed.
        samples: What is stored already.
        samples_owed: Set when a robot must hear again that a sample is stored.
        clock: The station's clock.
        on_event: Called with everything that is learned, in order.
    """

    def __init__(
        self,
        roster: Roster,
        codec: Codec,
        watch: LinkWatch,
        samples: SampleGate,
        samples_owed: asyncio.Event,
        clock: Clock,
        on_event: Callable[[LinkEvent], None],
    ) -> None:
        self._roster = roster
        self._codec = codec
        self._watch = watch
        self._samples = samples
        self._samples_owed = samples_owed
        self._clock = clock
        self._on_event = on_event

    async def listen(self, transport: DatagramTransport) -> None:
        """Take what one radio brings until cancelled."""
        async for event in transport.events():
            match event:
                case Received():
                    self._receive(transport, event)
                case PortChanged():
                    self._watch.tell_all_changes()
                case Stranger(data=data):
                    self._roster.note_stranger(transport, event, self._codec.unpack(data).messages)
                case Garbled(frames, data):
                    self._roster.count_bad(transport, None, frames)
                    at = self._clock.now()
                    self._on_event(RawFrame(None, transport.carrier, False, data, at))

    def _receive(self, transport: DatagramTransport, received: Received) -> None:
        at = self._clock.now()
        messages, bad = self._codec.unpack(received.data)
        sender, own = self._roster.attributed(transport, received, messages)
        if sender is not None and own and not received.accept(sender.signing is not None):
            sender, own = None, []
        is_believed = bool(own) or not messages
        self._on_event(
            RawFrame(
                robot=sender.robot if sender is not None and is_believed else None,
                carrier=transport.carrier,
                outgoing=False,
                data=received.data,
                at=at,
                robot_at=robot_time(messages),
            )
        )
        if bad and sender is not None and sender.vehicle is not None:
            bad = max(0, bad - self._codec.unknown(received.data))
        dropped = bad + len(messages) - len(own)
        self._roster.count_bad(transport, sender, dropped if sender else max(1, dropped))
        if sender is not None and own:
            understood = [one for message in own if (one := _read(message, sender, at)) is not None]
            sender.peer.count_bad(transport, len(own) - len(understood))
            if understood:
                sender.peer.heard(transport, received, len(understood))
                self._watch.tell_changes(sender)
                for message, value in understood:
                    self._interpret(sender, message, value, at)
                sender.lane.contact()

    def _interpret(self, sender: Member, message: WireMessage, value: Value, at: datetime) -> None:
        sender.services.hear(message)
        if (control := _of_control(message, sender, at)) is not None:
            self._on_event(control)
        match message:
            case grace.MAVLink_command_ack_message():
                sender.lane.answered(message)
            case grace.MAVLink_mission_request_int_message():
                if sender.upload is not None:
                    sender.upload.hear(message)
            case grace.MAVLink_statustext_message() if sender.vehicle is None:
                for severity, text, when in sender.texts.hear(message, at):
                    self._on_event(VehicleWord(sender.robot, severity, text, when))
            case _ if sender.vehicle is not None:
                for event in sender.vehicle.hear(message, at):
                    self._on_event(event)
            case _:
                self._take(sender, value)

    def _take(self, sender: Member, value: Value) -> None:
        match value:
            case RobotMode():
                sender.peer.mode = value
            case StateReport():
                sender.peer.mode = value.mode
                sender.services.clock.note_frame(value.measured_at, value.received_at)
                self._on_event(value)
            case tuple():
                for one in value:
                    self._take(sender, one)
            case Reading() | ChannelPage():
                self._on_event(value)
            case Sample() | Detection():
                if self._samples.admit(value):
                    self._on_event(value)
                else:
                    self._samples_owed.set()
            case PlanReport():
                self._take_plan_report(sender, value)
            case (
                PlanQueue() | TargetReport() | CurrentReport() | ActuatorReport() | ReceiverReport()
            ):
                self._on_event(value)
            case None:
                pass

    def _take_plan_report(self, sender: Member, report: PlanReport) -> None:
        """Tell what is on board; the fate of an offer is its upload's business alone."""
        if sender.upload is not None:
            sender.upload.hear(report)
        if report.state not in _OF_OFFERS:
            self._on_event(report)


def _read(message: WireMessage, sender: Member, at: datetime) -> tuple[WireMessage, Value] | None:
    """Return a message with what it tells; ``None`` for one that cannot be understood."""
    if sender.vehicle is not None:
        return message, None
    try:
        return message, decoded(message, sender.robot, at)
    except ValueError:
        return None


def _of_control(
    message: WireMessage, sender: Member, at: datetime
) -> ControlReport | ControlAsked | None:
    """Return what a robot says of who controls it; ``None`` for anything else, and for nonsense."""
    try:
        return told(message, sender.robot, at)
    except ValueError:
        return None
