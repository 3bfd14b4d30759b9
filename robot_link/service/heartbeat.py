"""Who speaks under a system id: one radio is believed, others under the same id are told of."""

from dataclasses import dataclass
from typing import Final

from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from robot_link.messages import SystemId
from robot_link.transport.datagram import Address

_TOLD_S = 60.0
"""How long after it was last heard a double is spoken of."""
_ADDRESSES = 8

GROUND_STATIONS: Final = frozenset((grace.MAV_TYPE_GCS, grace.MAV_TYPE_ONBOARD_CONTROLLER))
"""Types in a heartbeat of those who may ask a robot for something."""


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
