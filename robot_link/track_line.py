"""Lines of a robot's log of where it believed to be: written on board, read of a recovered card."""

import math
from datetime import UTC, datetime
from typing import Final

from robot_link.messages import STATE, RobotId, RobotMode, StateReport

TRACK_HEADER: Final = ",".join(("time", *STATE.keys, "mode", "has_fix"))
"""The first line of such a log."""
_TIME: Final = "%Y-%m-%dT%H:%M:%S.%fZ"
_AROUND: Final = 3
"""Cells that are no numbers: time, mode and whether there was a fix."""
_VECTORS: Final = {
    "position_ned": ("north_m", "east_m", "depth_m"),
    "velocity_ned": ("velocity_north_m_s", "velocity_east_m_s", "velocity_down_m_s"),
}


def track_line(state: StateReport) -> str:
    """Return the line of a state: its numbers with five digits."""
    return ",".join(
        (
            state.measured_at.strftime(_TIME),
            *(f"{number:.5g}" for number in STATE.numbers(state)),
            state.mode.name.lower(),
            str(int(state.has_fix)),
        )
    )


def read_track_line(line: str, robot: RobotId, received_at: datetime) -> StateReport:
    """Return the state that a line tells.

    Raises:
        ValueError: If it is none.
    """
    cells = line.split(",")
    if len(cells) != len(STATE.keys) + _AROUND:
        raise ValueError("the line is not whole")
    numbers = dict(zip(STATE.keys, map(float, cells[1:-2]), strict=True))
    if not all(map(math.isfinite, numbers.values())):
        raise ValueError("a number is missing")
    if cells[-2].upper() not in RobotMode.__members__ or cells[-1] not in ("0", "1"):
        raise ValueError("the line is not whole")
    vectors = {name: tuple(numbers.pop(key) for key in keys) for name, keys in _VECTORS.items()}
    return StateReport(
        robot=robot,
        measured_at=datetime.strptime(cells[0], _TIME).replace(tzinfo=UTC),
        received_at=received_at,
        mode=RobotMode[cells[-2].upper()],
        has_fix=cells[-1] == "1",
        **vectors,  # type: ignore[arg-type]
        **numbers,
    )
