"""A process that sees what a camera over the tank would, with stated noise, and no pixels.

``python -m tests.server.camera.tank_stand_in`` is run in place of ``robot_link.camera.process``.
What really is stands in the JSON file that the option ``world`` of its URI names, which is read
again for every picture: ``level_m``, ``slope_deg``, and for each camera ``turned_deg`` and
``moved_m``; ``shows`` is the id of the tag of the latency check that a screen shows.
"""

import itertools
import json
import math
import os
import sys
import threading
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import numpy as np

from autonomy.vision.camera import Camera
from autonomy.vision.rigid import Pose
from robot_link.camera.sighting import (
    BoardCorner,
    BoardView,
    Order,
    Sighting,
    SourceReport,
    SourceSettings,
    TagSeen,
)
from robot_link.camera.wire import CameraReader, framed
from tests.autonomy.vision.boards import drawn_views
from tests.autonomy.vision.tank import overhead_cameras, see, surveyed, tank_layout

PERIOD_S = 0.1062
"""Never in step with a screen: any sixteen pictures one after another come evenly over its step.
None is left out, however late the process runs."""
LATENCY_S = 0.03
SURVEY_SEED = 7


def true_tags():
    """Return the fixed tags where they really are; the nominal ones are told."""
    return surveyed(tank_layout(), np.random.default_rng(SURVEY_SEED), 0.002, 0.3).tags


def true_camera(name: str, world: dict) -> Camera:
    """Return a camera where it really hangs."""
    camera = next(one for one in overhead_cameras() if one.name == name)
    change = world.get(name, {})
    turn = np.radians([change.get("turned_deg", 0.0), 0.0, 0.0])
    pose = camera.pose.moved(np.array([change.get("moved_m", 0.0), 0.0, 0.0]), turn)
    return Camera(camera.name, camera.lens, pose, camera.edge_px)


class Tank:
    def __init__(self, settings: SourceSettings, number: int) -> None:
        self.name = settings.camera
        options = parse_qs(urlsplit(settings.uri).query)
        self.world = Path(options["world"][0])
        self.rng = np.random.default_rng(number)
        self.order = Order()
        self.frame = 0
        self.boards = 0
        lens = next(one for one in overhead_cameras() if one.name == self.name).lens
        self.size = (lens.width_px, lens.height_px)
        self.views = drawn_views(lens, 25, number)
        self.tags = true_tags()

    def say(self, message) -> None:
        os.write(1, framed(message))

    def picture(self, taken: datetime) -> None:
        self.frame += 1
        world = json.loads(self.world.read_text())
        camera = true_camera(self.name, world)
        seen = see(
            [camera],
            self.tags,
            Pose.identity(),
            self.rng,
            level_m=world.get("level_m", 0.0),
            slope_rad=np.radians(world.get("slope_deg", 0.0)),
        )
        tags = [told(one.tag_id, one.corners_px, one.sigma_px) for one in seen]
        since_s = taken.timestamp() - world.get("begun", math.inf)
        if since_s >= 0.0:
            square = np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0]]) + 60.0
            tags.append(told(200 + int(since_s / 0.1) % 16, square, 0.05))
        arrived = taken + timedelta(seconds=LATENCY_S)
        time.sleep(LATENCY_S)
        self.say(Sighting(self.name, self.frame, taken, arrived, self.size, "whole", tags))
        if self.order.board_views > self.boards:
            self.boards = self.order.board_views
            view = self.views[(self.boards - 1) % len(self.views)]
            numbers = np.rint(view.points_m[:, :2] / 0.05).astype(int) - 1
            corners = [
                BoardCorner(int(x + 10 * y), (float(u), float(v)))
                for (x, y), (u, v) in zip(numbers, view.pixels, strict=True)
            ]
            self.say(BoardView(self.name, self.frame, self.size, corners))


def told(tag_id, corners, sigma) -> TagSeen:
    return TagSeen(
        id=tag_id,
        corners_px=tuple(map(tuple, np.asarray(corners).tolist())),
        sigma_px=float(sigma),
        margin=60.0,
        hamming=0,
        blur_px=0.8,
    )


def listen(tank: Tank, reader: CameraReader) -> None:
    while data := os.read(0, 1 << 16):
        for order in reader.take(data):
            tank.order = order
    os._exit(0)


def main() -> None:
    reader, messages = CameraReader(), []
    while not messages:
        messages = reader.take(os.read(0, 1 << 16))
    number = int(messages[0].camera.rpartition("-")[2])
    tank = Tank(messages[0], number)
    for order in messages[1:]:
        tank.order = order
    threading.Thread(target=listen, args=(tank, reader), daemon=True).start()
    tank.say(SourceReport(tank.name, "running", "", 0, 0, {}, tank.size, 10.0))
    begun_s = time.time()
    for number in itertools.count(1):
        due_s = begun_s + number * PERIOD_S
        time.sleep(max(0.0, due_s - time.time()))
        tank.picture(datetime.fromtimestamp(due_s, UTC))


if __name__ == "__main__":
    sys.exit(main())
