"""A process that speaks as a camera's does, and misbehaves as it is told by its URI's options.

``python -m tests.server.camera.stand_in`` is run in place of ``robot_link.camera.process``.
"""

import io
import os
import sys
import threading
import time
from datetime import UTC, datetime, timedelta
from urllib.parse import parse_qs, urlsplit

import msgspec
from PIL import Image

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

SIZE = (320, 240)
TAG = TagSeen(
    id=100,
    corners_px=((100.0, 80.0), (140.0, 80.0), (140.0, 120.0), (100.0, 120.0)),
    sigma_px=0.05,
    margin=60.0,
    hamming=0,
    blur_px=0.8,
)


class StandIn:
    def __init__(self, settings: SourceSettings) -> None:
        self.camera = settings.camera
        options = parse_qs(urlsplit(settings.uri).query)
        self.option = {name: values[0] for name, values in options.items()}
        self.order = Order()
        self.boards = 0
        self.frame = 0
        self.began = datetime.now(UTC)

    def say(self, message: object) -> None:
        os.write(1, framed(message))  # type: ignore[arg-type]

    def picture(self) -> None:
        now = datetime.now(UTC)
        taken = now - timedelta(seconds=float(self.option.get("age_s", "0.03")))
        if self.option.get("times") == "back":
            # They go back within a stretch and begin anew before they are old.
            stretch = self.frame % 64
            self.began = self.began if stretch else now
            taken = self.began - timedelta(milliseconds=stretch)
        self.frame += 1
        shift = 0.0 if "still" in self.option else 0.001 * (self.frame % 7)
        corners = tuple((x + shift, y) for x, y in TAG.corners_px)
        tag = msgspec.structs.replace(TAG, corners_px=corners)
        sighting = Sighting(self.camera, self.frame, taken, now, SIZE, "whole", [tag])
        self.say(sighting)
        if self.order.wants_previews:
            out = io.BytesIO()
            Image.new("RGB", SIZE, (40, 60, 80)).save(out, "JPEG")
            self.say(out.getvalue())
        if self.order.board_views > self.boards:
            self.boards = self.order.board_views
            corners = [
                BoardCorner(i, (30.0 + 20.0 * (i % 10), 30.0 + 20.0 * (i // 10))) for i in range(70)
            ]
            self.say(BoardView(self.camera, self.frame, SIZE, corners))


def listen(stand_in: StandIn, reader: CameraReader) -> None:
    """Take orders; end with the station, even where the rest hangs."""
    while data := os.read(0, 1 << 16):
        for order in reader.take(data):
            stand_in.order = order
    os._exit(0)


def main() -> None:
    reader = CameraReader()
    messages: list = []
    while not messages:
        messages = reader.take(os.read(0, 1 << 16))
    stand_in = StandIn(messages[0])
    for order in messages[1:]:
        stand_in.order = order
    threading.Thread(target=listen, args=(stand_in, reader), daemon=True).start()
    stand_in.say(SourceReport(stand_in.camera, "running", "", 0, 0, {}, SIZE, 10.0))
    limit = int(stand_in.option.get("pictures", "1000000"))
    while stand_in.frame < limit:
        stand_in.picture()
        time.sleep(float(stand_in.option.get("period_s", "0.05")))
    match stand_in.option.get("then"):
        case "nonsense":
            os.write(1, b"\xff" * 64)
            time.sleep(600)
        case "end":
            sys.exit(3)
        case _:
            time.sleep(600)


if __name__ == "__main__":
    main()
