"""Who is present: what robots and ground stations say of themselves once a second."""

import asyncio
from collections.abc import Callable, Iterable
from functools import partial
from typing import Final

from robot_link.delivery import deliver
from robot_link.mavlink.codec import Codec, WireMessage
from robot_link.mavlink.wire import grace
from robot_link.messages import RobotMode
from robot_link.transport.datagram import BROADCAST, DatagramTransport

GROUND_STATIONS: Final = frozenset((grace.MAV_TYPE_GCS, grace.MAV_TYPE_ONBOARD_CONTROLLER))
"""Types in a heartbeat of those who may ask a robot for something."""


def robot_heartbeat(mode: RobotMode) -> grace.MAVLink_heartbeat_message:
    """Return what a robot says of its presence; armed is one that is driven by hand."""
    driven = grace.MAV_MODE_FLAG_SAFETY_ARMED | grace.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
    return grace.MAVLink_heartbeat_message(
        type=grace.MAV_TYPE_SUBMARINE,
        autopilot=grace.MAV_AUTOPILOT_GENERIC,
        base_mode=grace.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        | (driven if mode is RobotMode.DRIVEN else 0),
        custom_mode=int(mode),
        system_status=grace.MAV_STATE_ACTIVE,
        mavlink_version=3,
    )


def station_heartbeat() -> grace.MAVLink_heartbeat_message:
    """Return what a ground station says of its presence."""
    return grace.MAVLink_heartbeat_message(
        type=grace.MAV_TYPE_GCS,
        autopilot=grace.MAV_AUTOPILOT_INVALID,
        base_mode=0,
        custom_mode=0,
        system_status=grace.MAV_STATE_ACTIVE,
        mavlink_version=3,
    )


def is_ground_station(message: WireMessage) -> bool:
    """Tell whether a message announces a ground station."""
    return isinstance(message, grace.MAVLink_heartbeat_message) and message.type in GROUND_STATIONS


async def beat(
    transport: DatagramTransport,
    codecs: Callable[[], Iterable[Codec]],
    on_sent: Callable[[bytes], None],
    period_s: float,
) -> None:
    """Announce the station to everyone in reach of a radio until cancelled.

    Args:
        transport: The radio.
        codecs: Returns who packs: one for all robots without a key, one for each that has its own.
        on_sent: Called with each frame that the radio took.
        period_s: Wall time between two heartbeats.
    """
    while True:
        for codec in codecs() if transport.max_payload else ():
            frame = codec.pack(station_heartbeat())
            await deliver(transport, BROADCAST, frame, on_taken=partial(on_sent, frame))
        await asyncio.sleep(period_s)
