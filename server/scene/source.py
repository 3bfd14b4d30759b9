"""Gives the 3D scene what it may draw of each robot."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.prediction import ellipse_90
from autonomy.site import Area, Site
from autonomy.tracking.phase import TargetPhase
from autonomy.vehicle.hull import Hull
from robot_link.messages import RobotId
from robot_link.report import TargetReport
from server.camera.rig import CameraRig
from server.camera.used_rig import UsedRig
from server.fix.fusion import Fusion
from server.fleet.fleet import Fleet
from server.fleet.status import PlanInHand, RobotStatus
from server.map.field_maps import FieldMaps
from server.prediction.predictions import PredictedPath, Predictions
from server.scene.drawing import (
    camera_fix_view,
    camera_views,
    plan_view,
    pose_of,
    target_depth_m,
    target_path,
)
from server.study.comparison_view import ShownWhatIfs
from server.vehicle.vehicles import Vehicles
from webui.scene.source import (
    CameraFixView,
    CameraView,
    ComparisonView,
    MapView,
    PlanView,
    Pose,
    PredictedView,
    SampleView,
    TargetHypothesis,
    TargetView,
    TrackPiece,
)

_SEEN_M, _SEEN_SHARE = 0.05, 0.05
"""A predicted place is drawn anew once it is off by so much, or by this part of its ellipse."""


class StationSceneSource:
    """The ``webui.scene.source.SceneSource`` of one robot of the station."""

    def __init__(
        self,
        robot: RobotId,
        fleet: Fleet,
        maps: FieldMaps,
        vehicles: Vehicles,
        whatifs: ShownWhatIfs,
        predictions: Predictions,
        fusion: Fusion,
        rig: CameraRig,
    ) -> None:
        self._robot = robot
        self._fleet = fleet
        self._maps = maps
        self._vehicles = vehicles
        self._whatifs = whatifs
        self._predictions = predictions
        self._fusion, self._rig = fusion, rig
        self._predicted: PredictedView | None = None
        self._camera_fix: CameraFixView | None = None
        self._views_of: UsedRig | None = None
        self._camera_views: tuple[CameraView, ...] = ()
        self._plan: tuple[PlanInHand, int | None, PlanView] | None = None
        self._kept_out_by: PlanInHand | None = None
        self._keep_outs: tuple[Area, ...] = ()
        self._target: tuple[TargetReport, bool, TargetView] | None = None
        self._path_of: PlanInHand | None = None
        self._path: FloatArray | None = None

    @property
    def robot(self) -> RobotId:
        """Return the robot's id."""
        return self._robot

    @property
    def title(self) -> str:
        """Return the robot's display name."""
        return self._status.record.name

    @property
    def hull(self) -> Hull:
        """Return the robot's outer sizes, those of a usual one where its vehicle is unknown."""
        vehicle = self._vehicles.find(self._status.record.model)
        return Hull() if vehicle is None else vehicle.hull

    @property
    def site(self) -> Site:
        """Return the water that the robot works in."""
        return self._status.record.site

    @property
    def fidelity_levels(self) -> int:
        """Return how many fidelity levels the track distinguishes."""
        return self._status.track.levels

    def pose(self) -> Pose | None:
        """Return the newest pose."""
        state = self._status.state
        if state is None:
            return None
        return pose_of(state, is_old=self._fleet.is_old(self._status))

    def predicted(self) -> PredictedView | None:
        """Return where the robot should be that is not heard, anew once that looks otherwise."""
        path = self._predictions.path(self._robot)
        if path is None:
            self._predicted = None
            return None
        view = _predicted_view(path, self._predictions.age_s(path.said_at))
        if self._predicted is None or _looks_otherwise(view, self._predicted):
            self._predicted = view
        return self._predicted

    def camera_fix(self) -> CameraFixView | None:
        """Return where cameras saw the robot last, anew once that looks otherwise."""
        fix = self._fusion.newest(self._robot)
        view = None if fix is None else camera_fix_view(fix, self._fleet.now())
        if view != self._camera_fix:
            self._camera_fix = view
        return self._camera_fix

    def camera_views(self) -> tuple[CameraView, ...]:
        """Return what the cameras look at that robots are found by."""
        rig = self._rig.rig
        if rig is not self._views_of:
            self._views_of = rig
            self._camera_views = () if rig is None else camera_views(rig)
        return self._camera_views

    def track_since(self, cursor: int) -> TrackPiece:
        """Return the track from ``cursor`` on."""
        return self._status.track.since(cursor)

    def plan(self) -> PlanView | None:
        """Return the plan to draw; the same object as long as nothing about it changed."""
        hand, leg_now = self._status.plan, self._status.leg_now
        if hand is None or not hand.legs:
            return None
        if self._plan is None or self._plan[:2] != (hand, leg_now):
            self._plan = (hand, leg_now, plan_view(hand, leg_now))
        return self._plan[2]

    def maps(self) -> tuple[str, ...]:
        """Return the models of the map, the default first."""
        views = self._maps.views(self._robot)
        variable = next((key for key, _ in views), None)
        return tuple(model for key, model in views if key == variable)

    def map_view(self, model: str) -> MapView | None:
        """Return the newest map of a model."""
        views = self._maps.views(self._robot)
        return next((view for (_, one), view in views.items() if one == model), None)

    def comparison(self) -> ComparisonView | None:
        """Return the what-if run to draw; the same object as long as nothing about it changed."""
        return self._whatifs.view(self._robot)

    def samples(self) -> SampleView | None:
        """Return the samples behind the maps; the same object as long as there is none to add."""
        return self._maps.samples(self._robot)

    def keep_outs(self) -> tuple[Area, ...]:
        """Return what the plan in hand keeps out of."""
        hand = self._status.plan
        if hand is not self._kept_out_by:
            self._kept_out_by = hand
            areas = [] if hand is None else hand.record.config.get("keep_outs", [])
            self._keep_outs = tuple(Area.model_validate(area) for area in areas)
        return self._keep_outs

    def target(self) -> TargetView | None:
        """Return the target that the robot follows; the same object as long as nothing changed."""
        report = self._fleet.target_shown(self._status)
        if report is None:
            return None
        is_old = self._fleet.is_target_old(report)
        if self._target is None or self._target[:2] != (report, is_old):
            self._target = (report, is_old, self._target_view(report, is_old=is_old))
        return self._target[2]

    def target_path(self) -> FloatArray | None:
        """Return where a virtual target of the plan in hand goes."""
        hand = self._status.plan
        if hand is not self._path_of:
            self._path_of = hand
            self._path = None if hand is None else target_path(hand)
        return self._path

    def _target_view(self, report: TargetReport, *, is_old: bool) -> TargetView:
        hand, state = self._status.plan, self._status.state
        depth_m = 0.0 if hand is None else target_depth_m(hand)
        hears = report.phase in (TargetPhase.TRACKING, TargetPhase.WAITING)
        return TargetView(
            measured_at=report.measured_at,
            robot_ned=(*report.position_ne_m, 0.0 if state is None else state.position_ned[2]),
            hypotheses=tuple(
                TargetHypothesis((*one.position_ne_m, depth_m), one.covariance_m2, one.weight)
                for one in report.hypotheses
            ),
            range_m=report.range_m if hears and not is_old else None,
            true_ned=None if report.true_ne_m is None else (*report.true_ne_m, depth_m),
            is_old=is_old or report.phase is TargetPhase.LOST,
            is_barrier_on=report.is_barrier_on or report.phase is TargetPhase.ENDED,
        )

    @property
    def _status(self) -> RobotStatus:
        return self._fleet.status(self._robot)


def _predicted_view(path: PredictedPath, age_s: float) -> PredictedView:
    place, covariance = path.at(age_s)
    axes, direction = ellipse_90(covariance)
    found = path.prediction
    north, east, depth = place.tolist()
    return PredictedView(
        position_ned=(north, east, depth),
        ellipse_m=axes,
        ellipse_rad=direction,
        way_ned=np.vstack([found.position_ned[found.age_s < age_s], place]),
        label=f"predicted; last heard {path.said_at:%H:%M:%SZ}",
    )


def _looks_otherwise(view: PredictedView, shown: PredictedView) -> bool:
    """Tell whether a predicted place is seen to be another than the one that is shown."""
    least_m = max(_SEEN_M, _SEEN_SHARE * shown.ellipse_m[0])
    moved_m = np.subtract(view.position_ned, shown.position_ned)
    grown_m = np.subtract(view.ellipse_m, shown.ellipse_m)
    change_m = float(max(np.linalg.norm(moved_m), np.abs(grown_m).max()))
    return view.label != shown.label or change_m > least_m
