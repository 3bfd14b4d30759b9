"""A report on a target whose every number is another."""

from dataclasses import replace
from datetime import timedelta

from autonomy.tracking.phase import TargetPhase
from robot_link.messages import RobotId
from robot_link.report import TargetEstimate, TargetReport
from tests.db.conftest import START


def target_report(
    second: float,
    phase: TargetPhase = TargetPhase.TRACKING,
    robot: str = "mini-1",
    **changes: object,
) -> TargetReport:
    at = START + timedelta(seconds=second)
    value = TargetReport(
        robot=RobotId(robot),
        measured_at=at,
        received_at=at + timedelta(milliseconds=90),
        phase=phase,
        position_ne_m=(1.0, 0.5),
        hypotheses=(
            TargetEstimate((1.4, 0.8), (0.01, -0.02), (0.04, 0.005, 0.01), 0.75),
            TargetEstimate((0.6, 0.9), (0.03, 0.04), (0.09, -0.01, 0.05), 0.25),
        ),
        range_m=0.52,
        range_age_s=0.15,
        ranges_heard=31,
        ranges_rejected=2,
        determinant_m2_s=0.081,
        barrier=0.0005,
        inverse_condition=0.62,
        nominal=(0.7, -0.004),
        command=(0.5, 0.006),
        is_barrier_on=True,
        is_feasible=True,
        is_quiet=False,
        true_ne_m=(1.43, 0.76),
    )
    return replace(value, **changes)
