"""One robot's 3D scene: a viser server that is kept up to date by ``update``."""

from pathlib import Path

import numpy as np
from viser.infra import StateSerializer

from autonomy.frames import ned_to_enu
from webui.scene.camera import CameraFix, CameraViews
from webui.scene.comparison import Comparison
from webui.scene.door import PrivateServer
from webui.scene.field_map import FieldMap
from webui.scene.framing import begin, look
from webui.scene.inbound import admitted
from webui.scene.keep_out import KeepOuts
from webui.scene.lake_bed import LakeBed
from webui.scene.panel import WATER, WHAT_IF, LayerEntry, Panel
from webui.scene.plan import PlannedTrajectory
from webui.scene.predicted import Predicted
from webui.scene.projection import Projection
from webui.scene.robot import RobotModel
from webui.scene.sample import Samples
from webui.scene.source import SceneSource
from webui.scene.stage import Stage
from webui.scene.surroundings import draw_surroundings, write_depth
from webui.scene.target import Target
from webui.scene.track import CHUNK_POINTS, Track
from webui.scene.view import SceneChange, SceneState


class RobotScene:
    """Draws one ``SceneSource``.

    viser runs its own thread; ``update`` may be called from any one thread, about 10 times a
    second. It listens on a socket that this user's processes alone can reach: whoever publishes
    it checks who asks, and lets nothing in but what ``admitted`` returns.
    """

    def __init__(self, source: SceneSource, track_chunk: int = CHUNK_POINTS) -> None:
        self._source = source
        self._private = PrivateServer(source.title)
        self._server = self._private.viser
        projection = Projection.of_site(source.site)
        self._server.gui.configure_theme(
            dark_mode=True, show_logo=False, show_share_button=False, brand_color=(74, 163, 255)
        )
        self._set_stage()
        scene = self._server.scene
        self._stage = Stage(scene, projection)
        draw_surroundings(self._stage, source.site)
        self._robot = RobotModel(scene, projection, source.hull)
        self._track = Track(self._stage, source, track_chunk)
        self._plan = PlannedTrajectory(self._stage, source)
        self._map = FieldMap(self._stage, source)
        self._samples = Samples(self._stage, source)
        self._keep_outs = KeepOuts(self._stage, source)
        self._target = Target(self._stage, source)
        self._bed = LakeBed(self._stage, source.site)
        self._comparison = Comparison(self._stage, source)
        self._predicted = Predicted(self._stage, source)
        self._camera_fix = CameraFix(self._stage, source)
        self._camera_views = CameraViews(self._stage, source)
        self._is_framed = False
        layers = {
            "map": LayerEntry("Map", self._map),
            "samples": LayerEntry("Samples by fidelity", self._samples),
            "track": LayerEntry("Track", self._track.survey),
            "drift": LayerEntry("Drift", self._track.drift),
            "plan": LayerEntry("Plan", self._plan.legs),
            "uncertainty": LayerEntry("Planned uncertainty", self._plan.uncertainty),
            "band": LayerEntry("Band of flights", self._plan.band),
            "rehearsal": LayerEntry("Rehearsed track", self._plan.rehearsal),
            "target": LayerEntry("Target", self._target),
            "predicted": LayerEntry("Predicted place", self._predicted),
            "camera_fix": LayerEntry("Seen by cameras", self._camera_fix),
            "cameras": LayerEntry("What cameras look at", self._camera_views),
            "keep_outs": LayerEntry("Keep-outs", self._keep_outs),
            "floor": LayerEntry("Shore and floor", self._bed),
            "what_if": LayerEntry("What-if", self._comparison),
        }
        self._panel = Panel(
            self._server.gui,
            self._map,
            layers,
            self._stage.exaggeration,
            {
                WATER: lambda client: look([client], None),
                WHAT_IF: lambda client: look([client], self._comparison.extent()),
            },
            lambda: self._target.legend,
        )

    @property
    def socket(self) -> Path:
        """Return the socket that viser listens on."""
        return self._private.socket

    def admitted(self, frame: bytes, *, may_change: bool) -> bytes | None:
        """Return what of a browser's frame goes to viser, ``None`` where nothing does."""
        return admitted(frame, self._panel.accepts, may_change=may_change)

    @property
    def is_watched(self) -> bool:
        """Whether a browser shows the scene now."""
        return bool(self._server.get_clients())

    def update(self) -> None:
        """Bring the scene up to the source; unchanged things cost nothing."""
        self._panel.apply()
        with self._server.atomic():
            if self._panel.exaggeration != self._stage.exaggeration:
                self._stage.exaggerate(self._panel.exaggeration)
                write_depth(self._stage, self._source.site)
            self._robot.show(self._source.pose(), self._stage.exaggeration)
            self._track.update()
            self._plan.update()
            self._samples.update()
            self._keep_outs.update()
            self._target.update()
            self._predicted.update()
            self._camera_fix.update()
            self._camera_views.update()
            if self._comparison.update():
                self._frame()
            self._map.update()

    @property
    def state(self) -> SceneState:
        """Return what the view shows."""
        return self._panel.state()

    def change(self, change: SceneChange) -> None:
        """Let everybody see something else; call it from the thread of ``update``."""
        self._panel.change(change)
        self.update()

    def record(self) -> StateSerializer:
        """Begin to record what is drawn now and what changes from now on."""
        return self._server.get_scene_serializer()

    def caption(self, text: str) -> None:
        """Write a line above the water."""
        water = self._source.site.water
        above = (water.x_max_m, (water.y_min_m + water.y_max_m) / 2, -0.15 * water.depth_max_m)
        self._stage.label("caption", text, ned_to_enu(np.array(above)))

    def _frame(self) -> None:
        """Let everybody see all of a what-if run that leaves the water, and the water after it."""
        self._panel.offer(WHAT_IF, self._comparison.extent() is not None)
        points = self._comparison.extent() if self._comparison.leaves_water else None
        if points is None and not self._is_framed:
            return
        self._is_framed = points is not None
        begin(self._server.initial_camera, points)
        look(self._server.get_clients().values(), points)

    def stop(self) -> None:
        """Take the socket away and end viser's thread."""
        self._private.stop()

    def _set_stage(self) -> None:
        scene = self._server.scene
        scene.set_up_direction("+z")
        scene.configure_default_lights(enabled=True, cast_shadow=False)
        # Light from an image costs a browser without a graphics processor seconds to prepare.
        scene.configure_environment_map(None)
        scene.add_light_ambient("/light", intensity=1.2)
        begin(self._server.initial_camera, None)
