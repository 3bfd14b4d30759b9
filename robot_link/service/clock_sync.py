"""How far a robot's clock is off, by TIMESYNC questions or, without, by the stamps of its states.

TIMESYNC: the asker sends its time, the other side adds its own. Half of the round trip is how far
the answer can be wrong. Times are nanoseconds since 1970 of each side's own clock.
"""

from collections import deque
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from enum import StrEnum

from robot_link.clock import Clock
from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from robot_link.station.error import NoAnswerError
from robot_link.station.exchange import Correspondent, Exchange, Patience

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_NANOSECONDS = 10**9
_FRAMES = 32
"""States whose stamps are compared; the least late one counts."""

WRONG_S = 3600.0
"""A clock that is off by more than this is told to the operator, s."""


class ClockSource(StrEnum):
    """What an offset was measured with."""

    TIMESYNC = "timesync"
    FRAMES = "frames"
    """Stamps of states against their arrival: late by what the way took."""


@dataclass(frozen=True, slots=True)
class ClockOffset:
    """A robot's clock against the station's."""

    offset_s: float
    """The robot's time minus the station's; positive where the robot is ahead."""
    uncertainty_s: float
    """How far the offset may be wrong."""
    source: ClockSource
    at: datetime
    """When it was measured, by the station's clock."""

    @property
    def is_wrong(self) -> bool:
        """Whether the robot's clock is off by more than it can have drifted."""
        return abs(self.offset_s) - self.uncertainty_s > WRONG_S

    @property
    def sentence(self) -> str:
        """What to tell the operator; empty while the clock is right."""
        if not self.is_wrong:
            return ""
        side = "ahead" if self.offset_s > 0 else "behind"
        return f"its clock is {_span(abs(self.offset_s))} {side}"


def time_ns(moment: datetime) -> int:
    """Return nanoseconds since 1970."""
    return (moment - _EPOCH) // timedelta(microseconds=1) * 1000


def time_answer(
    message: grace.MAVLink_timesync_message, clock: Clock
) -> grace.MAVLink_timesync_message | None:
    """Return the answer to a question for the time; None where the message is an answer itself."""
    if message.tc1 != 0:
        return None
    return grace.MAVLink_timesync_message(tc1=time_ns(clock.now()), ts1=message.ts1)


class ClockWatch:
    """Keeps the best that is known of one robot's clock.

    An offset by TIMESYNC holds until the next one; stamps of states only stand in before the
    first, and again where they say that the clock has jumped since.
    """

    def __init__(
        self, peer: Correspondent, clock: Clock, *, patience: Patience | None = None
    ) -> None:
        self._exchange = Exchange(peer, patience)
        self._clock = clock
        self._synchronized: ClockOffset | None = None
        self._frames: deque[float] = deque(maxlen=_FRAMES)
        self._framed_at: datetime | None = None

    @property
    def offset(self) -> ClockOffset | None:
        """The robot's clock against the station's; None before anything is known."""
        framed = self._by_frames()
        known = self._synchronized
        if known is None or framed is None:
            return known or framed
        disagree_s = abs(known.offset_s - framed.offset_s)
        return framed if framed.at > known.at and disagree_s > WRONG_S else known

    def hear(self, message: WireMessage) -> None:
        """Take what the robot says."""
        self._exchange.hear(message)

    def note_frame(self, measured_at: datetime, received_at: datetime) -> None:
        """Take the stamp of something that the robot sent as soon as it was measured."""
        offset_s = (measured_at - received_at).total_seconds()
        if self._frames and abs(offset_s - self._frames[-1]) > WRONG_S:
            self._frames.clear()
        self._frames.append(offset_s)
        self._framed_at = received_at

    async def measure(self) -> ClockOffset:
        """Ask the robot for its time.

        Raises:
            NoAnswerError: If it does not answer.
        """
        answer: grace.MAVLink_timesync_message | None = None
        for _ in range(self._exchange.patience.attempts):
            asked_ns = time_ns(self._clock.now())
            question = grace.MAVLink_timesync_message(tc1=0, ts1=asked_ns)
            try:
                answer = await self._exchange.ask(
                    lambda _, question=question: (question,),
                    lambda message, asked_ns=asked_ns: _answer_to(message, asked_ns),
                    attempts=1,
                )
            except NoAnswerError:
                continue
            heard_at = self._clock.now()
            trip_ns = time_ns(heard_at) - asked_ns
            self._synchronized = ClockOffset(
                offset_s=(answer.tc1 - asked_ns - trip_ns / 2) / _NANOSECONDS,
                uncertainty_s=trip_ns / 2 / _NANOSECONDS,
                source=ClockSource.TIMESYNC,
                at=heard_at,
            )
            return self._synchronized
        raise NoAnswerError("the robot did not tell its time")

    def _by_frames(self) -> ClockOffset | None:
        if self._framed_at is None or not self._frames:
            return None
        best_s = max(self._frames)
        return ClockOffset(
            offset_s=best_s,
            uncertainty_s=best_s - min(self._frames),
            source=ClockSource.FRAMES,
            at=self._framed_at,
        )


def _answer_to(message: WireMessage, asked_ns: int) -> grace.MAVLink_timesync_message | None:
    if not isinstance(message, grace.MAVLink_timesync_message):
        return None
    return message if message.tc1 != 0 and message.ts1 == asked_ns else None


def _span(seconds: float) -> str:
    for unit, length_s in (("year", 31_557_600.0), ("day", 86_400.0), ("hour", 3600.0)):
        if seconds >= 2 * length_s:
            return f"{seconds / length_s:.0f} {unit}s"
    return f"{seconds / 60:.0f} minutes"
