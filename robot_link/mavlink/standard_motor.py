"""What a standard vehicle says of its motors, as values of the channel catalogue.

Four motors share a message; a channel has the value of the motor that deserves most attention.
"""

import math
from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Final

from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace

_FRESH_S: Final = 5.0
_UNKNOWN_INT16: Final = 2**15 - 1
_EACH: Final = 4
"""Motors of one message."""
_FAILURES: Final = (
    "over current",
    "over voltage",
    "too hot",
    "too fast",
    "obeys inconsistently",
    "stuck",
    "failed",
)
"""Bits of ESC_FAILURE_FLAGS."""


class Motors:
    """Keeps what each motor said last. Belongs to one event loop.

    Args:
        speed: Seconds of the station's clock per second of the wall.
    """

    def __init__(self, speed: float = 1.0) -> None:
        self._fresh = timedelta(seconds=_FRESH_S * speed)
        self._values: dict[tuple[str, int], tuple[float, datetime]] = {}
        self._failures: dict[int, int] = {}
        """Failure flags of each motor, by its number from 0."""

    def hear(self, message: WireMessage, at: datetime) -> list[tuple[str, float]]:
        """Take a message; return what the channels that it tells of are, in their units."""
        told = list(_said(message))
        if isinstance(message, grace.MAVLink_esc_info_message):
            for place, flags in enumerate(message.failure_flags):
                self._failures[message.index + place] = flags
        for key, motor, value in told:
            self._values[key, motor] = (value, at)
        return [(key, self._worst(key, at)) for key in dict.fromkeys(key for key, _, _ in told)]

    @property
    def failures(self) -> tuple[str, ...]:
        """What fails, such as "motor 3 (stuck)"; motors are numbered from 1."""
        return tuple(
            f"motor {motor + 1} ({', '.join(_failure_words(flags))})"
            for motor, flags in sorted(self._failures.items())
            if flags
        )

    def _worst(self, key: str, at: datetime) -> float:
        """Return the greatest value of the motors that spoke of late."""
        found = self._values.items()
        return max(
            value for (of, _), (value, then) in found if of == key and at - then <= self._fresh
        )


def _said(message: WireMessage) -> Iterator[tuple[str, int, float]]:
    """Return channel, motor and value of what a message says; what it marks as unknown is none."""
    match message:
        case grace.MAVLink_esc_status_message():
            for place in range(_EACH):
                motor = message.index + place
                if math.isfinite(message.current[place]) and message.voltage[place] > 0.0:
                    yield "motor_speed", motor, abs(float(message.rpm[place]))
                    yield "motor_current", motor, message.current[place]
        case grace.MAVLink_esc_info_message():
            for place, cdeg in enumerate(message.temperature):
                if message.info >> place & 1 and cdeg != _UNKNOWN_INT16:
                    yield "motor_temperature", message.index + place, cdeg / 100.0
        case (
            grace.MAVLink_esc_telemetry_1_to_4_message()
            | grace.MAVLink_esc_telemetry_5_to_8_message()
        ):
            is_second = isinstance(message, grace.MAVLink_esc_telemetry_5_to_8_message)
            for place in range(_EACH):
                if not message.count[place]:
                    continue
                motor = place + (_EACH if is_second else 0)
                yield "motor_speed", motor, float(message.rpm[place])
                yield "motor_current", motor, message.current[place] / 100.0
                yield "motor_temperature", motor, float(message.temperature[place])
        case grace.MAVLink_rpm_message():
            for motor, rpm in enumerate((message.rpm1, message.rpm2)):
                if math.isfinite(rpm) and rpm != -1.0:
                    yield "motor_speed", motor, abs(rpm)
        case grace.MAVLink_raw_rpm_message():
            if math.isfinite(message.frequency):
                yield "motor_speed", message.index, abs(message.frequency)
        case _:
            return


def _failure_words(flags: int) -> list[str]:
    known = [words for bit, words in enumerate(_FAILURES) if flags >> bit & 1]
    return known or [f"fault {flags}"]
