"""How often a robot sends standard telemetry: as asked for, slowed to what the link carries."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from robot_link.mavlink.wire import grace

_OVERHEAD_BYTES = 12
_FASTEST_S = 0.02
_TO_DEFAULT = 0
_TO_NOTHING = -1

DEFAULT_PERIODS_S: Final[Mapping[int, float]] = MappingProxyType(
    {
        grace.MAVLINK_MSG_ID_ATTITUDE: 0.25,
        grace.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 0.5,
        grace.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 0.5,
        grace.MAVLINK_MSG_ID_GPS_RAW_INT: 1.0,
        grace.MAVLINK_MSG_ID_SCALED_PRESSURE: 1.0,
        grace.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
        grace.MAVLINK_MSG_ID_BATTERY_STATUS: 2.0,
        grace.MAVLINK_MSG_ID_SYSTEM_TIME: 5.0,
        grace.MAVLINK_MSG_ID_VFR_HUD: 1.0,
        grace.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 2.0,
    }
)
"""What a ground station that asks for nothing in particular is sent, and how often."""


def frame_bytes(message_id: int) -> int:
    """Return the longest unsigned frame of a message.

    Raises:
        KeyError: If the dialect has no such message.
    """
    return _OVERHEAD_BYTES + grace.mavlink_map[message_id].unpacker.size


@dataclass(frozen=True, slots=True)
class StreamBudget:
    """What telemetry may take of a link."""

    bytes_per_s: float
    """Infinite where the link does not matter."""

    def periods_s(self, wanted: Mapping[int, float]) -> dict[int, float]:
        """Return the period of each message: as wanted, or all slowed alike until they fit."""
        rate = sum(frame_bytes(message) / period_s for message, period_s in wanted.items())
        slower = max(1.0, rate / self.bytes_per_s) if self.bytes_per_s > 0 else float("inf")
        return {message: period_s * slower for message, period_s in wanted.items()}


class Streams:
    """The telemetry of one ground station; nothing before it asks or shows itself."""

    def __init__(self) -> None:
        self._wanted: dict[int, float] = {}
        self._sent_s: dict[int, float] = {}

    @property
    def is_wanted(self) -> bool:
        """Whether anything is sent at all."""
        return bool(self._wanted)

    def begin_default(self) -> None:
        """Send the usual messages."""
        self._wanted = dict(DEFAULT_PERIODS_S)

    def set_interval(self, message_id: int, interval_us: float) -> bool:
        """Obey SET_MESSAGE_INTERVAL: 0 asks for the usual period, -1 for none.

        Returns:
            Whether the robot has such a message and the interval is one.
        """
        if message_id not in DEFAULT_PERIODS_S:
            return False
        if interval_us == _TO_NOTHING:
            self._wanted.pop(message_id, None)
        elif interval_us == _TO_DEFAULT:
            self._wanted[message_id] = DEFAULT_PERIODS_S[message_id]
        elif interval_us > 0:
            self._wanted[message_id] = max(_FASTEST_S, interval_us / 1e6)
        else:
            return False
        return True

    def interval_us(self, message_id: int) -> int:
        """Return the interval that was asked for; -1 where the message is not sent."""
        period_s = self._wanted.get(message_id)
        return _TO_NOTHING if period_s is None else round(period_s * 1e6)

    def due(self, now_s: float, budget: StreamBudget) -> list[int]:
        """Return the messages to send now; they count as sent."""
        periods_s = budget.periods_s(self._wanted)
        due = [
            message
            for message, period_s in periods_s.items()
            if now_s - self._sent_s.get(message, -period_s) >= period_s
        ]
        for message in due:
            self._sent_s[message] = now_s
        return due
