"""Recordings are listed beside robots, but there is nobody behind them."""

from server.base.problem import conflict
from server.fleet.picture import Picture


def refuse_recording(picture: Picture, what: str) -> None:
    """Refuse what only a robot can do.

    Args:
        picture: Robot or recording.
        what: What a recording does not, such as "flies no plans".

    Raises:
        Problem: 409 for a recording.
    """
    if picture.record.system_id is None:
        raise conflict(f"{picture.record.id} is a recording; it {what}.")
