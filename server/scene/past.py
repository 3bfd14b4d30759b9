"""A robot at a moment of the past, as the station believed it then: read once, and then still."""

from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray
from autonomy.channel import ChannelCatalogue
from autonomy.field.fidelity import fidelity_level
from autonomy.site import Area, Site
from autonomy.vehicle.hull import Hull
from db.deployment_span import Period
from db.query.fleet.deployments import deployment_at
from db.query.measured.maps import newest_maps
from db.query.measured.telemetry import Track, leg_flown, newest_state, track
from db.query.mission.plans import plan_on_board_at
from robot_link.messages import RobotId, StateReport
from server.fleet.status import PlanInHand, RobotStatus
from server.fleet.trail import DRIFT_MODES
from server.map.record import view_of
from server.plan.ledger import in_hand
from server.scene.drawing import plan_view, pose_of, target_path
from webui.scene.source import (
    ComparisonView,
    MapView,
    PlanView,
    Pose,
    PredictedView,
    SampleView,
    TargetView,
    TrackPiece,
)

_TRACK_POINTS = 4000
_BEFORE = timedelta(days=1)
"""How far back the track goes of a robot that was in no deployment."""


@dataclass(frozen=True, slots=True)
class PastKnowledge:
    """What the station had heard of a robot by a moment."""

    robot: RobotId
    at: datetime
    name: str
    site: Site
    """Of its deployment then; of a robot in the workshop its water now."""
    state: StateReport | None
    """Its newest word that had arrived, whenever it was measured."""
    track: Track
    plan: PlanInHand | None
    """The one on board, as far as that was proved."""
    leg: int | None
    maps: tuple[MapView, ...]
    """The newest that was kept of each in its deployment until then, the newest first."""


def known_at(
    session: Session, status: RobotStatus, at: datetime, channels: ChannelCatalogue
) -> PastKnowledge:
    """Return what the station knew of a robot at a moment.

    Of a recording, which nobody heard, it is what was measured until then.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    record = status.record
    robot, heard_by = record.id, None if record.kind == "recorded" else at
    deployment = deployment_at(session, robot, at)
    start = at - _BEFORE if deployment is None else deployment.begun_at
    plan = plan_on_board_at(session, robot, at)
    leg = None
    if plan is not None and plan.sha256 is not None and plan.state == "running":
        leg = leg_flown(session, robot, plan.sha256, at)
    kept = newest_maps(session, robot, Period(start, at))
    views = [view_of(one, channels[one.variable]) for one in kept if one.variable in channels]
    views.sort(key=lambda view: view.updated_at or start, reverse=True)
    return PastKnowledge(
        robot=robot,
        at=at,
        name=record.name,
        site=record.site if deployment is None else deployment.site,
        state=None if heard_by is None else newest_state(session, robot, heard_by=at),
        track=track(session, robot, start, at, _TRACK_POINTS, heard_by=heard_by),
        plan=None if plan is None else in_hand(plan),
        leg=leg,
        maps=tuple(views),
    )


class PastSceneSource:
    """The ``webui.scene.source.SceneSource`` of a robot at a moment; nothing of it ever changes.

    Fidelity levels are those that its thresholds part now.
    """

    def __init__(self, known: PastKnowledge, hull: Hull, thresholds_m: tuple[float, ...]) -> None:
        self._known = known
        self._hull = hull
        self._thresholds_m = thresholds_m
        hand = known.plan
        self._plan = None if hand is None or not hand.legs else plan_view(hand, known.leg)
        self._target_path = None if hand is None else target_path(hand)

    @property
    def robot(self) -> RobotId:
        """Return the robot's id."""
        return self._known.robot

    @property
    def title(self) -> str:
        """Return the robot's display name with the moment."""
        return f"{self._known.name} at {self._known.at:%Y-%m-%d %H:%M:%SZ}, not live"

    @property
    def hull(self) -> Hull:
        """Return the robot's outer sizes."""
        return self._hull

    @property
    def site(self) -> Site:
        """Return the water that the robot was in."""
        return self._known.site

    @property
    def fidelity_levels(self) -> int:
        """Return how many fidelity levels the track distinguishes."""
        return len(self._thresholds_m) + 1

    def pose(self) -> Pose | None:
        """Return the newest pose that was heard of by then; it never looks alive."""
        state = self._known.state
        return None if state is None else pose_of(state, is_old=True)

    def predicted(self) -> PredictedView | None:
        """Return nothing: what was predicted then is not kept."""
        return None

    def track_since(self, cursor: int) -> TrackPiece:
        """Return the whole track at first, and nothing after it."""
        way = self._known.track
        begin = 0 if cursor == 0 else len(way.position_ned)
        std = way.position_std_m[begin:]
        return TrackPiece(
            cursor=1,
            restarted=cursor == 0,
            position_ned=way.position_ned[begin:],
            position_std_m=std,
            fidelity=fidelity_level(std, self._thresholds_m),
            is_adrift=np.array([mode in DRIFT_MODES for mode in way.mode[begin:]], dtype=np.bool_),
        )

    def plan(self) -> PlanView | None:
        """Return the plan that was on board."""
        return self._plan

    def maps(self) -> tuple[str, ...]:
        """Return the models of the newest map's variable."""
        maps = self._known.maps
        return tuple(one.model for one in maps if one.variable.key == maps[0].variable.key)

    def map_view(self, model: str) -> MapView | None:
        """Return the map of a model as it was kept last before then."""
        maps = self._known.maps
        of_it = (one for one in maps if one.variable.key == maps[0].variable.key)
        return next((one for one in of_it if one.model == model), None)

    def comparison(self) -> ComparisonView | None:
        """Return nothing: a what-if run is of nobody's past."""
        return None

    def samples(self) -> SampleView | None:
        """Return nothing: which samples a kept map was made of is not kept with it."""
        return None

    def keep_outs(self) -> tuple[Area, ...]:
        """Return what the plan on board kept out of."""
        hand = self._known.plan
        areas = [] if hand is None else hand.record.config.get("keep_outs", [])
        return tuple(Area.model_validate(area) for area in areas)

    def target(self) -> TargetView | None:
        """Return nothing: of a target only the path that its plan promised is drawn."""
        return None

    def target_path(self) -> FloatArray | None:
        """Return where a virtual target of the plan was to go."""
        return self._target_path
