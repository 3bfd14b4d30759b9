"""Standard MAVLink messages as values of the channel catalogue."""

import math
from collections.abc import Iterable, Iterator
from typing import Final

from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace

_ATMOSPHERE_HPA: Final = 1013.25
_DOWNWARDS: Final = grace.MAV_SENSOR_ROTATION_PITCH_270
_UNKNOWN_INT16: Final = 2**15 - 1
_UNKNOWN_UINT16: Final = 2**16 - 1
_UNKNOWN_UINT8: Final = 255
_LEAK_TEXT: Final = "leak detected"
_GPS_FIX: Final = 2


def readings(
    message: WireMessage, *, is_ardusub: bool, depth_m: float | None
) -> list[tuple[str, float]]:
    """Return what a message says of the channels, in the catalogue's units.

    What the message marks as unknown is left out. A named value goes by its name of at most ten
    characters (``autonomy.channel.key_at_station`` knows what that means at the station).

    Args:
        message: A valid frame's content.
        is_ardusub: Whether the sender is ArduSub, whose first pressure sensor is inside the hull.
        depth_m: Depth of the vehicle, to which a height above the floor is added.
    """
    return finite(_said(message, is_ardusub, depth_m))


def finite(told: Iterable[tuple[str, float]]) -> list[tuple[str, float]]:
    """Return those values of channels that are numbers."""
    return [(key, value) for key, value in told if math.isfinite(value)]


def _said(
    message: WireMessage, is_ardusub: bool, depth_m: float | None
) -> Iterator[tuple[str, float]]:
    match message:
        case grace.MAVLink_scaled_pressure_message() if is_ardusub:
            yield "internal_pressure", message.press_abs
            yield "internal_temperature", message.temperature / 100.0
        case (
            grace.MAVLink_scaled_pressure_message()
            | grace.MAVLink_scaled_pressure2_message()
            | grace.MAVLink_scaled_pressure3_message()
        ):
            if message.press_abs:
                yield "pressure", (message.press_abs - _ATMOSPHERE_HPA) / 100.0
            yield "temperature", message.temperature / 100.0
        case grace.MAVLink_hygrometer_sensor_message():
            yield "humidity", message.humidity / 100.0
            yield "internal_temperature", message.temperature / 100.0
        case grace.MAVLink_water_depth_message(healthy=1) if depth_m is not None:
            yield "water_depth", depth_m + message.distance
        case grace.MAVLink_distance_sensor_message(orientation=turned) if depth_m is not None:
            if turned == _DOWNWARDS and message.current_distance < message.max_distance:
                yield "water_depth", depth_m + message.current_distance / 100.0
        case grace.MAVLink_battery_status_message(id=0):
            if message.current_battery != -1:
                yield "battery_current", message.current_battery / 100.0
        case grace.MAVLink_sys_status_message():
            if message.load:
                yield "processor_load", message.load / 10.0
            if message.current_battery != -1:
                yield "battery_current", message.current_battery / 100.0
        case grace.MAVLink_gps_raw_int_message():
            if message.satellites_visible != _UNKNOWN_UINT8:
                yield "gps_satellites", float(message.satellites_visible)
            if message.eph != _UNKNOWN_UINT16 and message.fix_type >= _GPS_FIX:
                yield "gps_hdop", message.eph / 100.0
        case grace.MAVLink_named_value_float_message() | grace.MAVLink_named_value_int_message():
            if name := message.name.strip().lower():
                yield name, float(message.value)
        case grace.MAVLink_statustext_message() if message.text.lower().startswith(_LEAK_TEXT):
            yield "leak", 1.0
        case _:
            return


def battery(message: WireMessage) -> Iterator[tuple[str, float]]:
    """Return what a message says of charge (0 to 1) and voltage (V) by a state's channels."""
    match message:
        case grace.MAVLink_sys_status_message():
            if message.voltage_battery not in (0, _UNKNOWN_UINT16):
                yield "battery_v", message.voltage_battery / 1000.0
            if message.battery_remaining >= 0:
                yield "battery_fraction", message.battery_remaining / 100.0
        case grace.MAVLink_battery_status_message(id=0):
            cells = [cell for cell in message.voltages if cell not in (0, _UNKNOWN_UINT16)]
            if cells:
                yield "battery_v", sum(cells) / 1000.0
            if message.battery_remaining >= 0:
                yield "battery_fraction", message.battery_remaining / 100.0
        case _:
            return
