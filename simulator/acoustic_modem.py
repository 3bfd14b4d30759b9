"""A WHOI Micro-Modem on a pseudo-terminal, and the modems under water that answer it.

19200 baud, NMEA 0183: ``$CCxxx,..*XX`` from the host, ``$CAxxx,..*XX`` (of the transponders
``$SNxxx``) to it; XX is the exclusive or of what stands between. Each command is echoed as
``$CAxxx`` with the same fields::

    $CCMPC,1,2      ping: $CAMPC,1,2, then $CAMPR,1,2,0.0101 with the travel time one way, s
    $CCMUC,1,2,0abc a word of 13 bits to a modem; $CAMUA,2,1,0abc is one from it
    $CCPDT,..       ping of up to four transponders: $SNTTA,ta,tb,tc,td,hhmmss.ss
    $CCCFG,SRC,1    a setting; $CCCFQ,SRC asks for it; both are answered $CACFG,SRC,1
    $CCCLK,..       sets the clock, as $CCTMS does
    $CCMSC,1,1,0    sleep of no length: the modem restarts

``$CAREV,hhmmss,INIT,..`` tells that the modem has restarted and forgotten its settings,
``$CAMSG,BAD_CRC,2`` that a mini packet came in garbled, ``$CAERR,hhmmss,NMEA,..`` that the host's
sentence was none.

Source: WHOI Micro-Modem software interface guide, as drivers of others use it.
"""

import asyncio
import math
import random
from collections.abc import AsyncGenerator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path

from robot_link.clock import Clock
from simulator.pseudo_terminal import pseudo_terminal

Point = tuple[float, float, float]
"""North, east, depth, m."""

_REVISION = "0.93.0.30"
_LINE_BYTES = 1024
_WORD_BITS = 13
_SETTING_LETTERS = 3
_TRANSPONDERS = "ABCD"
_LONGEST_TIMEOUT_S = 600.0
_DEFAULTS = {"AGC": 1, "BND": 1, "CST": 1, "REV": 1, "RXP": 0, "SRC": 0, "TOA": 0}


@dataclass(frozen=True, slots=True)
class AcousticConditions:
    """How bad the water is; probabilities hold for one passage of one sound."""

    sound_speed_m_s: float = 1500.0
    travel_time_std_s: float = 0.001
    """Standard deviation of a measured travel time, one way."""
    loss: float = 0.0
    """Probability that a sound is not heard."""
    garbling: float = 0.0
    """Probability that a sound is heard and not understood."""
    outliers: float = 0.0
    """Probability that an echo is taken for the sound itself."""
    echo_s: float = 0.03
    """Longest time by which an echo is late."""
    range_m: float = 2000.0
    """Sounds do not carry farther."""
    turnaround_s: float = 0.05
    """Time of a modem or transponder to answer."""
    replier_first: bool = False
    """Replies name the modem that answered first, as some firmware does."""


@dataclass(slots=True)
class AcousticNode:
    """A modem or transponder under water."""

    position: Callable[[], Point | None]
    """Where it is; None while it hears nothing."""
    hear: Callable[[int, int], None] = field(default=lambda _source, _word: None)
    """Takes the sender and the word of a mini packet."""


class AcousticModem:
    """The modem at the host's line; belongs to one event loop.

    Args:
        position: Where it is; None while it hears nothing.
        nodes: The other modems by their addresses.
        rng: Draws noise and losses.
        conditions: How bad the water is.
        clock: Sound takes its time by this clock.
        transponders: Transponders of a long baseline, by their letters A to D.
    """

    def __init__(
        self,
        position: Callable[[], Point | None],
        nodes: Mapping[int, AcousticNode],
        rng: random.Random,
        conditions: AcousticConditions,
        clock: Clock,
        transponders: Mapping[str, AcousticNode] | None = None,
    ) -> None:
        self.conditions = conditions
        """May be replaced at any time."""
        self.settings: dict[str, int] = dict(_DEFAULTS)
        self.is_clock_set = False
        self._position = position
        self._nodes = nodes
        self._transponders = transponders or {}
        self._rng = rng
        self._clock = clock
        self._buffer = bytearray()
        self._write: Callable[[bytes], None] | None = None

    @asynccontextmanager
    async def pty(self, link: Path) -> AsyncGenerator[None]:
        """Put the modem on a pseudo-terminal, reached through the symbolic link."""
        self._buffer.clear()
        async with pseudo_terminal(link, self._feed) as write:
            self._write = write
            try:
                yield
            finally:
                self._write = None

    def reboot(self) -> None:
        """Lose power for a moment: settings and clock are forgotten, and the host is told."""
        self.settings = dict(_DEFAULTS)
        self.is_clock_set = False
        self._say("CAREV", self._time(), "INIT", _REVISION)

    def send_mini(self, source: int, word: int) -> None:
        """Let a modem under water send a word of 13 bits to the host.

        Raises:
            ValueError: If there is no such modem, or the word is longer.
        """
        if source not in self._nodes or not 0 <= word < 2**_WORD_BITS:
            raise ValueError(f"no modem {source}, or {word} has more than {_WORD_BITS} bits")
        travel_s = self._travel_s(self._nodes[source])
        if travel_s is not None:
            to = self.settings["SRC"]
            self._later(travel_s, self._arrive, ("CAMUA", source, to, f"{word:04x}"))

    # ---- the dialogue --------------------------------------------------------------------------

    def _feed(self, data: bytes) -> None:
        self._buffer += data.replace(b"\n", b"\r")
        *lines, rest = self._buffer.split(b"\r")
        self._buffer = bytearray(rest[-_LINE_BYTES:])
        for line in lines:
            if line:
                self._obey(bytes(line))

    def _obey(self, line: bytes) -> None:
        """Carry out one sentence of the host."""
        start = line.rfind(b"$")
        body, star, checksum = line[start + 1 :].partition(b"*")
        text = body.decode("latin-1")
        if start < 0 or not text.startswith("CC"):
            self._complain(2, "not a command")
            return
        if star and checksum.strip().upper() != f"{_sum(body):02X}".encode():
            self._complain(1, "checksum")
            return
        name, *fields = text.split(",")
        try:
            self._command(name[2:], fields)
        except (ValueError, OverflowError):
            self._complain(3, "bad field")

    def _command(self, name: str, fields: Sequence[str]) -> None:
        """Carry out one command.

        Raises:
            ValueError: If its fields are not as they must be.
        """
        match name, fields:
            case "MPC", [source, destination]:
                self._ping(int(source), int(destination), fields)
            case "MUC", [source, destination, word]:
                self._mini(int(source), int(destination), int(word, 16), fields)
            case "PDT" | "PNT", [*_]:
                self._ping_transponders(name, fields)
            case "CFG", [setting, value]:
                self._set(setting.upper(), int(value))
            case "CFQ", [setting]:
                self._tell_settings(setting.upper())
            case "CLK" | "TMS", [_, *_]:
                self.is_clock_set = True
                self._say(f"CA{name}", *fields)
            case "MSC", [_, _, _]:
                self._say("CAMSC", *fields)
                self.reboot()
            case _:
                self._complain(4, "unknown command")

    def _ping(self, source: int, destination: int, fields: Sequence[str]) -> None:
        self._say("CAMPC", *fields)
        node = self._nodes.get(destination)
        out_s = None if node is None else self._travel_s(node)
        if node is not None and out_s is not None:
            delay_s = out_s + self.conditions.turnaround_s
            self._later(delay_s, self._reply, source, destination, node, out_s)

    def _reply(self, source: int, destination: int, node: AcousticNode, out_s: float) -> None:
        """Let a modem answer a ping from where it is by now."""
        back_s = self._travel_s(node)
        if back_s is None:
            return
        measured_s = self._measured_s((out_s + back_s) / 2.0)
        pair = (source, destination)
        if self.conditions.replier_first:
            pair = (destination, source)
        self._later(back_s, self._arrive, ("CAMPR", *pair, f"{measured_s:.4f}"))

    def _mini(self, source: int, destination: int, word: int, fields: Sequence[str]) -> None:
        if not 0 <= word < 2**_WORD_BITS:
            raise ValueError(f"{word} has more than {_WORD_BITS} bits")
        self._say("CAMUC", *fields)
        node = self._nodes.get(destination)
        travel_s = None if node is None else self._travel_s(node)
        if node is not None and travel_s is not None and not self._draw(self.conditions.garbling):
            self._later(travel_s, node.hear, source, word)

    def _ping_transponders(self, name: str, fields: Sequence[str]) -> None:
        """Ask the transponders that are asked for; tell all their times when it is over."""
        letters = _wanted(name, fields)
        timeout_s = int(fields[4 if name == "PDT" else 3]) / 1000.0
        if not 0 < timeout_s <= _LONGEST_TIMEOUT_S:
            raise ValueError(f"a time-out of {timeout_s} s is out of range")
        self._say(f"SN{name}", *fields)
        times = dict.fromkeys(_TRANSPONDERS, "")
        for letter in letters:
            node = self._transponders.get(letter)
            travel_s = None if node is None else self._travel_s(node)
            if travel_s is not None and 2 * travel_s + self.conditions.turnaround_s <= timeout_s:
                times[letter] = f"{self._measured_s(travel_s):.4f}"
        self._later(timeout_s, self._tell_times, tuple(times.values()))

    def _tell_times(self, times: tuple[str, ...]) -> None:
        self._say("SNTTA", *times, f"{self._time()}.00")

    def _set(self, setting: str, value: int) -> None:
        if len(setting) != _SETTING_LETTERS or not setting.isalnum():
            raise ValueError(f"{setting} is no setting")
        self.settings[setting] = value
        self._say("CACFG", setting, value)

    def _tell_settings(self, setting: str) -> None:
        """Answer a question for one setting, or for all of them."""
        names = sorted(self.settings) if setting == "ALL" else [setting]
        for name in names:
            self._say("CACFG", name, self.settings.get(name, 0))

    # ---- the water -----------------------------------------------------------------------------

    def _travel_s(self, node: AcousticNode) -> float | None:
        """Return how long a sound takes; None if it does not arrive."""
        here, there = self._position(), node.position()
        if here is None or there is None or self._draw(self.conditions.loss):
            return None
        distance_m = math.dist(here, there)
        if distance_m > self.conditions.range_m:
            return None
        return distance_m / self.conditions.sound_speed_m_s

    def _measured_s(self, travel_s: float) -> float:
        """Return what a modem takes for the travel time."""
        measured_s = self._rng.gauss(travel_s, self.conditions.travel_time_std_s)
        if self._draw(self.conditions.outliers):
            measured_s += self._rng.uniform(0.2, 1.0) * self.conditions.echo_s
        return max(0.0, measured_s)

    def _arrive(self, sentence: tuple[object, ...]) -> None:
        """Take a mini packet from the water."""
        if self._draw(self.conditions.garbling):
            self._say("CAMSG", "BAD_CRC", 2)
        else:
            self._say(*sentence)

    def _draw(self, probability: float) -> bool:
        return self._rng.random() < probability

    def _later(self, delay_s: float, call: Callable[..., None], *arguments: object) -> None:
        asyncio.get_running_loop().call_later(delay_s / self._clock.speed, call, *arguments)

    # ---- sentences -----------------------------------------------------------------------------

    def _complain(self, number: int, text: str) -> None:
        self._say("CAERR", self._time(), "NMEA", number, text)

    def _time(self) -> str:
        return f"{self._clock.now():%H%M%S}"

    def _say(self, *fields: object) -> None:
        if self._write is not None:
            body = ",".join(str(value) for value in fields).encode("latin-1")
            self._write(b"$" + body + f"*{_sum(body):02X}\r\n".encode("ascii"))


def _sum(body: bytes) -> int:
    total = 0
    for octet in body:
        total ^= octet
    return total


def _wanted(name: str, fields: Sequence[str]) -> list[str]:
    """Return the letters of the transponders that a command asks for.

    Raises:
        ValueError: If the fields are too few.
    """
    first = 5 if name == "PDT" else 4
    flags = fields[first : first + len(_TRANSPONDERS)]
    if len(flags) != len(_TRANSPONDERS):
        raise ValueError("a command for four transponders has too few fields")
    return [letter for letter, flag in zip(_TRANSPONDERS, flags, strict=True) if int(flag) > 0]
