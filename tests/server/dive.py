"""A dive of which the robot's own filter lost the way, as a robot tells of it."""

from datetime import UTC, datetime, timedelta

import numpy as np

from autonomy.field.synthetic import measure
from robot_link.messages import LogId, RobotId, RobotMode, Sample, StateReport
from tests.server.fake_link import state_report

DRIFT_M_S = 0.004
STEP_S = 2.0


def begin_of(dives: int) -> datetime:
    """Return a moment so long ago that this many dives lie before now."""
    return datetime.now(UTC) - timedelta(seconds=200.0 * dives)


def dive(
    robot: RobotId,
    begin: datetime,
    *,
    first: int = 0,
    samples: int = 20,
    log: int = 1,
    north_m: float = 0.4,
    east_m: float = 0.5,
    drift_m_s: float = DRIFT_M_S,
) -> list[StateReport | Sample]:
    """Return what a robot tells of a dive that ends with a fix, in order of time.

    It was carried east by ``drift_m_s`` more than it believed.
    """
    rng = np.random.default_rng(first)
    start = state_report(robot, (north_m, east_m, 0.0), at=begin, position_std_m=0.01)
    told: list[StateReport | Sample] = [start]
    for i in range(samples):
        after_s = STEP_S * (i + 1)
        at = begin + timedelta(seconds=after_s)
        believed = (north_m + 0.02 * after_s, east_m, 0.1 + 0.3 * abs(np.sin(0.2 * i)))
        true = np.array([(believed[0], east_m + drift_m_s * after_s, believed[2])])
        std_m = 0.02 * float(np.sqrt(after_s))
        value = float(measure("blue_light", true, rng)[0])
        told.append(
            Sample(robot, LogId(log), first + i, "blue_light", value, believed, std_m, at, at)
        )
    ended_s = STEP_S * (samples + 1)
    last = (north_m + 0.02 * ended_s, east_m, 0.05)
    up = begin + timedelta(seconds=ended_s)
    told.append(
        state_report(
            robot,
            last,
            at=up,
            position_std_m=0.02 * float(np.sqrt(ended_s)),
            has_fix=False,
            mode=RobotMode.GLIDING,
        )
    )
    found = (last[0], last[1] + drift_m_s * ended_s, 0.0)
    fixed = up + timedelta(seconds=1)
    told.append(state_report(robot, found, at=fixed, position_std_m=0.01))
    return told
