"""Waypoints of vehicles of other makers: checked, uploaded, proved by read-back, and read.

===========  ==================================================  ============
state        what happened                                       then
===========  ==================================================  ============
any          waypoints are sent                                  ``uploading``
uploading    the vehicle gave back what was sent                 ``on_board``
uploading    the vehicle refused                                 ``refused``
uploading    silence, another content, cancelled, or a restart   ``unknown``
on_board     a read gave back another mission                    ``unknown``
unknown      a read gave back what was sent                      ``on_board``
===========  ==================================================  ============
"""

import asyncio
import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import datetime
from typing import Any, Literal, Protocol

from sqlalchemy.orm import Session

from autonomy.frames import ned_from_wgs84, wgs84_from_ned
from autonomy.site import Site
from db.query.station.events import add_event
from db.query.station.settings import get_setting, put_setting
from robot_link.mavlink.wire import grace
from robot_link.messages import RobotId
from robot_link.service.standard_item import StandardItem
from robot_link.station.error import ServiceError
from robot_link.station.standard_mission import MissionRefusedError, MissionUnprovedError, waypoint
from server.base.foundation import Foundation
from server.base.job import JobError, JobPerKey, JobProgress
from server.base.problem import FieldError, unprocessable
from server.fleet.capability import refuse_unless_able
from server.fleet.event import RobotReported
from server.fleet.fleet import Fleet
from server.fleet.words import sentence

State = Literal["none", "uploading", "on_board", "refused", "unknown"]


class WaypointRadio(Protocol):
    """The part of the links that carries missions of waypoints."""

    async def upload_waypoints(
        self,
        robot: RobotId,
        items: Sequence[StandardItem],
        report: Callable[[int, int], None],
    ) -> None:
        """Put waypoints on board and read them back."""
        ...

    async def read_waypoints(
        self, robot: RobotId, report: Callable[[int, int], None]
    ) -> Sequence[StandardItem]:
        """Return the waypoints on board."""
        ...


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A place to go to, in the water's frame."""

    north_m: float
    east_m: float
    depth_m: float
    hold_s: float = 0.0
    command: str = "waypoint"
    """What else an item on board asks for."""


@dataclass(slots=True)
class WaypointMission:
    """What is known of a vehicle's mission."""

    waypoints: tuple[Waypoint, ...] = ()
    """Those that were sent last."""
    state: State = "none"
    item: int | None = None
    """The waypoint that was refused, from 1."""
    message: str = ""
    sha256: str = ""
    """Of the items as they were sent."""
    proved_at: datetime | None = None
    on_vehicle: tuple[Waypoint, ...] = field(default_factory=tuple)
    read_at: datetime | None = None


class Waypoints:
    """Belongs to one event loop. What it knows of each vehicle outlives the station."""

    def __init__(self, foundation: Foundation, fleet: Fleet, radio: WaypointRadio) -> None:
        self._store = foundation.store
        self._clock = foundation.clock
        self._bus = foundation.bus
        self._fleet = fleet
        self._radio = radio
        self._jobs = JobPerKey[str](foundation.jobs, "waypoints")
        self._known: dict[str, WaypointMission] = {}

    async def of(self, robot: str) -> WaypointMission:
        """Return what is known of a vehicle's mission.

        Raises:
            Problem: 404 if there is no such robot.
        """
        site = self._fleet.status(robot).record.site
        if robot not in self._known:
            kept = await self._store.query(
                lambda session: get_setting(session, setting_name(robot))
            )
            self._known.setdefault(robot, restored_mission(kept, site))
        return self._known[robot]

    async def upload(self, robot: str, wanted: Sequence[Waypoint], *, by: str) -> str:
        """Begin to put waypoints on board; return the job's id.

        Raises:
            Problem: 404 for an unknown robot, 409 for one that takes no waypoints or whose
                waypoints are sent or read just now, 422 with the waypoint that lies outside of
                the water, above it or below its floor.
        """
        status = self._fleet.status(robot)
        refuse_unless_able(status, "waypoints")
        check_waypoints(wanted, status.record.site)
        mission = await self.of(robot)

        async def work(progress: JobProgress) -> Mapping[str, Any]:
            return await self._upload(robot, mission, tuple(wanted), by, progress)

        refusal = f"Waypoints of {robot} are sent or read just now; wait for that, or cancel it."
        return await self._jobs.start_alone(robot, work, refusal=refusal, by=by, robot=robot)

    async def read(self, robot: str, *, by: str) -> str:
        """Begin to read the mission on board; return the job's id.

        Raises:
            Problem: 404 for an unknown robot, 409 for one that takes no waypoints.
        """
        refuse_unless_able(self._fleet.status(robot), "waypoints")
        return await self._jobs.start(
            robot, lambda progress: self._read(robot, progress), by=by, robot=robot
        )

    async def _upload(
        self,
        robot: str,
        mission: WaypointMission,
        wanted: tuple[Waypoint, ...],
        by: str,
        progress: JobProgress,
    ) -> Mapping[str, Any]:
        site = self._fleet.status(robot).record.site
        items = [_item(one, site) for one in wanted]
        mission.waypoints, mission.state = wanted, "uploading"
        mission.message, mission.item, mission.proved_at = "", None, None
        mission.sha256 = _sha256(items)
        await self._store.write(lambda session: keep_mission(session, robot, mission, site))

        def follow(number: int, count: int) -> None:
            part = 0.9 * number / max(1, count)
            progress.report(part, f"{robot} has {number} of {count} waypoints.")

        try:
            await self._radio.upload_waypoints(RobotId(robot), items, follow)
        except MissionRefusedError as error:
            at = "" if error.item is None else f" at waypoint {error.item}"
            await self._end(robot, "refused", f"{robot} refused{at}: {error}", by, error.item)
            raise JobError(mission.message) from error
        except ServiceError as error:
            text = f"{sentence(error)} What {robot} holds is not known; read its mission."
            item = error.item if isinstance(error, MissionUnprovedError) else None
            await self._end(robot, "unknown", text, by, item)
            raise JobError(text) from error
        except asyncio.CancelledError:
            text = f"The upload was cancelled: what {robot} holds is not known; read its mission."
            await self._end(robot, "unknown", text, by)
            raise
        mission.proved_at = mission.read_at = self._clock.now()
        mission.on_vehicle = wanted
        text = f"{robot} holds {len(items)} waypoints: each was read back and is the one sent."
        await self._end(robot, "on_board", text, by)
        return {"waypoints": len(items), "sha256": mission.sha256}

    async def _end(
        self, robot: str, state: State, text: str, by: str, item: int | None = None
    ) -> None:
        mission, at = await self.of(robot), self._clock.now()
        site = self._fleet.status(robot).record.site
        mission.state, mission.message, mission.item = state, text.rstrip(".") + ".", item
        level = "info" if state == "on_board" else "watch"

        def write(session: Session) -> None:
            add_event(
                session, at, f"waypoints.{state}", mission.message, level=level, robot=robot,
                data={"by": by, "sha256": mission.sha256, "item": item},
            )  # fmt: skip
            keep_mission(session, robot, mission, site)

        await self._store.write(write)
        self._bus.publish(RobotReported(robot))

    async def _read(self, robot: str, progress: JobProgress) -> Mapping[str, Any]:
        mission, site = await self.of(robot), self._fleet.status(robot).record.site

        def follow(number: int, count: int) -> None:
            progress.report(number / max(1, count), f"{number} of {count} items are here.")

        try:
            items = await self._radio.read_waypoints(RobotId(robot), follow)
        except ServiceError as error:
            raise JobError(sentence(error)) from error
        mission.on_vehicle = tuple(_waypoint(one, site) for one in items)
        mission.read_at = self._clock.now()
        is_sent = bool(mission.sha256) and _sha256(items) == mission.sha256
        if mission.state == "on_board" and not is_sent:
            mission.state = "unknown"
            mission.message = f"{robot} holds another mission than the one that was sent."
        elif mission.state == "unknown" and is_sent:
            mission.state, mission.item, mission.proved_at = "on_board", None, mission.read_at
            mission.message = f"{robot} holds the {len(items)} waypoints that were sent."
        await self._store.write(lambda session: keep_mission(session, robot, mission, site))
        return {"items": len(items)}


def check_waypoints(wanted: Sequence[Waypoint], site: Site) -> None:
    """Refuse waypoints that no vehicle can go to in this water.

    Raises:
        Problem: 422 with the field of each that is wrong.
    """
    errors: list[FieldError] = []
    for number, one in enumerate(wanted):
        where = f"waypoint {number + 1}"
        name = "depth_m"
        if one.depth_m < 0.0:
            message = f"{where} is {-one.depth_m:g} m above the surface"
        elif site.clearance_m(one.north_m, one.east_m) <= 0.0:
            name, message = "north_m", f"{where} lies outside of {site.name}"
        elif one.depth_m > (floor_m := float(site.floor_m(one.north_m, one.east_m))):
            message = f"{where} at {one.depth_m:g} m is below the floor, {floor_m:.1f} m there"
        else:
            continue
        errors.append(FieldError(loc=["body", "waypoints", number, name], msg=message))
    if errors:
        raise unprocessable(f"{errors[0].msg}.", errors)


def _item(one: Waypoint, site: Site) -> StandardItem:
    place = wgs84_from_ned(
        (one.north_m, one.east_m), site.origin_latitude_deg, site.origin_longitude_deg
    )
    return waypoint(float(place[0]), float(place[1]), one.depth_m, one.hold_s)


def _waypoint(item: StandardItem, site: Site) -> Waypoint:
    ned = ned_from_wgs84(
        item.x / 1e7, item.y / 1e7, site.origin_latitude_deg, site.origin_longitude_deg
    )
    known = grace.enums["MAV_CMD"].get(item.command)
    name = f"command {item.command}" if known is None else known.name
    words = name.removeprefix("MAV_CMD_").removeprefix("NAV_").lower().replace("_", " ")
    return Waypoint(float(ned[0]), float(ned[1]), -item.z, item.parameters[0], words)


def _sha256(items: Sequence[StandardItem]) -> str:
    """Return our own hash of the items, to the precision that autopilots keep."""
    rows = [[one.command, one.x, one.y, round(one.z, 2)] for one in items]
    return hashlib.sha256(json.dumps(rows).encode()).hexdigest()


def setting_name(robot: str) -> str:
    """Return the name of the setting that keeps what is known of a vehicle's mission."""
    return f"waypoints of {robot}"


def keep_mission(session: Session, robot: str, mission: WaypointMission, site: Site) -> None:
    """Write down what is known; of an upload that the station does not outlive, nothing is."""
    document: dict[str, Any] = asdict(mission) | {"origin_deg": _origin(site)}
    for key in ("proved_at", "read_at"):
        document[key] = document[key] and document[key].isoformat()
    if mission.state == "uploading":
        document["state"] = "unknown"
        document["message"] = (
            f"The station stopped while it sent them. What {robot} holds is not known; read its"
            " mission."
        )
    put_setting(session, setting_name(robot), document)


def restored_mission(document: Mapping[str, Any] | None, site: Site) -> WaypointMission:
    """Return what was written down; in another water its waypoints are no places any more."""
    if document is None or document["origin_deg"] != _origin(site):
        return WaypointMission()
    kept = {key: value for key, value in document.items() if key != "origin_deg"}
    for key in ("waypoints", "on_vehicle"):
        kept[key] = tuple(Waypoint(**one) for one in kept[key])
    for key in ("proved_at", "read_at"):
        kept[key] = kept[key] and datetime.fromisoformat(kept[key])
    return WaypointMission(**kept)


def _origin(site: Site) -> list[float]:
    return [site.origin_latitude_deg, site.origin_longitude_deg]
