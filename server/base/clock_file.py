"""The anchors of a scaled clock in a file, so that station and simulator agree without talking."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

from pydantic import AwareDatetime, BaseModel, Field

from robot_link.clock import Clock, ScaledClock, SystemClock


class ClockAnchors(BaseModel):
    """Content of a clock file."""

    wall_anchor: AwareDatetime
    """Wall time at which the clock showed ``time_anchor``."""
    time_anchor: AwareDatetime
    speed: float = Field(gt=0, le=1000)
    stopped_wall: AwareDatetime | None = None
    """Wall time at which the demo was stopped; its robots stood still from then on."""


def read_clock(path: Path | None) -> Clock:
    """Return the clock of a file, or the machine's own where there is no file.

    Raises:
        OSError: If the file cannot be read.
        pydantic.ValidationError: If it is not a clock file.
    """
    if path is None:
        return SystemClock()
    anchors = ClockAnchors.model_validate_json(path.read_text())
    return ScaledClock(anchors.wall_anchor, anchors.time_anchor, anchors.speed)


def start_clock(path: Path, speed: float) -> ClockAnchors:
    """Write anchors from which a demo runs on: time never goes back in one data folder.

    A demo that was stopped in order goes on from where it stopped, plus the pause as the wall
    saw it; one that was killed goes on from where its clock would have been.
    """
    wall = datetime.now(UTC)
    time_anchor = wall
    if path.exists():
        old = ClockAnchors.model_validate_json(path.read_text())
        until = old.stopped_wall or wall
        shown = old.time_anchor + (until - old.wall_anchor) * old.speed
        time_anchor = shown + max(wall - until, timedelta(0))
    anchors = ClockAnchors(wall_anchor=wall, time_anchor=time_anchor, speed=speed)
    _write(path, anchors)
    return anchors


def stop_clock(path: Path) -> None:
    """Note that the demo of this clock stops now."""
    anchors = ClockAnchors.model_validate_json(path.read_text())
    _write(path, anchors.model_copy(update={"stopped_wall": datetime.now(UTC)}))


def _write(path: Path, anchors: ClockAnchors) -> None:
    fresh = path.with_suffix(".new")
    fresh.write_text(anchors.model_dump_json(indent=2))
    fresh.replace(path)
