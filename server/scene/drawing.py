"""States and plans as the scene draws them."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from db.query.mission.plans import ENDED_STATES
from db.record import same
from robot_link.messages import StateReport
from server.fleet.status import PlanInHand
from webui.scene.source import BandView, PlanView, Pose


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
