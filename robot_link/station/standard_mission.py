"""Missions of waypoints to and from a vehicle of another maker, proved by reading them back.

Such a vehicle knows no hash: what it holds is what it says when it is asked item by item.
"""

import asyncio
import re
from collections.abc import Callable, Sequence
from typing import Final

from robot_link.mavlink.standard_vehicle import StandardVehicle
from robot_link.mavlink.wire import grace
from robot_link.service.standard_item import StandardItem
from robot_link.station.error import ServiceError, ServiceRefusedError
from robot_link.station.mission_client import MissionClient

_WORDS_S: Final = 1.0
"""So long after a refusal the vehicle's own words may still come."""
_NAMED = re.compile(r"\b(?:item|waypoint|wp|seq|command)\D{0,3}(\d+)", re.IGNORECASE)


class MissionRefusedError(ServiceRefusedError):
    """The vehicle refused a mission; ``item`` is the waypoint that it objects to, from 1."""

    def __init__(self, reason: str, item: int | None) -> None:
        """Say why, and at which waypoint; None where the vehicle does not tell."""
        super().__init__(reason)
        self.item = item


class MissionUnprovedError(ServiceError):
    """The vehicle took a mission, but what it gives back is another, or nothing."""

    def __init__(self, reason: str, item: int | None = None) -> None:
        """Say what is not proved, and of which waypoint, from 1, if it is one."""
        super().__init__(reason)
        self.item = item


def waypoint(
    latitude_deg: float, longitude_deg: float, depth_m: float, hold_s: float
) -> StandardItem:
    """Return a waypoint as every autopilot takes it: an altitude below the surface."""
    return StandardItem(
        command=grace.MAV_CMD_NAV_WAYPOINT,
        frame=grace.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        x=round(latitude_deg * 1e7),
        y=round(longitude_deg * 1e7),
        z=-depth_m,
        parameters=(hold_s, 0.0, 0.0, 0.0),
    )


async def put_on_board(
    missions: MissionClient,
    vehicle: StandardVehicle,
    items: Sequence[StandardItem],
    report: Callable[[int, int], None],
) -> None:
    """Upload waypoints and read them back; returning proves that the vehicle holds them.

    ArduPilot keeps its home as item 0: it is sent one, which it replaces by its own.

    Raises:
        NoAnswerError: If the vehicle fell silent; what it holds is not known then.
        MissionRefusedError: If it refused.
        MissionUnprovedError: If it took them, but gives back something else, or nothing.
    """
    first = _first(vehicle)
    sent = [items[0], *items] if first else list(items)
    asked = 0

    def follow(number: int, count: int) -> None:
        nonlocal asked
        asked = max(asked, number)
        report(max(0, number - first), count - first)

    before = vehicle.words
    try:
        await missions.upload(sent, report=follow)
    except ServiceRefusedError as error:
        await asyncio.sleep(_WORDS_S)
        said = "; ".join(vehicle.words_since(before))
        named = _NAMED.search(said)
        item = int(named[1]) if named else asked
        number = item + 1 - first
        reason = f"{error}; it says: {said}" if said else str(error)
        where = number if 1 <= number <= len(items) else None
        raise MissionRefusedError(reason, where) from error
    await _verify(missions, items, first)


async def _verify(missions: MissionClient, items: Sequence[StandardItem], first: int) -> None:
    try:
        held = (await missions.download())[first:]
    except ServiceError as error:
        reason = f"it took the mission, but does not give it back: {error}"
        raise MissionUnprovedError(reason) from error
    for number, (kept, sent) in enumerate(zip(held, items, strict=False), start=1):
        if not _is_same(kept, sent):
            raise MissionUnprovedError(
                f"waypoint {number} on board is not the one that was sent", number
            )
    if len(held) != len(items):
        raise MissionUnprovedError(
            f"the vehicle holds {len(held)} waypoints, {len(items)} were sent"
        )


async def read_back(
    missions: MissionClient,
    vehicle: StandardVehicle,
    report: Callable[[int, int], None],
) -> tuple[StandardItem, ...]:
    """Return the mission on board without the home of ArduPilot.

    Raises:
        ServiceError: If the vehicle fell silent or refused.
    """
    return (await missions.download(report=report))[_first(vehicle) :]


def _first(vehicle: StandardVehicle) -> int:
    """Return how many items stand before the first waypoint."""
    return 1 if vehicle.is_ardupilot else 0


_RELATIVE: Final = (
    grace.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    grace.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
)


def _is_same(kept: StandardItem, sent: StandardItem) -> bool:
    """Tell whether both are the same waypoint; autopilots write one frame for the other."""
    frames = (kept.frame, sent.frame)
    is_one_frame = kept.frame == sent.frame or all(frame in _RELATIVE for frame in frames)
    return (
        is_one_frame
        and kept.command == sent.command
        and max(abs(kept.x - sent.x), abs(kept.y - sent.y)) <= 1
        and abs(kept.z - sent.z) <= 0.01
        and abs(kept.parameters[0] - sent.parameters[0]) <= 0.5
    )
