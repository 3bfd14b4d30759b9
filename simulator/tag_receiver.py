"""A VR2C on a pseudo-terminal, which hears the tags of its water as its robot comes by."""

import asyncio
import heapq
import math
import random
from collections.abc import AsyncGenerator, Callable, Sequence
from contextlib import asynccontextmanager
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from autonomy.tag.resting import heard_share
from robot_link.clock import Clock
from robot_link.tag.receiver_line import HeardLine, StatusLine, written_line
from simulator.acoustic_modem import Point
from simulator.background import alongside
from simulator.fleet import RobotDefinition
from simulator.pseudo_terminal import pseudo_terminal
from simulator.robot import SimulatedBody
from simulator.tag import SimulatedTag

_STATUS_EVERY = timedelta(minutes=10)
_SEQUENCES = 1000
_FALSE_CODES = 65536


class TagReceiver:
    """The receiver at its line; belongs to one event loop.

    Args:
        serial: Its serial number.
        position: Where it is.
        tags: The tags of its water.
        rng: Draws delays, what is heard and what goes wrong.
        clock: The time of the water.
        clock_offset: Its own clock minus that time.
        false_share: Part of what is heard that is understood as a tag that is nowhere.
        garbled_share: Part of the lines that the wire spoils.
    """

    def __init__(
        self,
        serial: int,
        position: Callable[[], Point],
        tags: Sequence[SimulatedTag],
        rng: random.Random,
        clock: Clock,
        *,
        clock_offset: timedelta = timedelta(),
        false_share: float = 0.01,
        garbled_share: float = 0.01,
    ) -> None:
        self.clock_offset = clock_offset
        """May be changed at any time."""
        self._serial = serial
        self._position = position
        self._tags = tags
        self._rng = rng
        self._clock = clock
        self._false_share = false_share
        self._garbled_share = garbled_share
        self._sequence = 0
        self._detections = 0
        self._write: Callable[[bytes], None] | None = None

    @classmethod
    def of(
        cls, definition: RobotDefinition, seed: int, body: SimulatedBody, truth: Clock
    ) -> "TagReceiver":
        """Return the receiver of a robot.

        Raises:
            ValueError: If it has none.
        """
        if definition.tag_receiver is None:
            raise ValueError(f"{definition.robot} has no tag receiver")
        rng = random.Random(f"{seed} {definition.robot} tags")
        return cls(
            definition.tag_receiver,
            lambda: body.plant.position_ned,
            definition.tags,
            rng,
            truth,
        )

    @asynccontextmanager
    async def pty(self, link: Path) -> AsyncGenerator[None]:
        """Put the receiver on a pseudo-terminal, reached through the symbolic link, and listen."""
        async with pseudo_terminal(link, _forget) as write:
            self._write = write
            try:
                async with alongside(self._listen(), f"tag receiver {self._serial}"):
                    yield
            finally:
                self._write = None

    def hear(self, tag: SimulatedTag, at: datetime) -> None:
        """Let a tag transmit: it is heard or not, rightly or wrongly."""
        distance_m = math.dist(self._position(), tag.place_ned_m(at))
        share = float(heard_share(np.array([distance_m]), tag.hearing)[0])
        if self._rng.random() >= share:
            return
        code = tag.code
        if self._rng.random() < self._false_share:
            code = f"{code.rpartition('-')[0]}-{self._rng.randrange(1, _FALSE_CODES)}"
        self._detections += 1
        line = HeardLine(self._serial, self._next(), at + self.clock_offset, code, tag.sensor)
        self.say(written_line(line))

    def say(self, line: bytes) -> None:
        """Write a line, which the wire may spoil."""
        if self._rng.random() < self._garbled_share:
            spoiled = self._rng.randrange(len(line) - 2)
            line = line[:spoiled] + b"?" + line[spoiled + 1 :]
        if self._write is not None:
            self._write(line)

    async def _listen(self) -> None:
        now = self._clock.now()
        due = [(now + self._delay(tag), index) for index, tag in enumerate(self._tags)]
        status_at = now
        heapq.heapify(due)
        while True:
            at = min(status_at, due[0][0]) if due else status_at
            wait_s = (at - self._clock.now()).total_seconds() / self._clock.speed
            await asyncio.sleep(max(0.0, wait_s))
            if at == status_at:
                self._tell_status(at)
                status_at += _STATUS_EVERY
                continue
            tag = self._tags[due[0][1]]
            self.hear(tag, at)
            heapq.heapreplace(due, (at + self._delay(tag), due[0][1]))

    def _tell_status(self, at: datetime) -> None:
        values = {"DC": str(self._detections), "PC": str(8 * self._detections), "LV": "12.0"}
        own = at + self.clock_offset
        self.say(written_line(StatusLine(self._serial, self._next(), own, values)))

    def _delay(self, tag: SimulatedTag) -> timedelta:
        return timedelta(seconds=self._rng.uniform(*tag.delay_s))

    def _next(self) -> int:
        number, self._sequence = self._sequence, (self._sequence + 1) % _SEQUENCES
        return number


def _forget(_data: bytes) -> None:
    """A receiver in real-time mode is told nothing."""
