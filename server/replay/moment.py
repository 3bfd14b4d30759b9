"""Reads what is known of a robot at a moment: one question, whatever the pages show of it."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy.orm import Session

from autonomy.channel import ChannelCatalogue
from autonomy.frames import LocalGeodetic
from autonomy.seawater import MEASURED
from autonomy.site import Site
from db.deployment_span import Period
from db.query.camera.fixes import FixRecord, newest_fix
from db.query.fleet.deployments import DeploymentRecord, deployment_at
from db.query.log_book.told import GROUP_OF
from db.query.measured.maps import map_times
from db.query.measured.moment import Beside, KnownThen, PlaceThen, ValueThen, beside, known_then
from db.query.measured.telemetry import leg_flown
from db.query.mission.plans import PlanRecord, plan_on_board_at
from db.query.station.alarms import AlarmRecord, alarms_standing_at
from db.query.station.events import EventFilter, EventRecord, newest_events
from robot_link.messages import STATE, LogId, RobotId, Sample
from server.fleet.panel import FIELD_LIMIT_S
from server.fleet.view import ChannelView, PositionView
from server.fleet.words import camera_fix_text
from server.link.derived import derived_values

_ALARMS_MAX = 50
MARKS_MAX = 2000
AROUND = timedelta(hours=12)
"""How far a replay reaches about a moment at which the robot was in no deployment."""
LOGGED = tuple(GROUP_OF)
"""Kinds of events that a replay goes to: those of the log book."""


@dataclass(frozen=True, slots=True)
class RobotThen:
    """What is known of a robot at a moment."""

    at: datetime
    site: Site
    deployment: DeploymentRecord | None
    known: KnownThen
    plan: PlanRecord | None
    leg: int | None
    alarms: list[AlarmRecord]
    maps: list[tuple[int, str, str, datetime]]
    """Key, variable, model and moment of the newest that was kept of each."""
    beside: Beside
    fix: FixRecord | None
    """The newest by cameras that was not refused."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """The time around a moment that belongs together."""

    deployment: DeploymentRecord | None
    period: Period
    marks: list[EventRecord]
    is_cut: bool


def robot_then(
    session: Session,
    robot: RobotId,
    workshop: Site,
    at: datetime,
    told: Collection[str],
    channels: ChannelCatalogue,
    *,
    heard: bool,
) -> RobotThen:
    """Read what is known of a robot at a moment.

    Args:
        session: A reading session.
        robot: Id of the robot.
        workshop: Its water where it was in no deployment.
        at: The moment.
        told: Columns of its state reports that it ever told.
        channels: What can be measured; what cannot be true of one counts as little as it did live.
        heard: Whether only what the station had heard by then counts.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    deployment = deployment_at(session, robot, at)
    plan = plan_on_board_at(session, robot, at)
    leg = None
    if plan is not None and plan.sha256 is not None and plan.state == "running":
        leg = leg_flown(session, robot, plan.sha256, at)
    first = at - AROUND if deployment is None else deployment.begun_at
    newest: dict[tuple[str, str], tuple[int, str, str, datetime]] = {}
    for one in map_times(session, robot):
        if first <= one[3] <= at and one[3] >= newest.get(one[1:3], one)[3]:
            newest[one[1:3]] = one
    return RobotThen(
        at=at,
        site=workshop if deployment is None else deployment.site,
        deployment=deployment,
        known=known_then(
            session,
            robot,
            at,
            told,
            ranges={key: (one.low, one.high) for key, one in channels.items()},
            heard_by=at if heard else None,
        ),
        plan=plan,
        leg=leg,
        alarms=alarms_standing_at(session, robot, at, _ALARMS_MAX),
        maps=sorted(newest.values(), key=lambda one: one[3], reverse=True),
        beside=beside(session, robot, at, LOGGED),
        fix=newest_fix(session, robot, is_taken=True, at=at, heard_by=at if heard else None),
    )


def stretch_around(session: Session, robot: RobotId, at: datetime, now: datetime) -> Stretch:
    """Read the time around a moment: its deployment, or the hours about it.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    deployment = deployment_at(session, robot, at)
    period = Period(at - AROUND, min(at + AROUND, now)) if deployment is None else deployment.period
    wanted = EventFilter(robot=robot, kinds=LOGGED, period=period)
    marks = newest_events(session, wanted, MARKS_MAX + 1)
    return Stretch(deployment, period, marks[-MARKS_MAX:], len(marks) > MARKS_MAX)


class ChannelsThen:
    """Makes gauges of what was known at a moment, as ``FleetViews`` does of what is known now."""

    def __init__(self, catalogue: ChannelCatalogue, speed: float) -> None:
        self._catalogue = catalogue
        self._speed = max(1.0, speed)
        """By which a demo's clock runs faster, and values grow old slower."""

    def channels(self, robot: RobotId, then: RobotThen) -> dict[str, ChannelView]:
        """Return the newest value of every channel, with its age at the moment."""
        known = then.known
        found = self._reported(known.reported, then.at)
        measured = known.measured
        for key, one in measured.items():
            found[key] = self._field(key, one, then.at)
        for key, sample in self._derived(robot, then, measured).items():
            if key not in found:
                told = ValueThen(key, sample.value, sample.measured_at, None)
                found[key] = self._field(key, told, then.at, is_derived=True)
        return found

    def _reported(self, told: Mapping[str, ValueThen], at: datetime) -> dict[str, ChannelView]:
        found: dict[str, ChannelView] = {}
        for key, gauge in STATE.gauges.items():
            parts = [told.get(part) for part in STATE.parts_of_norm(key) or (key,)]
            values = [part for part in parts if part is not None and math.isfinite(part.value)]
            if len(values) < len(parts):
                continue
            oldest = min(values, key=lambda one: one.measured_at)
            found[key] = ChannelView(
                value=values[0].value
                if len(values) == 1
                else math.hypot(*(one.value for one in values)),
                unit=STATE[key].unit,
                display_unit=STATE[key].display_unit,
                measured_at=oldest.measured_at,
                received_at=oldest.received_at or oldest.measured_at,
                age_s=(at - oldest.measured_at).total_seconds(),
                limit_s=gauge.limit_s * self._speed,
            )
        return found

    def _field(
        self, key: str, told: ValueThen, at: datetime, *, is_derived: bool = False
    ) -> ChannelView:
        return ChannelView(
            value=told.value,
            unit=self._catalogue[key].unit,
            display_unit=None,
            measured_at=told.measured_at,
            received_at=told.received_at or told.measured_at,
            age_s=(at - told.measured_at).total_seconds(),
            limit_s=FIELD_LIMIT_S * self._speed,
            is_derived=is_derived,
        )

    def _derived(
        self, robot: RobotId, then: RobotThen, measured: Mapping[str, ValueThen]
    ) -> dict[str, Sample]:
        """Return what follows of the water that was measured last."""
        place = then.known.place
        if "temperature" not in measured or place is None:
            return {}
        samples = {
            key: Sample(
                robot,
                LogId(0),
                0,
                key,
                one.value,
                place.position_ned,
                place.position_std_m,
                one.measured_at,
                one.measured_at,
            )
            for key, one in measured.items()
            if key in MEASURED
        }
        return derived_values(samples, then.site, self._catalogue)


def position_then(place: PlaceThen, site: Site, at: datetime) -> PositionView:
    """Return a place with its age at a moment."""
    latitude_deg, longitude_deg = LocalGeodetic().at(
        *place.position_ned[:2], site.origin_latitude_deg, site.origin_longitude_deg
    )
    return PositionView(
        ned_m=place.position_ned,
        std_m=place.position_std_m if math.isfinite(place.position_std_m) else None,
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        has_fix=place.has_fix,
        measured_at=place.measured_at,
        received_at=place.received_at,
        age_s=(at - place.measured_at).total_seconds(),
        fix_text=camera_fix_text(None) if place.has_fix and place.is_by_cameras else "",
    )
