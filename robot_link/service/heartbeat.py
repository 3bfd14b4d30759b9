"""The station's presence, and who speaks under a robot's system id besides the robot."""

import asyncio
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Final

from robot_link.delivery import deliver
from robot_link.mavlink.codec import Codec, WireMessage
from robot_link.mavlink.wire import grace
from robot_link.messages import RobotMode, SystemId
from robot_link.transport.datagram import BROADCAST, Address, DatagramTransport

_TOLD_S = 60.0
"""How long after it was last heard a double is spoken of."""
_ADDRESSES = 8

GROUND_STATIONS: Final = frozenset((grace.MAV_TYPE_GCS, grace.MAV_TYPE_ONBOARD_CONTROLLER))
"""Types in a heartbeat of those who may ask a robot for something."""


def robot_heartbeat(mode: RobotMode) -> grace.MAVLink_heartbeat_message:
    """Return what a robot says of its presence."""
    return grace.MAVLink_heartbeat_message(
        type=grace.MAV_TYPE_SUBMARINE,
        autopilot=grace.MAV_AUTOPILOT_GENERIC,
        base_mode=grace.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
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


@dataclass(slots=True)
class _Double:
    address: Address
    frames: int
    heard_s: float


class DoubleWatch:
    """Notes radios that speak under a system id that belongs to another one.

    Who notes them does not obey them; this only remembers, for the operator.
    """

    def __init__(self) -> None:
        self._doubles: dict[tuple[SystemId, Address], _Double] = {}

    def note(self, system: SystemId, address: Address, now_s: float) -> bool:
        """Note a frame of a radio that is not the one of this system id.

        Returns:
            Whether it is news: this radio was not heard under this id for a while.
        """
        double = self._doubles.get((system, address))
        if double is None:
            while len(self._doubles) >= _ADDRESSES:
                oldest = min(self._doubles, key=lambda key: self._doubles[key].heard_s)
                del self._doubles[oldest]
            double = self._doubles[system, address] = _Double(address, 0, now_s - 2 * _TOLD_S)
        is_news = now_s - double.heard_s > _TOLD_S
        double.frames += 1
        double.heard_s = now_s
        return is_news

    def sentence(self, system: SystemId, now_s: float) -> str:
        """Say which radios speak under a system id that is not theirs, or ""."""
        found = [
            double
            for (other, _), double in self._doubles.items()
            if other == system and now_s - double.heard_s <= _TOLD_S
        ]
        if not found:
            return ""
        radios = ", ".join(f"{double.address:016X}" for double in found)
        return (
            f"another radio ({radios}) speaks as system {system}; it is not obeyed:"
            " give one of the two robots another system id"
        )


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
