"""A film in three dimensions: what viser draws of moment after moment, played without a station."""

from pathlib import Path
from types import TracebackType
from typing import Final, Self

from viser.infra import StateSerializer

from server.replay.film.order import FRAMES_PER_S, FilmOrder
from server.scene.replay_source import Moment, ReplaySource
from webui.scene.page import recorded_page
from webui.scene.server import RobotScene

_TRACK_CHUNK: Final = 150
"""The end of the track is drawn anew at each moment, so it is short here."""


class SceneFilm:
    """Records a scene of its own; whoever looks at the film moves the camera."""

    def __init__(self, order: FilmOrder, source: ReplaySource, target: Path) -> None:
        self._order = order
        self._target = target
        self._scene = RobotScene(source, _TRACK_CHUNK)
        self._record: StateSerializer | None = None

    def __enter__(self) -> Self:
        """Begin."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End viser's thread."""
        self._scene.stop()

    def take(self, moment: Moment) -> None:
        """Draw the next moment."""
        if self._record is not None:
            self._record.insert_sleep(1.0 / FRAMES_PER_S)
        self._scene.caption(caption(moment))
        self._scene.update()
        if self._record is None:
            self._record = self._scene.record()

    def finish(self) -> None:
        """Write the recording, in a page that plays it where one is wanted."""
        recording = b"" if self._record is None else self._record.serialize()
        if self._order.kind == "page":
            recording = recorded_page(recording, self._order.words)
        self._target.write_bytes(recording)


def caption(moment: Moment) -> str:
    """Return what is written of a moment in one line."""
    at, pose = f"{moment.at:%Y-%m-%d %H:%M:%S}Z", moment.pose
    if pose is None:
        return f"{at}, nothing known yet"
    age_s = (moment.at - pose.measured_at).total_seconds()
    old = f", measured {age_s:.0f} s before" if age_s >= 1.0 else ""
    mode = pose.mode.name.lower()
    return f"{at}, {pose.position_ned[2]:.2f} m deep, {mode}{old}"
