"""Opening a link by itself and saying in plain words what it hears."""

import asyncio
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final
from urllib.parse import parse_qsl, urlencode, urlsplit

from robot_link.clock import monotonic_s
from robot_link.mavlink.codec import STATION_COMPONENT, STATION_SYSTEM, Codec, WireMessage
from robot_link.mavlink.frame import INCOMPATIBLE, SIGNED
from robot_link.mavlink.wire import grace
from robot_link.service.heartbeat import station_heartbeat
from robot_link.transport.advice import (
    Advice,
    byte_advice,
    envelope_advice,
    port_advice,
    silence_advice,
)
from robot_link.transport.datagram import (
    BROADCAST,
    FAR_END,
    DatagramTransport,
    Garbled,
    PortChanged,
    PortClosedError,
    Received,
    Stranger,
)
from robot_link.transport.opening import open_transport
from robot_link.transport.udp import UdpTransport
from robot_link.transport.uri import LinkUri
from robot_link.transport.xbee import XBeeTransport

_BEAT_S: Final = 1.0
_LOOK_S: Final = 0.05
"""Time between two looks whether the port is open."""
_UNDECIDED_S: Final = 6.0
"""After so long a connection is given up, and it is plain that no XBee answers."""
_TRIAL_S: Final = 2.0
"""How long to listen at each other speed."""
_MOMENT_S: Final = 0.5
"""A brief look goes on for so long after a robot is known: others may speak, too."""
_KEPT_BYTES: Final = 4096
_MESSAGES_SHOWN: Final = 6

_MUTE_ROBOT: Final = Advice(
    "The radios reach each other, but no robot says anything.",
    (
        "Is the robot's own program running?",
        "Its radio must be in API mode, and its program must call by broadcast.",
    ),
)


SPEEDS: Final = (57600, 115200, 9600, 38400, 19200, 230400, 460800, 921600)
"""Baud, the likeliest first."""


async def find_speed(uri: str, listen_s: float) -> int | None:
    """Return the speed at which a serial line brings valid frames, None if none does.

    Args:
        uri: A ``serial`` or ``xbee`` link on a serial line; its own speed is not tried again.
        listen_s: How long to listen at each speed, s.
    """
    parts = urlsplit(uri)
    options = dict(parse_qsl(parts.query, keep_blank_values=True))
    for speed in SPEEDS:
        if str(speed) == options.get("baud"):
            continue
        query = urlencode({**options, "baud": speed})
        transport = open_transport(parts._replace(query=query).geturl())
        if await _makes_sense(transport, listen_s):
            return speed
    return None


async def _makes_sense(transport: DatagramTransport, listen_s: float) -> bool:
    """Tell whether a frame comes, or an XBee answers."""
    running = asyncio.create_task(transport.run(), name="speed trial")
    try:
        async with asyncio.timeout(listen_s):
            async for event in transport.events():
                match event:
                    case Received():
                        return True
                    case PortChanged(is_open=True) if transport.carrier == "xbee":
                        return True
                    case _:
                        pass
    except TimeoutError:
        pass
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
    return False


@dataclass(slots=True)
class Hearing:
    """What came while the doctor listened."""

    was_open: bool = False
    closed_reason: str = ""
    """Why the port closed or did not open, the last time."""
    frames: Counter[tuple[int, int]] = field(default_factory=Counter[tuple[int, int]])
    """Valid frames by system id and radio."""
    signed: Counter[tuple[int, bool]] = field(default_factory=Counter[tuple[int, bool]])
    """Valid frames by system id and whether they are signed; with whose key is not known."""
    messages: Counter[str] = field(default_factory=Counter[str])
    strength_dbm: dict[int, float] = field(default_factory=dict[int, float])
    """Last strength by radio."""
    strangers: dict[str, set[int]] = field(default_factory=dict[str, set[int]])
    """Systems that spoke from elsewhere than the far end."""
    heard_s: dict[int, float] = field(default_factory=dict[int, float])
    """When each system was heard last, by the monotonic clock."""
    kinds: dict[int, tuple[int, int]] = field(default_factory=dict[int, tuple[int, int]])
    """Autopilot and type that each system's heartbeat names."""
    ours: set[int] = field(default_factory=set[int])
    """Systems that speak this project's dialect."""
    neighbours: int = 0
    """Other radios of the network that answered."""
    bad: int = 0
    strange: bytes = b""
    """The first bytes that were no frame."""


class Doctor:
    """Examines one link; ``say`` takes each finding as it is made."""

    def __init__(self, uri: str, say: Callable[[str], None], *, is_brief: bool = False) -> None:
        """Take a link.

        Args:
            uri: The link.
            say: Takes each finding.
            is_brief: End soon after a robot is known, and ask who else is in the radio's network
                only where nothing is heard: answers take seconds.

        Raises:
            ValueError: If the URI names no transport.
        """
        self._text = uri
        self._uri = LinkUri(uri)
        self._transport = open_transport(uri)
        self._waits = self._uri.scheme in ("tcp", "udp") and self._uri.switch("listen")
        """Whether the far end has to call, which nobody knows when it does."""
        self._say = say
        self._codec = Codec(STATION_SYSTEM, STATION_COMPONENT)
        self._heard = Hearing()
        self._is_brief = is_brief

    @property
    def heard(self) -> Hearing:
        """What came so far."""
        return self._heard

    async def examine(self, listen_s: float) -> bool:
        """Open, listen and tell.

        Args:
            listen_s: How long to listen at most, s.

        Returns:
            Whether a robot was heard without anything that needs to be put right.
        """
        tasks = [
            asyncio.create_task(self._transport.run(), name="doctor's port"),
            asyncio.create_task(self._listen(), name="doctor's ear"),
            asyncio.create_task(self._beat(), name="doctor's call"),
        ]
        if self._is_brief:
            tasks.append(asyncio.create_task(self._until_known(), name="doctor's patience"))
        try:
            await asyncio.wait(tasks, timeout=listen_s, return_when=asyncio.FIRST_COMPLETED)
            with suppress(TimeoutError):
                async with asyncio.timeout(_UNDECIDED_S):
                    while self._is_undecided():  # noqa: ASYNC110 - several things may decide it
                        await asyncio.sleep(_LOOK_S)
            for task in tasks:
                if task.done():
                    task.result()
            await self._tell_port(listen_s + _UNDECIDED_S)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        is_well = self._heard.was_open and self._tell_frames()
        if self._may_be_too_fast():
            await self._try_speeds(min(listen_s, _TRIAL_S))
        return is_well

    async def _until_known(self) -> None:
        """Wait until a robot has said what it is, and a moment longer."""
        heard = self._heard
        while not (heard.ours | heard.kinds.keys()) - {STATION_SYSTEM}:  # noqa: ASYNC110
            await asyncio.sleep(_LOOK_S)
        await asyncio.sleep(_MOMENT_S)

    async def _listen(self) -> None:
        heard = self._heard
        async for event in self._transport.events():
            match event:
                case PortChanged(is_open=True):
                    heard.was_open = True
                case PortChanged(reason=reason):
                    heard.closed_reason = reason
                case Garbled(frames, data):
                    self._note_bad(frames, data)
                case Stranger(where=where, data=data):
                    systems = {one.get_srcSystem() for one in self._codec.unpack(data).messages}
                    heard.strangers.setdefault(where, set()).update(systems)
                case Received():
                    self._note(event)

    def _note(self, received: Received) -> None:
        messages, bad = self._codec.unpack(received.data)
        if messages and not received.accept(False):
            return
        if bad:
            self._note_bad(bad, b"" if messages else received.data)
        for message in messages:
            self._heard.frames[message.get_srcSystem(), received.address] += 1
            self._heard.messages[message.get_type()] += 1
            self._note_system(message)
            is_signed = bool(message.get_msgbuf()[INCOMPATIBLE] & SIGNED)
            self._heard.signed[message.get_srcSystem(), is_signed] += 1
        if received.rssi_dbm is not None:
            self._heard.strength_dbm[received.address] = received.rssi_dbm

    def _note_system(self, message: WireMessage) -> None:
        heard, system = self._heard, message.get_srcSystem()
        heard.heard_s[system] = monotonic_s()
        if message.get_type().startswith("GRACE_"):
            heard.ours.add(system)
        if isinstance(message, grace.MAVLink_heartbeat_message):
            heard.kinds[system] = (message.autopilot, message.type)

    def _note_bad(self, count: int, data: bytes) -> None:
        heard = self._heard
        heard.bad += count
        heard.strange += data[: max(0, _KEPT_BYTES - len(heard.strange))]

    async def _beat(self) -> None:
        """Say that a ground station is there: many vehicles answer only then."""
        while True:
            if self._transport.max_payload:
                with suppress(PortClosedError):
                    await self._transport.send(BROADCAST, self._codec.pack(station_heartbeat()))
                await asyncio.sleep(_BEAT_S)
            else:
                await asyncio.sleep(_LOOK_S)

    async def _tell_port(self, waited_s: float) -> None:
        """Say whether the port opened, and what the radio at it says of itself."""
        heard = self._heard
        if not heard.was_open:
            if heard.strange:
                self._advise(byte_advice(self._uri, heard.strange))
            elif "no XBee" in heard.closed_reason:
                self._advise(_mute_radio(heard.closed_reason))
            elif heard.closed_reason:
                self._advise(port_advice(self._uri, heard.closed_reason))
            else:
                silence = _nobody_called(self._uri) if self._waits else _no_word(waited_s)
                self._advise(silence)
            return
        self._say("The port is open.")
        if heard.closed_reason:
            self._say(f"It closed meanwhile: {heard.closed_reason}.")
        if isinstance(self._transport, XBeeTransport):
            await self._tell_radio(self._transport)

    async def _tell_radio(self, radio: XBeeTransport) -> None:
        if radio.address is None:
            return
        self._say(
            f"The XBee {radio.address:016X} answers; one packet carries {radio.max_payload} bytes,"
            f" and {radio.bytes_per_s:g} bytes per second of telemetry suit its rate in the air."
        )
        if self._is_brief and self._heard.frames:
            return
        try:
            neighbours = await radio.discover()
        except PortClosedError as error:
            self._say(f"It could not ask who else is in its network: {error}.")
            return
        if not neighbours:
            self._say("No other radio of its network answers.")
        self._heard.neighbours = len(neighbours)
        for one in neighbours:
            strength = "" if one.rssi_dbm is None else f" at {one.rssi_dbm:g} dBm"
            self._say(f"The radio {one.address:016X} ({one.node_id}) answers{strength}.")

    def _tell_frames(self) -> bool:
        """Say what was heard; return whether it is as it should be."""
        heard = self._heard
        for (system, address), count in sorted(heard.frames.items()):
            strength = heard.strength_dbm.get(address)
            whence = "" if address == FAR_END else f" from the radio {address:016X}"
            level = "" if strength is None else f" at {strength:g} dBm"
            self._say(f"System {system} is heard{whence}{level}: {count} valid frames.")
        if heard.messages:
            common = heard.messages.most_common(_MESSAGES_SHOWN)
            self._say("It says " + ", ".join(f"{name} {count}x" for name, count in common) + ".")
        is_well = all((self._tell_signatures(), self._tell_conflicts()))
        if heard.bad:
            self._say(f"{heard.bad} stretches of bytes were no valid frame.")
        if heard.frames:
            envelope = envelope_advice(self._uri, heard.strange)
            if envelope is not None:
                self._advise(envelope)
            return is_well and envelope is None
        if heard.strange:
            self._advise(byte_advice(self._uri, heard.strange))
        elif heard.neighbours:
            self._advise(_MUTE_ROBOT)
        else:
            self._advise(silence_advice(self._uri))
        trouble = self._transport.trouble if isinstance(self._transport, UdpTransport) else ""
        if trouble:
            self._say(f"The network says of what was sent: {trouble}.")
        return False

    def _tell_signatures(self) -> bool:
        """Say who signs; return whether nobody does one thing and the other."""
        signed = self._heard.signed
        both: list[int] = []
        for system in sorted({system for system, _ in signed}):
            if signed[system, True] and signed[system, False]:
                both.append(system)
            elif signed[system, True]:
                self._say(
                    f"System {system} signs its frames: it answers and obeys only who has its key,"
                    " which the doctor has not."
                )
            else:
                self._say(
                    f"System {system} does not sign its frames: whoever has such a radio can pose"
                    " as it, or give it orders."
                )
        for system in both:
            self._advise(
                Advice(
                    f"Frames of system {system} come signed and unsigned: somebody without its key"
                    " speaks as it, too.",
                    ("Find the second one; the station does not obey it.",),
                )
            )
        return not both

    def _is_undecided(self) -> bool:
        """Tell whether it is not yet plain if the port opens, or if an XBee is there."""
        heard = self._heard
        said_anything = heard.was_open or heard.closed_reason or heard.strange
        return not self._waits and not said_anything

    def _may_be_too_fast(self) -> bool:
        """Tell whether bytes, or no XBee, at a serial line leave its speed in doubt."""
        heard = self._heard
        is_line = self._uri.scheme in ("serial", "xbee") and not self._uri.host
        is_mute = "no XBee" in heard.closed_reason
        is_plain = envelope_advice(self._uri, heard.strange) is not None
        is_doubtful = bool(heard.strange) or is_mute
        return is_line and is_doubtful and not heard.frames and not is_plain

    async def _try_speeds(self, listen_s: float) -> None:
        self._say("Trying other speeds ...")
        speed = await find_speed(self._text, listen_s)
        if speed is None:
            self._say("At no usual speed does anything come that makes sense.")
        else:
            self._say(f"At {speed} baud it makes sense: write baud={speed} in the link.")

    def _tell_conflicts(self) -> bool:
        radios: dict[int, set[int]] = {}
        for system, address in self._heard.frames:
            radios.setdefault(system, set()).add(address)
        conflicts = {system: found for system, found in radios.items() if len(found) > 1}
        for system, found in conflicts.items():
            names = " and ".join(f"{address:016X}" for address in sorted(found))
            self._advise(
                Advice(
                    f"Radios {names} both speak as system {system}.",
                    ("Give one of the robots another MAVLink system id.",),
                )
            )
        for where, systems in self._heard.strangers.items():
            also = ", ".join(str(system) for system in sorted(systems)) or "nobody known"
            self._advise(
                Advice(
                    f"Somebody else speaks to this port, from {where}, as system {also}.",
                    ("Give each robot a port of its own.",),
                )
            )
        if STATION_SYSTEM in radios:
            self._say("Another ground station speaks on this link.")
        return not conflicts and not self._heard.strangers

    def _advise(self, advice: Advice) -> None:
        self._say(advice.found)
        for one in advice.tries:
            self._say(f"  Try: {one}")


def _mute_radio(reason: str) -> Advice:
    return Advice(
        f"The port opens, but {reason}.",
        (
            "Write ap=2 in the link if the radio's AP parameter is 2.",
            "Set AP to 1 (with Digi's XCTU, say) if it is 0: transparent mode answers nothing.",
            "Write the radio's speed in the link, such as baud=9600, a new XBee's.",
        ),
    )


def _no_word(waited_s: float) -> Advice:
    return Advice(
        f"The port neither opened nor refused within {waited_s:.1f} s.",
        ("Pull the radio's adapter out and plug it in again; its driver may hang.",),
    )


def _nobody_called(uri: LinkUri) -> Advice:
    return Advice(
        f"Nobody called at port {uri.port}.",
        ("Start the far end and let it connect to this machine's address and this port.",),
    )
