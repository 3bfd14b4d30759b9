"""A process that sees a robot in the tank as a camera would, with stated noise, and no pixels.

``python -m tests.server.fix.camera_stand_in`` is run in place of ``robot_link.camera.process``. The
robot glides as ``tests.autonomy.vision.test_tracker.dive`` says, from midnight on.
"""

import os
import threading
import time
from datetime import UTC, datetime

import numpy as np

from robot_link.camera.sighting import Sighting, SourceReport, TagSeen
from robot_link.camera.wire import CameraReader, framed
from tests.autonomy.vision.tank import ROBOT, overhead_cameras, see
from tests.autonomy.vision.test_tracker import dive

PERIOD_S = 0.2


def pose_at(moment: datetime):
    """Return where the robot really is."""
    return dive(moment.timestamp() % 86400.0)


def listen(reader: CameraReader) -> None:
    while data := os.read(0, 1 << 16):
        reader.take(data)
    os._exit(0)


def main() -> None:
    reader, messages = CameraReader(), []
    while not messages:
        messages = reader.take(os.read(0, 1 << 16))
    name = messages[0].camera
    camera = next(one for one in overhead_cameras() if one.name == name)
    rng = np.random.default_rng(int(name.rpartition("-")[2]))
    threading.Thread(target=listen, args=(reader,), daemon=True).start()
    size = (camera.lens.width_px, camera.lens.height_px)
    os.write(1, framed(SourceReport(name, "running", "", 0, 0, {}, size, 5.0)))
    frame, number = 0, int(time.time() / PERIOD_S)
    while True:
        # All cameras take pictures of the same moments, however late their processes run.
        number += 1
        time.sleep(max(0.0, number * PERIOD_S - time.time()))
        frame += 1
        taken = datetime.fromtimestamp(number * PERIOD_S, UTC)
        tags = [
            TagSeen(
                id=seen.tag_id,
                corners_px=tuple(map(tuple, seen.corners_px.tolist())),
                sigma_px=seen.sigma_px,
                margin=60.0,
                hamming=0,
                blur_px=0.8,
            )
            for seen in see((camera,), ROBOT.tags, pose_at(taken), rng, least_side_px=14.0)
        ]
        arrived = datetime.now(UTC)
        os.write(1, framed(Sighting(name, frame, taken, arrived, size, "whole", tags)))


if __name__ == "__main__":
    main()
