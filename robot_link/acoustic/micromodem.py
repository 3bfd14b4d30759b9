"""A WHOI Micro-Modem and the robots that it speaks with: ranges, mini packets, transponders.

The water carries one question at a time: a ping waits until the one before is answered or given
up. An answer is taken for the question's if it names the same two modems, in either order, for
drivers and firmware disagree on which comes first. It carries no number. So after a question that
was given up it is quiet for a while, and an answer from farther away than sound has come since the
question is the one that was given up. What passes on the line is in
``robot_link.acoustic.modem_line``.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from robot_link.acoustic import sentence
from robot_link.acoustic.config import AcousticConfig
from robot_link.acoustic.measurement import BeaconMeasurement, MiniReceived, RangeMeasurement
from robot_link.acoustic.modem_line import (
    ModemLine,
    ModemRefusedError,
    ModemTiming,
    forget,
    refused,
)
from robot_link.acoustic.sentence import (
    BeaconReply,
    Fields,
    Heard,
    MiniHeard,
    ModemError,
    ModemStarted,
    PacketGarbled,
    PingReply,
)
from robot_link.clock import Clock, monotonic_s, set_or_after
from robot_link.messages import RobotId
from robot_link.station.gateway.address import AcousticAddress, acoustic_address
from robot_link.transport.datagram import PortClosedError, TransportEvent
from robot_link.transport.port import Port, SerialPort, TcpPort

Reply = TypeVar("Reply", PingReply, BeaconReply)

_EARLY_S = 0.1
"""What a measured travel time, there and back, may be too long; an echo's is."""


@dataclass(slots=True)
class _GivenUp:
    """Questions to one modem whose answers may still come."""

    count: int = 0
    since_s: float = 0.0
    """When the newest was given up."""


def _ignore(message: MiniReceived) -> None:
    del message


class MicroModem:
    """One modem at the station, and the robots that it can speak with.

    Belongs to one event loop. ``run`` opens the port and opens it again until cancelled.

    Args:
        open_port: Opens the modem's port.
        us: The modem's own address, 0..15.
        robots: Who has the modem of which address.
        clock: Tells when an answer came.
        config: Speed of sound and longest range.
        timing: Time-outs on the line.
        on_mini: Takes the mini packets that come in.
    """

    carrier = "micromodem"

    def __init__(
        self,
        open_port: Callable[[], Awaitable[Port]],
        us: int,
        robots: Mapping[int, RobotId],
        clock: Clock,
        config: AcousticConfig | None = None,
        timing: ModemTiming | None = None,
        on_mini: Callable[[MiniReceived], None] = _ignore,
    ) -> None:
        self._us = us
        self._robots = dict(robots)
        self._clock = clock
        self.config = config or AcousticConfig()
        """May be replaced at any time; the next ping uses it."""
        self._on_mini = on_mini
        self._timing = timing or ModemTiming()
        self._line = ModemLine(open_port, us, clock, self._timing, self._hear, self._closed)
        self._measuring = asyncio.Lock()
        self._awaited: asyncio.Future[Heard] | None = None
        self._awaited_pair: frozenset[int] | None = None
        self._asked_s = 0.0
        self._was_garbled = False
        self._given_up: dict[frozenset[int] | None, _GivenUp] = {}
        self._came_late = asyncio.Event()
        self.answers_late = 0
        """Answers that came when they had been given up; no range is made of them."""

    @property
    def robots(self) -> Mapping[int, RobotId]:
        """Who has the modem of which address."""
        return self._robots

    @property
    def is_ready(self) -> bool:
        """Whether the modem is there and knows its settings."""
        return self._line.is_ready

    @property
    def is_mute(self) -> bool:
        """Whether the port could be opened, but no modem answers at its end."""
        return self._line.is_mute

    @property
    def is_enabled(self) -> bool:
        """Whether the operator lets the port be open."""
        return self._line.is_enabled

    def set_enabled(self, is_enabled: bool) -> None:
        """Enable the port, or disable it, which closes it."""
        self._line.set_enabled(is_enabled)

    async def run(self) -> None:
        """Open, serve and open again until cancelled."""
        await self._line.run()

    def events(self) -> AsyncIterator[TransportEvent]:
        """Yield openings, closings and garbled lines, in order, until cancelled; for one reader."""
        return self._line.events()

    async def ping(self, peer: int) -> RangeMeasurement:
        """Measure the range to a robot's modem; silence is a measurement too, though not valid.

        Raises:
            ValueError: If nobody has the modem of this address.
        """
        robot = self._robot(peer)
        async with self._measuring:
            config = self.config
            pair = frozenset((self._us, peer))
            fields = sentence.ping(self._us, peer)
            reply, reason = await self._measured(fields, pair, PingReply)
        now = self._clock.now()
        if reply is None:
            return RangeMeasurement(robot, peer, None, None, now, is_valid=False, reason=reason)
        travel_s = reply.travel_time_s
        if not 0 < travel_s < config.answer_s:
            reason = f"a travel time of {travel_s:g} s cannot be"
        return RangeMeasurement(
            robot,
            peer,
            travel_s,
            travel_s * config.sound_speed_m_s,
            now,
            is_valid=not reason,
            reason=reason,
        )

    async def ping_remus(
        self, channel: int, wanted: Sequence[bool] = (True,) * sentence.BEACONS
    ) -> BeaconMeasurement:
        """Measure the ranges to up to four REMUS transponders.

        Raises:
            ValueError: If the channel is not 1 to 4, or not four transponders are named.
        """
        return await self._ping_beacons(sentence.ping_remus(channel, self._listen_s, wanted))

    async def ping_narrow_band(
        self, transmit_hz: int, transmit_ms: int, receive_ms: int, reply_hz: Sequence[int]
    ) -> BeaconMeasurement:
        """Measure the ranges to up to four narrow-band transponders.

        Args:
            transmit_hz: Frequency of the ping, Hz.
            transmit_ms: Its length, ms.
            receive_ms: Length of the replies, ms.
            reply_hz: Frequency of each of the four replies, Hz; 0 for one that is not wanted.

        Raises:
            ValueError: If not four transponders are named.
        """
        return await self._ping_beacons(
            sentence.ping_narrow_band(
                transmit_hz, transmit_ms, receive_ms, self._listen_s, reply_hz
            )
        )

    async def mini(self, peer: int, word: int) -> None:
        """Send a word of 13 bits to a robot's modem; nothing tells whether it arrives.

        Raises:
            ValueError: If no robot has the modem of this address, or the word is longer.
            ModemRefusedError: If the modem does not do it.
            PortClosedError: If no port is open.
        """
        self._robot(peer)
        fields = sentence.mini(self._us, peer, word)
        async with self._measuring:
            await self._line.tell(fields)

    @property
    def _listen_s(self) -> float:
        """How long the modem itself listens for transponders, by its own clock."""
        return self.config.travel_s

    @property
    def _wait_s(self) -> float:
        """How long an answer is waited for, of the wall."""
        return self.config.travel_s / self._clock.speed + self._timing.spare_s

    def _robot(self, peer: int) -> RobotId:
        if peer not in self._robots:
            raise ValueError(f"no robot has the acoustic modem {peer}")
        return self._robots[peer]

    async def _ping_beacons(self, fields: Fields) -> BeaconMeasurement:
        async with self._measuring:
            speed_m_s = self.config.sound_speed_m_s
            reply, reason = await self._measured(fields, None, BeaconReply)
        silent: tuple[float | None, ...] = (None,) * sentence.BEACONS
        times_s = silent if reply is None else reply.travel_times_s
        return BeaconMeasurement(
            travel_times_s=times_s,
            ranges_m=tuple(None if t is None else t * speed_m_s for t in times_s),
            at=self._clock.now(),
            is_valid=not reason,
            reason=reason,
        )

    async def _measured(
        self, fields: Fields, pair: frozenset[int] | None, kind: type[Reply]
    ) -> tuple[Reply | None, str]:
        """Give one command and wait for its reply from the water; return it, or why it lacks."""
        if not self.is_ready:
            return None, "the modem is not there"
        await self._be_quiet(pair)
        wait_s = self._wait_s
        answer: asyncio.Future[Heard] = asyncio.get_running_loop().create_future()
        self._awaited, self._awaited_pair, self._was_garbled = answer, pair, False
        self._asked_s = monotonic_s()
        try:
            await self._line.tell(fields)
            async with asyncio.timeout(wait_s):
                reply = await answer
        except TimeoutError:
            given_up = self._given_up.setdefault(pair, _GivenUp())
            given_up.count += 1
            given_up.since_s = monotonic_s()
            how = "only a garbled answer" if self._was_garbled else "no answer"
            return None, f"{how} within {wait_s:.1f} s"
        except PortClosedError:
            return None, "the modem's port closed"
        except ModemRefusedError as error:
            return None, str(error)
        finally:
            self._awaited = None
            forget(answer)
        return (reply, "") if isinstance(reply, kind) else (None, "the modem restarted")

    async def _be_quiet(self, pair: frozenset[int] | None) -> None:
        """Let an answer that was given up come before the same is asked again, if it does."""
        if (given_up := self._given_up.get(pair)) is not None:
            self._came_late.clear()
            quiet_s = given_up.since_s + self._timing.quiet_s - monotonic_s()
            await set_or_after(self._came_late, max(0.0, quiet_s))

    def _hear(self, heard: Heard) -> None:
        match heard:
            case PingReply():
                self._take_reply(heard.pair, heard, 2.0 * heard.travel_time_s)
            case BeaconReply():
                self._take_reply(None, heard, 0.0)
            case ModemStarted():
                self._given_up.clear()
                self._came_late.set()
                self._answer(heard)
            case MiniHeard():
                self._take_mini(heard)
            case PacketGarbled():
                self._was_garbled = True
            case ModemError():
                self._fail(refused(heard))

    def _take_reply(self, pair: frozenset[int] | None, heard: Heard, sound_s: float) -> None:
        """Take a reply whose sound was under way so long for the question that it can answer."""
        given_up = self._given_up.get(pair)
        elapsed_s = (monotonic_s() - self._asked_s) * self._clock.speed
        is_early = given_up is not None and sound_s > elapsed_s + _EARLY_S
        if self._awaited is not None and self._awaited_pair == pair and not is_early:
            self._answer(heard)
        elif given_up is not None:
            self.answers_late += 1
            given_up.count -= 1
            if given_up.count <= 0:
                del self._given_up[pair]
            self._came_late.set()

    def _answer(self, heard: Heard) -> None:
        if self._awaited is not None and not self._awaited.done():
            self._awaited.set_result(heard)

    def _fail(self, error: Exception) -> None:
        if self._awaited is not None and not self._awaited.done():
            self._awaited.set_exception(error)

    def _closed(self) -> None:
        self._given_up.clear()
        self._fail(PortClosedError("the port closed"))

    def _take_mini(self, heard: MiniHeard) -> None:
        others = {heard.source, heard.destination} - {self._us}
        peer = others.pop() if len(others) == 1 else None
        if peer is not None and peer in self._robots:
            now = self._clock.now()
            self._on_mini(MiniReceived(self._robots[peer], peer, heard.word, now))


def open_modem(
    links: Mapping[RobotId, str],
    clock: Clock,
    config: AcousticConfig | None = None,
    timing: ModemTiming | None = None,
    on_mini: Callable[[MiniReceived], None] = _ignore,
) -> MicroModem:
    """Return the modem that ``micromodem`` links of one or more robots name; ``run`` opens it.

    Raises:
        ValueError: If a link names no modem, or they do not name the same one.
    """
    if not links:
        raise ValueError("a modem needs at least one robot to speak with")
    addresses = {robot: acoustic_address(uri) for robot, uri in links.items()}
    first = next(iter(addresses.values()))
    if any(modem_of(address) != modem_of(first) for address in addresses.values()):
        raise ValueError("the links name different acoustic modems at the station")
    robots = {address.peer: robot for robot, address in addresses.items()}
    if len(robots) != len(links):
        raise ValueError("two robots have an acoustic modem of the same address")

    async def opened() -> Port:
        if first.device is not None:
            return await SerialPort.open(first.device, baud=first.baud, flow_control=False)
        return await TcpPort.open(first.host or "", first.port or 0)

    return MicroModem(opened, first.us, robots, clock, config, timing, on_mini)


def modem_of(address: AcousticAddress) -> tuple[object, ...]:
    """Return what the links to the robots of one modem share: its port and its own address."""
    return address.device, address.host, address.port, address.baud, address.us
