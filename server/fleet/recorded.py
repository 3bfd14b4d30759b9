"""Recordings are listed beside robots, but there is nobody behind them."""

from server.base.problem import conflict
from server.fleet.status import RobotStatus


def refuse_recording(status: RobotStatus, what: str) -> None:
    """Refuse what only a robot can do.

    Args:
        status: Robot or recording.
        what: What a recording does not, such as "flies no plans".

    Raises:
        Problem: 409 for a recording.
    """
    if status.record.system_id is None:
        raise conflict(f"{status.record.id} is a recording; it {what}.")
