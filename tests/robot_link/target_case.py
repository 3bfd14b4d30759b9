"""Track reports, and orders to follow a target, that several tests share."""

import math
from dataclasses import replace
from datetime import UTC, datetime

from hypothesis import strategies as st

from autonomy.tracking.config import (
    BarrierConfig,
    MotionConfig,
    RangingConfig,
    TargetConfig,
    TrackingConfig,
)
from autonomy.tracking.phase import TargetPhase
from robot_link.messages import RobotId
from robot_link.mission import Mission, MissionSettings
from robot_link.report import TargetEstimate, TargetReport
from robot_link.target_settings import TargetSettings

NOW = datetime(2026, 6, 1, 12, 0, tzinfo=UTC)
SETTINGS = MissionSettings(1.0, 10.0, 900.0, 1.5, -2.25, 0.001, -0.002)


def tracking_mission(config: TrackingConfig | None = None) -> Mission:
    """Return a mission that follows a target."""
    return Mission.for_target(SETTINGS, TargetSettings.of(config or TrackingConfig()))


def track(**changes: object) -> TargetReport:
    """Return a report with two hypotheses, each of its numbers exact in a float32."""
    value = TargetReport(
        robot=RobotId("mini-1"),
        measured_at=NOW,
        received_at=NOW,
        phase=TargetPhase.TRACKING,
        position_ne_m=(1.25, -0.5),
        hypotheses=(
            TargetEstimate((1.75, 0.625), (0.03125, -0.015625), (0.25, -0.0625, 0.5), 0.75),
            TargetEstimate((0.5, -1.5), (0.0, 0.0078125), (0.5, 0.125, 0.125), 0.25),
        ),
        range_m=1.125,
        range_age_s=0.5,
        ranges_heard=70_000,
        ranges_rejected=12,
        determinant_m2_s=-0.0625,
        barrier=-0.03125,
        inverse_condition=0.375,
        nominal=(-0.5, 0.0078125),
        command=(0.75, -0.0078125),
        is_barrier_on=True,
        is_feasible=False,
        is_quiet=False,
        true_ne_m=None,
    )
    return replace(value, **changes)


def _positive(least: float, most: float) -> st.SearchStrategy[float]:
    powers = st.floats(math.log(least), math.log(most))
    return powers.map(lambda power: min(most, max(least, math.exp(power))))


@st.composite
def tracking_configs(draw: st.DrawFn) -> TrackingConfig:
    """Any order whose numbers are far enough apart that rounding leaves it one."""
    silences = sorted(draw(st.lists(_positive(0.5, 3000.0), min_size=3, max_size=3)))
    coast, lost, give_up = (
        one * factor for one, factor in zip(silences, (1.0, 1.1, 1.3), strict=True)
    )
    target = TargetConfig(
        kind=draw(st.sampled_from(("virtual", "tag", "beacon"))),
        address=draw(st.integers(1, 127)),
        depth_m=draw(st.floats(0.01, 1000.0)),
        north_m=draw(st.floats(-16_000.0, 16_000.0)),
        east_m=draw(st.floats(-16_000.0, 16_000.0)),
        path=draw(st.sampled_from(("static", "line", "sine", "circle"))),
        heading_rad=draw(st.sampled_from((-math.pi, -0.3, 0.0, 0.3, math.pi))),
        guess_std_m=draw(_positive(0.01, 1e4)),
    )
    ranging = RangingConfig(
        period_s=draw(_positive(0.05, min(600.0, 0.8 * coast))),
        sound_speed_m_s=draw(st.floats(1300.0, 1700.0)),
        coast_after_s=coast,
        lost_after_s=lost,
        give_up_after_s=give_up,
    )
    barrier = BarrierConfig(
        controller=draw(st.sampled_from(("barrier", "nominal", "mpc_trace"))),
        epsilon=draw(_positive(1e-6, 1e6)),
        slope=draw(_positive(1e-3, 100.0)),
        fallback=draw(st.sampled_from(("best_effort", "nominal"))),
    )
    motion = MotionConfig(
        turn_rate_max_rad_s=draw(_positive(0.01, 10.0)),
        acceleration_min_m_s2=-draw(_positive(1e-4, 10.0)),
        duration_s=draw(_positive(1.0, 86_400.0)),
    )
    return TrackingConfig(target=target, ranging=ranging, barrier=barrier, motion=motion)
