"""Emulated cameras with the station's detector and tracker behind them, stepped by hand.

Each look is drawn, compressed, read again and searched as camera processes do: where a robot is
expected, and the whole picture once a second. No process and no clock is part of it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import cv2
import numpy as np

from autonomy.vision.camera import Rig
from autonomy.vision.constants import CAMERA_ERRORS
from autonomy.vision.fix import Sighting
from autonomy.vision.tag import Registry
from autonomy.vision.tracker import Followed, Picture, Region, Said, Track, follow, regions
from robot_link.camera.detector import TagDetector
from robot_link.camera.sighting import Region as Place
from robot_link.camera.sighting import TagSeen
from simulator.camera.painter import Painter
from simulator.camera.scene import Motion, Scene
from simulator.camera.trace_kernel import Cells

PERIOD_S, WHOLE_S = 0.2, 1.0


def rig_of_truth(scene: Scene) -> Rig:
    """Return the cameras where they are, as a calibration of the usual accuracy claims them."""
    camera = np.r_[[0.0025] * 3, [8e-4] * 3, [0.3] * 4, np.zeros(5), 0.05]
    stds = np.r_[np.tile(camera, len(scene.cameras)), 0.001]
    assert len(camera) == CAMERA_ERRORS
    return Rig(scene.cameras, scene.level_m, np.diag(stds**2), scene.index)


def read(painter: Painter, grey: Cells) -> Cells:
    """Return a picture as it arrives: compressed."""
    sent = cv2.imdecode(np.frombuffer(painter.jpeg(grey), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert sent is not None
    return sent.astype(np.uint8)


@dataclass
class Eyes:
    """Looks at a scene through every camera at once, and follows the robots of a registry."""

    scene: Scene
    rig: Rig
    registry: Registry
    tracks: Mapping[str, Track] = field(default_factory=dict[str, Track])

    def __post_init__(self) -> None:
        self.painters = [Painter(self.scene, camera) for camera in self.scene.cameras]
        self._detector = TagDetector(self.scene.sensor.gamma)
        self._regions: Mapping[str, tuple[Region, ...]] = {}
        self._whole_s = -math.inf
        self.strangers: set[int] = set()

    def look(
        self, time_s: float, robots: Mapping[str, Motion], said: Mapping[str, Said] | None = None
    ) -> Followed:
        """Take one picture with each camera, and find the robots in them."""
        is_whole = time_s - self._whole_s >= WHOLE_S - 1e-6
        self._whole_s = time_s if is_whole else self._whole_s
        pictures = [
            Picture(painter.camera.name, time_s, self._seen(painter, time_s, robots, is_whole))
            for painter in self.painters
        ]
        ids = {seen.tag_id for picture in pictures for seen in picture.sightings}
        self.strangers |= {one for one in ids if self.registry.is_stranger(one)}
        answer = follow(self.tracks, pictures, self.rig, self.registry, said=said)
        self.tracks = answer.tracks
        self._regions = regions(self.tracks, self.rig, self.registry, time_s + PERIOD_S)
        return answer

    def whole(self, painter: Painter, time_s: float) -> list[TagSeen]:
        """Return every tag that one camera sees of the empty tank."""
        return self._detector.find(read(painter, painter.picture(time_s)), decimate=1.0).tags

    def _seen(
        self, painter: Painter, time_s: float, robots: Mapping[str, Motion], is_whole: bool
    ) -> tuple[Sighting, ...]:
        name = painter.camera.name
        places = self._regions.get(name, ())
        near = [Place(one.left, one.top, one.right, one.bottom) for one in places]
        decimate = 1.0 if is_whole or not near else None
        grey = read(painter, painter.picture(time_s, robots))
        tags = self._detector.find(grey, near, decimate).tags
        return tuple(Sighting(name, tag.id, np.array(tag.corners_px), tag.sigma_px) for tag in tags)
