"""What a Micro-Modem says, and what it is told: values for sentences.

The host's sentences begin with ``CC``, the modem's with ``CA`` or, about transponders, ``SN``;
each command is echoed under the modem's letters. Drivers disagree on which modem a ``CAMPR``
names first, the one that asked or the one that replied: only the pair counts.

Source: WHOI Micro-Modem Software Interface Guide; goby3, acomms/modemdriver/mm_driver.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

WORD_MAX = 0x1FFF
"""A mini packet carries 13 bits."""
BEACONS = 4

Fields = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class PingReply:
    """A modem answered a ping (CAMPR)."""

    pair: frozenset[int]
    """Who asked and who answered."""
    travel_time_s: float
    """One way."""


@dataclass(frozen=True, slots=True)
class BeaconReply:
    """Transponders answered (SNTTA)."""

    travel_times_s: tuple[float | None, ...]
    """One way, of A to D; None for one that did not answer."""


@dataclass(frozen=True, slots=True)
class MiniHeard:
    """A mini packet came in (CAMUA)."""

    source: int
    destination: int
    word: int


@dataclass(frozen=True, slots=True)
class ModemStarted:
    """The modem has restarted and forgotten its settings (CAREV, INIT)."""


@dataclass(frozen=True, slots=True)
class PacketGarbled:
    """A packet came in that could not be understood (CAMSG, BAD_CRC)."""


@dataclass(frozen=True, slots=True)
class ModemError:
    """The modem could not do what it was told (CAERR)."""

    text: str


Heard = PingReply | BeaconReply | MiniHeard | ModemStarted | PacketGarbled | ModemError


def meaning(fields: Fields) -> Heard | None:
    """Return what a sentence of the modem means; None for an echo and for what is not needed.

    Raises:
        ValueError: If its fields are not what its name promises.
    """
    match fields:
        case ("CAMPR", source, destination, travel_time, *_):
            pair = frozenset((_address(source), _address(destination)))
            return PingReply(pair, _seconds(travel_time))
        case ("SNTTA", *times):
            if len(times) < BEACONS:
                raise ValueError("SNTTA names fewer than four transponders")
            return BeaconReply(tuple(_seconds(t) if t else None for t in times[:BEACONS]))
        case ("CAMUA", source, destination, word, *_):
            return MiniHeard(_address(source), _address(destination), _word(word))
        case ("CAREV", _, "INIT", *_):
            return ModemStarted()
        case ("CAMSG", "BAD_CRC", *_):
            return PacketGarbled()
        case ("CAERR", *what):
            return ModemError(" ".join(what[1:])[:80])
        case ("CAMPR" | "CAMUA", *_):
            raise ValueError(f"{fields[0]} lacks fields")
        case _:
            return None


def is_echo(command: Fields, heard: Fields) -> bool:
    """Tell whether a sentence is the modem's echo of a command of the host.

    Of a clock that is set, the modem tells its own time; leading zeros of numbers may differ.
    """
    if heard[0][:2] not in ("CA", "SN") or heard[0][2:] != command[0][2:]:
        return False
    if heard[0] in ("CACLK", "CATMS"):
        return True
    if len(heard) < len(command):
        return False
    return all(_alike(a, b) for a, b in zip(command[1:], heard[1:], strict=False))


def ping(us: int, peer: int) -> Fields:
    """Return the command that asks a modem for its range."""
    return "CCMPC", str(us), str(peer)


def mini(us: int, peer: int, word: int) -> Fields:
    """Return the command that sends a word of 13 bits.

    Raises:
        ValueError: If the word is longer.
    """
    if not 0 <= word <= WORD_MAX:
        raise ValueError(f"a mini packet carries 0 to {WORD_MAX}, not {word}")
    return "CCMUC", str(us), str(peer), f"{word:04X}"


def setting(name: str, value: int) -> Fields:
    """Return the command that sets a parameter."""
    return "CCCFG", name, str(value)


def question(name: str) -> Fields:
    """Return the command that asks for a parameter; it is answered as ``CACFG``."""
    return "CCCFQ", name


def clock(at: datetime) -> Fields:
    """Return the command that sets the modem's clock to a full second."""
    return "CCCLK", *(str(n) for n in (at.year, at.month, at.day, at.hour, at.minute, at.second))


def ping_remus(channel: int, timeout_s: float, wanted: Sequence[bool]) -> Fields:
    """Return the command that pings up to four REMUS transponders on a channel.

    Raises:
        ValueError: If the channel is not 1 to 4, or not four transponders are named.
    """
    if not 1 <= channel <= 4:
        raise ValueError(f"REMUS transponders have the channels 1 to 4, not {channel}")
    return "CCPDT", "1", str(channel), "0", "0", _milliseconds(timeout_s), *_flags(wanted)


def ping_narrow_band(
    transmit_hz: int,
    transmit_ms: int,
    receive_ms: int,
    timeout_s: float,
    reply_hz: Sequence[int],
) -> Fields:
    """Return the command that pings up to four narrow-band transponders.

    Args:
        transmit_hz: Frequency of the ping.
        transmit_ms: Its length.
        receive_ms: Length of the replies.
        timeout_s: How long replies are waited for.
        reply_hz: Frequency of each transponder's reply; 0 for one that is not wanted.

    Raises:
        ValueError: If not four transponders are named.
    """
    if len(reply_hz) != BEACONS:
        raise ValueError(f"{BEACONS} transponders are named, 0 for none; not {len(reply_hz)}")
    head = (str(n) for n in (transmit_hz, transmit_ms, receive_ms))
    return "CCPNT", *head, _milliseconds(timeout_s), *(str(n) for n in reply_hz), "1"


def _milliseconds(time_s: float) -> str:
    return str(math.ceil(time_s * 1000))


def _flags(wanted: Sequence[bool]) -> tuple[str, ...]:
    if len(wanted) != BEACONS:
        raise ValueError(f"{BEACONS} transponders are named, wanted or not; not {len(wanted)}")
    return tuple(str(int(one)) for one in wanted)


def _alike(said: str, heard: str) -> bool:
    return said.upper().lstrip("0") == heard.upper().lstrip("0")


def _address(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) <= 3):
        raise ValueError(f"{text!r} is no address of a modem")
    return int(text)


def _word(text: str) -> int:
    try:
        word = int(text, 16) if len(text) <= 8 else -1
    except ValueError:
        word = -1
    if not 0 <= word <= WORD_MAX:
        raise ValueError(f"{text!r} is no word of a mini packet")
    return word


def _seconds(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text!r} is no time")
    return value
