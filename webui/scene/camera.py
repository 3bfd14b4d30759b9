"""Where cameras over the water saw the robot, beside what it says itself, and what they look at."""

import numpy as np

from autonomy.frames import ned_to_enu
from webui.scene.colour import BY_CAMERA
from webui.scene.predicted import ellipse_ned
from webui.scene.source import CameraFixView, CameraView, SceneSource
from webui.scene.stage import Stage

_CROSS, _ELLIPSE, _LABEL = (f"camera_fix/{part}" for part in ("cross", "ellipse", "name"))
_LINE_PX, _VIEW_PX = 2.2, 1.0
_CROSS_M = 0.06
"""Half the length of the mark's arms: an ellipse of millimetres alone would not be seen."""


class CameraFix:
    """Redraws when the source says another fix."""

    def __init__(self, stage: Stage, source: SceneSource) -> None:
        self._stage = stage
        self._source = source
        self._shown: CameraFixView | None = None
        self.visible = True

    @property
    def has_content(self) -> bool:
        """Whether there is anything to show."""
        return self._shown is not None

    def update(self) -> None:
        """Fetch the newest fix, and draw it if it is another one."""
        view = self._source.camera_fix()
        if view is self._shown:
            return
        for name in (_CROSS, _ELLIPSE):
            self._stage.remove(name)
        self._stage.remove_label(_LABEL)
        self._shown = view
        if view is not None:
            self._draw(view)
        self.show(self.visible)

    def show(self, visible: bool) -> None:
        """Show or hide all of it."""
        self.visible = visible
        for name in (_CROSS, _ELLIPSE):
            self._stage.show(name, visible)
        self._stage.show_label(_LABEL, visible)

    def _draw(self, view: CameraFixView) -> None:
        place = np.array(view.position_ned)
        arms = _CROSS_M * np.eye(3)
        cross = np.stack([place - arms, place + arms], axis=1)  # (3, 2, 3)
        self._stage.lines(_CROSS, ned_to_enu(cross), BY_CAMERA, _LINE_PX)
        ring = ellipse_ned(view.position_ned, view.ellipse_m, view.ellipse_rad)
        segments = np.stack([ring[:-1], ring[1:]], axis=1)
        self._stage.lines(_ELLIPSE, ned_to_enu(segments), BY_CAMERA, _LINE_PX)
        self._stage.label(_LABEL, view.label, ned_to_enu(place))


class CameraViews:
    """What each camera looks at: from its lens to where the corners of its picture meet the water.

    Redraws when the source says other cameras.
    """

    def __init__(self, stage: Stage, source: SceneSource) -> None:
        self._stage = stage
        self._source = source
        self._shown: tuple[CameraView, ...] = ()
        self.visible = False

    @property
    def has_content(self) -> bool:
        """Whether there is anything to show."""
        return bool(self._shown)

    def update(self) -> None:
        """Fetch the cameras, and draw them if they are others."""
        views = self._source.camera_views()
        if views is self._shown:
            return
        for view in self._shown:
            self._stage.remove(f"cameras/{view.name}")
            self._stage.remove_label(f"camera_names/{view.name}")
        self._shown = views
        for view in views:
            eye, corners = np.array(view.eye_ned), view.corners_ned
            rays = np.stack([np.broadcast_to(eye, corners.shape), corners], axis=1)
            edges = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
            lines = ned_to_enu(np.concatenate([rays, edges]))
            self._stage.lines(f"cameras/{view.name}", lines, BY_CAMERA, _VIEW_PX)
            self._stage.label(f"camera_names/{view.name}", view.name, ned_to_enu(eye))
        self.show(self.visible)

    def show(self, visible: bool) -> None:
        """Show or hide all of it."""
        self.visible = visible
        for view in self._shown:
            self._stage.show(f"cameras/{view.name}", visible)
            self._stage.show_label(f"camera_names/{view.name}", visible)
