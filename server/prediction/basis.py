"""What a robot's last word, and what was known with it, says of where it is now."""

import math
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.config import EstimatorConfig
from autonomy.estimation.prediction import (
    FlownTrack,
    LastWord,
    Prediction,
    WaterBelief,
    predict_afloat,
    predict_flown,
)
from autonomy.planner.leg.primitive import position_at
from onboard.profile import FlightProfile
from robot_link.messages import OnboardPlanState, PlanReport, RobotMode, StateReport
from robot_link.report import CurrentReport
from server.fleet.status import FOLLOW_TARGET, SURFACE_DEPTH_M, PlanInHand, RobotStatus
from server.plan.expected import is_on_leg

_PACE_STD = 0.05
"""How far a robot's pace may be off the plan's: drag and ballast are known to about 10 %."""
_ROWS = 9
"""Points of a leg whose track nobody flew ahead."""
_AFLOAT = (RobotMode.IDLE, RobotMode.HOLDING, RobotMode.ABORTING)
_WAITING = (RobotMode.SURFACED, RobotMode.TURNING, RobotMode.SWIMMING)


@dataclass(frozen=True, slots=True, eq=False)
class Basis:
    """What was known of a robot when it said its last word; nothing of it is from later."""

    state: StateReport
    plan_report: PlanReport | None
    current_report: CurrentReport | None
    hand: PlanInHand | None
    last_fix_at: datetime | None

    @property
    def leg(self) -> int | None:
        """Leg of the plan in hand that the robot said it flies."""
        report, hand = self.plan_report, self.hand
        if report is None or hand is None or report.state is not OnboardPlanState.RUNNING:
            return None
        is_it = report.sha256 == hand.record.sha256 and report.leg < len(hand.legs)
        return report.leg if is_it else None


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """What a prediction is made of beside the last word."""

    estimator: EstimatorConfig
    profile: FlightProfile
    turn_time_s: float
    """What each dive takes beside its legs, where its flight ahead does not tell."""


def kind_of(status: RobotStatus, basis: Basis) -> tuple[str, str]:
    """Return how a robot's place is predicted, and what it is predicted from in a sentence."""
    mode, report = basis.state.mode, basis.plan_report
    if status.record.kind == "recorded":
        return "unknown", "It is a recording."
    if status.record.is_foreign:
        return "unknown", "It is a vehicle of another maker, and does not tell what it will do."
    if mode in _AFLOAT:
        return (
            "afloat",
            "It has nothing to fly and goes with the water, by the current it believes.",
        )
    is_running = report is not None and report.state is OnboardPlanState.RUNNING
    if is_running and basis.hand is not None and basis.hand.record.kind == FOLLOW_TARGET:
        return "unknown", "It follows a target, and nobody knows where that goes."
    if basis.leg is not None and basis.hand is not None:
        how = "the track that its flights ahead let expect"
        if basis.hand.expected is None:
            how = "its legs as planned, which nobody flew ahead often enough"
        return "flying", f"It keeps to {basis.hand.plan_id}, by {how}."
    if is_running:
        return "unknown", "It flies a plan that this station does not know."
    return "afloat", "It flies no plan that is known and goes with the water."


def predicted(kind: str, basis: Basis, told: Told, ages_s: FloatArray) -> Prediction | None:
    """Return where a robot should be at some ages of its last word, ``None`` where unknown."""
    water = _water_of(basis, told.estimator)
    word = _word_of(basis, told.estimator)
    if kind == "afloat":
        return predict_afloat(word, water, ages_s)
    track = _track_of(basis, told) if kind == "flying" else None
    return None if track is None else predict_flown(word, track, water, ages_s)


def stated_std_m(basis: Basis, told: Told, ages_s: FloatArray) -> FloatArray:
    """Return how uncertain a robot without a fix will take its position for, per axis, m."""
    water = _water_of(basis, told.estimator)
    word = _word_of(basis, told.estimator)
    before = word.std_m**2 - water.variance_m2(word.blind_s)
    return np.array(
        [math.sqrt(max(0.0, before + water.variance_m2(word.blind_s + t))) for t in ages_s.tolist()]
    )


def _word_of(basis: Basis, estimator: EstimatorConfig) -> LastWord:
    state = basis.state
    std_m = state.position_std_m if math.isfinite(state.position_std_m) else 0.0
    blind_s = 0.0
    if not state.has_fix and basis.last_fix_at is not None:
        blind_s = max(0.0, (state.measured_at - basis.last_fix_at).total_seconds())
    return LastWord(state.position_ned, std_m, blind_s, estimator.fix_std_m)


def _water_of(basis: Basis, estimator: EstimatorConfig) -> WaterBelief:
    report = basis.current_report
    unknown = estimator.steady_current_m_s
    if report is None:
        current, std, doubt, age_s = (0.0, 0.0), unknown, 1.0, 0.0
    else:
        current, std, doubt = report.current_ne_m_s, report.current_std_m_s, report.doubt
        age_s = max(0.0, (basis.state.measured_at - report.measured_at).total_seconds())
        std = max(std, estimator.current_std_after(std, age_s))
    return WaterBelief(
        current_ne_m_s=current,
        std_m_s=std,
        unknown_std_m_s=unknown,
        memory_s=estimator.current_memory_s,
        walk_m_sqrt_s=estimator.drift_m_sqrt_s * max(1.0, doubt),
    )


def _track_of(basis: Basis, told: Told) -> FlownTrack | None:
    hand, leg = basis.hand, basis.leg
    if hand is None or leg is None:
        return None
    begins, ends = leg_times_s(hand, told.turn_time_s)
    rows = _rows_of(hand)
    times = np.concatenate(
        [np.linspace(a, b, len(rows[0])) for a, b in zip(begins, ends, strict=True)]
    )
    stays = [
        (ends[k], begins[k + 1] if k + 1 < len(begins) else ends[k])
        for k, one in enumerate(hand.legs)
        if one.end_ned[2] <= SURFACE_DEPTH_M
    ]
    profile, places = told.profile, rows.reshape(-1, 3)
    now_s = _now_s(basis, hand, leg, rows[leg], begins, ends)
    way_s = _way_there_s(basis, hand, leg)
    if way_s > 0.0:
        now_s = -way_s
        times = np.concatenate([[-way_s, 0.0], times])
        places = np.vstack([basis.state.position_ned, places[0], places])
        ends = [0.0, *ends]
    return FlownTrack(
        time_s=times,
        position_ned=places,
        leg_end_s=np.array(ends),
        stays_s=np.array(stays, dtype=np.float64).reshape(-1, 2),
        now_s=now_s,
        following_std_m=_following_std_m(hand, profile),
        pace_std=_PACE_STD,
        wait_std_s=(profile.surface_max_s - profile.surface_min_s) / math.sqrt(12.0),
    )


def leg_times_s(hand: PlanInHand, turn_time_s: float) -> tuple[list[float], list[float]]:
    """Return when each leg of a plan begins and ends, s since its start."""
    dry_run = hand.record.document.get("rehearsal") or {}
    expected = dry_run.get("expected_times_s") or ()
    if hand.expected is not None and len(expected) == len(hand.legs):
        return [begin for begin, _ in expected], [end for _, end in expected]
    begins, ends, now_s = list[float](), list[float](), 0.0
    for leg in hand.legs:
        now_s += turn_time_s if leg.start_ned[2] <= 0.0 else 0.0
        begins.append(now_s)
        now_s += leg.duration_s
        ends.append(now_s)
    return begins, ends


def _way_there_s(basis: Basis, hand: PlanInHand, leg: int) -> float:
    """Return how long a robot still swims to where its plan begins, s; 0 once it flies that."""
    state, first = basis.state, hand.legs[0]
    if leg > 0 or hand.swim_speed_m_s is None or is_on_leg(state.mode, first):
        return 0.0
    return math.dist(state.position_ned[:2], first.start_ned[:2]) / hand.swim_speed_m_s


def _rows_of(hand: PlanInHand) -> FloatArray:
    """Return the track of each leg, shape ``(legs, k, 3)``, m."""
    if hand.expected is not None:
        return hand.expected.reshape(len(hand.legs), -1, hand.expected.shape[1])[:, :, 1:4]
    shares = np.linspace(0.0, 1.0, _ROWS).tolist()
    return np.array([[position_at(leg, share) for share in shares] for leg in hand.legs])


def _now_s(
    basis: Basis,
    hand: PlanInHand,
    leg: int,
    rows: FloatArray,
    begins: list[float],
    ends: list[float],
) -> float:
    """Return where along its plan a robot was at its last word, s since the plan's start."""
    state = basis.state
    if not is_on_leg(state.mode, hand.legs[leg]):
        # before the leg: as late as it may be, since it said so the longer it stays the likelier
        waits = state.mode in _WAITING and leg > 0
        return ends[leg - 1] if waits else begins[leg] if leg else 0.0
    off = np.linalg.norm(rows - np.array(state.position_ned), axis=1)
    nearest = int(off.argmin())
    share = nearest / (len(rows) - 1)
    if 0 < nearest < len(rows) - 1:
        way = rows[nearest + 1] - rows[nearest - 1]
        along = float((np.array(state.position_ned) - rows[nearest]) @ way)
        share += along / max(float(way @ way), 1e-9) * 2.0 / (len(rows) - 1)
    return begins[leg] + min(max(share, 0.0), 1.0) * (ends[leg] - begins[leg])


def _following_std_m(hand: PlanInHand, profile: FlightProfile) -> float:
    """Return what a robot flies beside its track by its own reckoning, per axis, m.

    Of the scatter of flights ahead that is what the uncertainty that they stated does not explain.
    """
    least = 0.5 * profile.arrival_m
    dry_run = hand.record.document.get("rehearsal") or {}
    spread_m = dry_run.get("spread_m")
    if hand.expected is None or spread_m is None:
        return least
    stated = float(np.mean(hand.expected[:, 4] ** 2))
    return math.sqrt(max(0.5 * spread_m**2 - stated, least**2))
