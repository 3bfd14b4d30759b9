"""States and plans as the scene draws them."""

import math
from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.prediction import ellipse_90
from db.query.mission.plans import ENDED_STATES
from db.record import same
from robot_link.camera.fix import CameraFix
from robot_link.messages import StateReport
from server.camera.used_rig import UsedRig
from server.fleet.status import PlanInHand
from webui.scene.source import BandView, CameraFixView, CameraView, PlanView, Pose


def pose_of(state: StateReport, *, is_old: bool) -> Pose:
    """Return a state as a pose; an angle that nobody told is drawn as 0."""
    told = (state.roll_rad, state.pitch_rad, state.heading_rad, state.tail_rad)
    roll, pitch, heading, tail = (0.0 if math.isnan(one) else one for one in told)
    return same(
        Pose,
        state,
        position_std_m=state.position_std_m if math.isfinite(state.position_std_m) else 0.0,
        roll_rad=roll,
        pitch_rad=pitch,
        heading_rad=heading,
        tail_rad=tail,
        is_old=is_old,
    )


def target_depth_m(hand: PlanInHand) -> float:
    """Return how deep the target of a plan is, 0 for a plan without one."""
    return float(hand.record.config.get("target", {}).get("depth_m", 0.0))


def target_path(hand: PlanInHand) -> FloatArray | None:
    """Return where the virtual target of a plan that is still to be flown goes, ``(n, 3)``, m."""
    path = np.array(hand.record.document.get("target_path") or [], dtype=np.float64)
    if path.ndim != 2 or hand.state in ENDED_STATES:
        return None
    return np.column_stack([path[:, 1:], np.full(len(path), target_depth_m(hand))])


def plan_view(hand: PlanInHand, leg_now: int | None) -> PlanView:
    """Return a plan with its legs as the scene draws it: by what it promises."""
    dry_run = hand.record.document.get("rehearsal") or {}
    band = _band_view(dry_run.get("band"))
    if hand.expected is None:
        flown = _rehearsed(dry_run)
        return PlanView(hand.plan_id, hand.state, hand.legs, hand.points, leg_now, flown, band=band)
    return PlanView(
        hand.plan_id,
        hand.state,
        hand.legs,
        hand.expected,
        leg_now,
        straight_ned=np.array([hand.legs[0].start_ned, *hand.points[:, 1:4].tolist()]),
        band=band,
    )


def _rehearsed(dry_run: Mapping[str, Any]) -> FloatArray | None:
    """Return where the first flight of a plan's dry run went, shape ``(n, 3)``, m."""
    flown = np.array(dry_run.get("flown") or [], dtype=np.float64)
    return flown[:, 1:4] if flown.ndim == 2 else None


def _band_view(told: Mapping[str, Any] | None) -> BandView | None:
    """Return where a dry run's flights were, by what ``robot_link.dry_run.FlightBand`` left."""
    if told is None or not told["along"]:
        return None
    along = np.array(told["along"], dtype=np.float64)
    shallow_m, deep_m = along[:, 7], along[:, 8]
    ups: list[Mapping[str, Any]] = told["surfacings"]
    return BandView(
        level=told["level"],
        leg=along[:, 0].astype(np.int64),
        centre_ned=np.column_stack([along[:, 9:11], 0.5 * (shallow_m + deep_m)]),
        half_axes_m=np.column_stack([along[:, 11:13], 0.5 * (deep_m - shallow_m)]),
        direction_rad=along[:, 13],
        surfacing_ne_m=np.array([(one["north_m"], one["east_m"]) for one in ups]).reshape(-1, 2),
        surfacing_axes_m=np.array([one["ellipse_m"] for one in ups]).reshape(-1, 2),
        surfacing_rad=np.array([one["ellipse_rad"] for one in ups], dtype=np.float64),
    )


FIX_SHOWN = timedelta(minutes=10)
"""An older place by cameras is not drawn."""
_FIX_NEW = timedelta(seconds=2)
"""A younger one needs no time in its label."""
_UPWARD = 1e-3
_UPWARD_M = 1.0


def camera_fix_view(fix: CameraFix, at: datetime) -> CameraFixView | None:
    """Return where cameras saw a robot as it is drawn at a moment; nothing if that is long ago."""
    age = at - fix.measured_at
    if age > FIX_SHOWN:
        return None
    xx, xy, _, yy, _, _ = fix.covariance_m2
    axes, direction = ellipse_90(np.array([[xx, xy], [xy, yy]]))
    many = len(fix.cameras)
    cameras = "a camera" if many == 1 else f"{many} cameras"
    when = "" if age <= _FIX_NEW else f" at {fix.measured_at:%H:%M:%SZ}"
    return CameraFixView(fix.ned_m, axes, direction, f"seen by {cameras}{when}")


def camera_views(rig: UsedRig) -> tuple[CameraView, ...]:
    """Return what each camera that is used looks at, down to the water's surface."""
    views: list[CameraView] = []
    for camera in rig.result["cameras"]:
        if camera["id"] not in rig.cameras:
            continue
        eye = np.array(camera["position_m"])
        rays = np.array(camera["corner_rays"]) @ np.array(camera["rotation"]).T  # (4, 3), NED
        height_m = rig.level_m - eye[2]
        meets = rays[:, 2] > _UPWARD
        reach = np.where(meets, height_m / np.where(meets, rays[:, 2], 1.0), _UPWARD_M)
        north, east, down = eye.tolist()
        views.append(CameraView(camera["id"], (north, east, down), eye + reach[:, None] * rays))
    return tuple(views)
