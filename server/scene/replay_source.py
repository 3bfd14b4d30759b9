"""A robot as the 3D view of a replay draws it: all of one deployment at hand, cut at a moment."""

from bisect import bisect_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Literal

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray, IntArray
from autonomy.channel import ChannelCatalogue
from autonomy.field.fidelity import fidelity_level
from autonomy.site import Area, Site
from autonomy.vehicle.hull import Hull
from db.deployment_span import Period
from db.query.camera.fixes import newest_fix
from db.query.fleet.deployments import deployment_at
from db.query.fleet.robots import RobotRecord
from db.query.measured.maps import get_maps, map_times
from db.query.measured.moment import KnownThen, known_then
from db.query.measured.telemetry import Track, leg_flown, track
from db.query.mission.plans import plan_on_board_at
from robot_link.messages import RobotId, RobotMode
from server.fleet.status import PlanInHand
from server.fleet.trail import DRIFT_MODES
from server.map.record import view_of
from server.plan.ledger import in_hand
from server.scene.drawing import camera_fix_view, plan_view, target_path
from webui.scene.source import (
    CameraFixView,
    CameraView,
    ComparisonView,
    MapView,
    PlanView,
    Pose,
    PredictedView,
    SampleView,
    TargetView,
    TrackPiece,
)

Clock = Literal["measured", "received"]
"""What a moment is held against: when something was measured, or when the station heard of it."""
_TRACK_POINTS = 4000
_AROUND = timedelta(days=1)
"""How far the track goes of a robot that was in no deployment."""
_ANGLES = ("roll_rad", "pitch_rad", "heading_rad", "tail_rad")


@dataclass(frozen=True, slots=True)
class Recorded:
    """What is drawn of one stretch of a robot's past, read once."""

    robot: RobotId
    name: str
    site: Site
    """Of its deployment; of a robot in the workshop its water now."""
    period: Period
    read_at: datetime
    """What came later is not among it."""
    track: Track
    """Of the whole period, thinned."""
    maps: tuple[tuple[int, str, str, datetime], ...]
    """Key, variable, model and moment of each map that was kept in it, the oldest first."""

    def holds(self, at: datetime, now: datetime) -> bool:
        """Tell whether a moment is of this stretch, and everything of it had been read."""
        last = self.period.last
        return self.period.first <= at <= (now if last is None else last) and (
            at <= self.read_at or (last is not None and last <= self.read_at)
        )


def recorded_around(session: Session, record: RobotRecord, at: datetime, now: datetime) -> Recorded:
    """Read what is drawn of the deployment that a moment belongs to.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    deployment = deployment_at(session, record.id, at)
    if deployment is None:
        period, site = Period(at - _AROUND, at + _AROUND), record.site
    else:
        period, site = deployment.period, deployment.site
    kept = [one for one in map_times(session, record.id) if _holds(period, one[3])]
    return Recorded(
        robot=record.id,
        name=record.name,
        site=site,
        period=period,
        read_at=now,
        track=track(session, record.id, period.first, period.last, _TRACK_POINTS),
        maps=tuple(sorted(kept, key=lambda one: (one[3], one[0]))),
    )


def _holds(period: Period, at: datetime) -> bool:
    return period.first <= at and (period.last is None or at <= period.last)


@dataclass(frozen=True, slots=True)
class Moment:
    """What is drawn of one moment beside what ``Recorded`` has."""

    at: datetime
    clock: Clock
    pose: Pose | None
    plan: PlanInHand | None
    """The one on board, as far as that was proved."""
    leg: int | None
    maps: tuple[MapView, ...]
    """The newest kept of each model of one variable until then, the newest first."""
    camera_fix: CameraFixView | None = None
    """Where cameras had seen the robot."""


def moment_of(
    session: Session,
    recorded: Recorded,
    at: datetime,
    clock: Clock,
    known_map: Callable[[int], MapView | None],
) -> Moment:
    """Read what is drawn of a moment.

    Args:
        session: A reading session.
        recorded: The stretch that it is of.
        at: The moment.
        clock: What it is held against.
        known_map: Returns a map that was drawn before, by its key.
    """
    robot = recorded.robot
    heard_by = at if clock == "received" else None
    known = known_then(session, robot, at, (), ranges={}, heard_by=heard_by)
    plan = plan_on_board_at(session, robot, at)
    leg = None
    if plan is not None and plan.sha256 is not None and plan.state == "running":
        leg = leg_flown(session, robot, plan.sha256, at)
    maps = [known_map(key) for key in newest_maps(recorded, at)]
    fix = newest_fix(session, robot, is_taken=True, at=at, heard_by=heard_by)
    return Moment(
        at=at,
        clock=clock,
        pose=_pose(known),
        plan=None if plan is None else in_hand(plan),
        leg=leg,
        maps=tuple(one for one in maps if one is not None),
        camera_fix=None if fix is None else camera_fix_view(fix.fix, at),
    )


def map_reader(
    session: Session, robot: RobotId, channels: ChannelCatalogue, drawn: Mapping[int, MapView]
) -> Callable[[int], MapView | None]:
    """Return what reads a kept map by its key, unless it was drawn before."""

    def read(key: int) -> MapView | None:
        if key in drawn:
            return drawn[key]
        record = get_maps(session, robot, [key]).get(key)
        if record is None or record.variable not in channels:
            return None
        return replace(view_of(record, channels[record.variable]), version=key)

    return read


def newest_maps(recorded: Recorded, at: datetime) -> list[int]:
    """Return keys of the newest map of each model of the newest variable, the newest first."""
    count = bisect_right(recorded.maps, at, key=lambda one: one[3])
    found: dict[str, int] = {}
    variable = recorded.maps[count - 1][1] if count else ""
    for key, of_variable, model, _ in reversed(recorded.maps[:count]):
        if of_variable == variable:
            found.setdefault(model, key)
    return list(found.values())


def _pose(known: KnownThen) -> Pose | None:
    place = known.place
    if place is None:
        return None
    told = {
        name: 0.0 if name not in known.reported else known.reported[name].value for name in _ANGLES
    }
    return Pose(
        measured_at=place.measured_at,
        position_ned=place.position_ned,
        position_std_m=place.position_std_m if np.isfinite(place.position_std_m) else 0.0,
        mode=RobotMode(0) if known.mode is None else known.mode,
        is_old=True,
        **told,
    )


class ReplaySource:
    """The ``webui.scene.source.SceneSource`` of a replay: what it shows is set moment by moment.

    One thread moves it and draws it. Fidelity levels are those that its thresholds part now.
    """

    def __init__(self, recorded: Recorded, hull: Hull, thresholds_m: tuple[float, ...]) -> None:
        self._recorded = recorded
        self._hull = hull
        self._thresholds_m = thresholds_m
        self._moment: Moment | None = None
        self._plan: PlanView | None = None
        way = recorded.track
        self._measured_s = np.array([one.timestamp() for one in way.measured_at])
        self._received_s = way.received_us / 1e6
        self._drawn: IntArray = np.empty(0, np.int64)
        """Which points of the track are drawn, by their places in it."""

    @property
    def recorded(self) -> Recorded:
        """Return the stretch that it is of."""
        return self._recorded

    def show(self, moment: Moment) -> None:
        """Show another moment from the next drawing on."""
        hand, before = moment.plan, self._moment
        self._moment = moment
        if hand is None or not hand.legs:
            self._plan = None
        elif (
            self._plan is None
            or before is None
            or before.plan is None
            or (before.plan.plan_id, before.plan.state, before.leg)
            != (hand.plan_id, hand.state, moment.leg)
        ):
            self._plan = plan_view(hand, moment.leg)

    @property
    def robot(self) -> RobotId:
        """Return the robot's id."""
        return self._recorded.robot

    @property
    def title(self) -> str:
        """Return the robot's display name, marked."""
        return f"{self._recorded.name} in replay, not live"

    @property
    def hull(self) -> Hull:
        """Return the robot's outer sizes."""
        return self._hull

    @property
    def site(self) -> Site:
        """Return the water that the robot was in."""
        return self._recorded.site

    @property
    def fidelity_levels(self) -> int:
        """Return how many fidelity levels the track distinguishes."""
        return len(self._thresholds_m) + 1

    def pose(self) -> Pose | None:
        """Return where the robot was; it never looks alive."""
        return None if self._moment is None else self._moment.pose

    def predicted(self) -> PredictedView | None:
        """Return nothing: what was predicted then is not kept."""
        return None

    def camera_fix(self) -> CameraFixView | None:
        """Return where cameras had seen the robot."""
        return None if self._moment is None else self._moment.camera_fix

    def camera_views(self) -> tuple[CameraView, ...]:
        """Return nothing: where cameras hung then is not drawn."""
        return ()

    def known(self) -> IntArray:
        """Return which points of the track were known at the moment, by their places in it."""
        moment = self._moment
        if moment is None:
            return np.empty(0, np.int64)
        until = moment.at.timestamp()
        is_known = self._measured_s <= until
        if moment.clock == "received":
            is_known &= self._received_s <= until
        return np.flatnonzero(is_known)

    def track_since(self, cursor: int) -> TrackPiece:
        """Return the way from what is drawn on, or the whole way until then if that goes back."""
        way, drawn, wanted = self._recorded.track, self._drawn, self.known()
        goes_on = cursor > 0 and np.array_equal(wanted[: len(drawn)], drawn)
        self._drawn = wanted
        new = wanted[len(drawn) :] if goes_on else wanted
        std = way.position_std_m[new]
        return TrackPiece(
            cursor=1,
            restarted=not goes_on,
            position_ned=way.position_ned[new],
            position_std_m=std,
            fidelity=fidelity_level(std, self._thresholds_m),
            is_adrift=np.array([way.mode[one] in DRIFT_MODES for one in new], dtype=np.bool_),
        )

    def plan(self) -> PlanView | None:
        """Return the plan that was on board."""
        return self._plan

    def maps(self) -> tuple[str, ...]:
        """Return the models of the newest map's variable."""
        return () if self._moment is None else tuple(one.model for one in self._moment.maps)

    def map_view(self, model: str) -> MapView | None:
        """Return the map of a model as it was kept last before then."""
        maps = () if self._moment is None else self._moment.maps
        return next((one for one in maps if one.model == model), None)

    def comparison(self) -> ComparisonView | None:
        """Return nothing: a what-if run is of nobody's past."""
        return None

    def samples(self) -> SampleView | None:
        """Return nothing: which samples a kept map was made of is not kept with it."""
        return None

    def keep_outs(self) -> tuple[Area, ...]:
        """Return what the plan on board kept out of."""
        hand = None if self._moment is None else self._moment.plan
        areas = [] if hand is None else hand.record.config.get("keep_outs", [])
        return tuple(Area.model_validate(area) for area in areas)

    def target(self) -> TargetView | None:
        """Return nothing: of a target only the path that its plan promised is drawn."""
        return None

    def target_path(self) -> FloatArray | None:
        """Return where a virtual target of the plan was to go."""
        hand = None if self._moment is None else self._moment.plan
        return None if hand is None else target_path(hand)
