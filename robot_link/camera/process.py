"""The process of one camera: ``python -m robot_link.camera.process``.

It is told its settings and orders on standard input, says what it sees on standard output
(``robot_link.camera.wire``), and ends when its input does. What libraries print goes to standard
error. It needs the extra ``camera``; without it, it says so and sees nothing.

Three threads: one waits for orders, one for pictures, and the main one (``eye``), which alone uses
the detector and writes, looks at the newest picture.
"""

import os
import sys
import threading
import time
from collections.abc import Sequence
from typing import Final

from robot_link.camera.extra import CameraExtraMissingError, check_extra
from robot_link.camera.sighting import Order, SourceReport, SourceSettings
from robot_link.camera.uri import camera_uri
from robot_link.camera.wire import (
    CameraReader,
    CameraWireError,
    FromCamera,
    ToCamera,
    framed,
)

COMMAND: Final = (sys.executable, "-m", "robot_link.camera.process")
_NICENESS: Final = 5
"""The station's own work goes before."""
_REPORT_S: Final = 1.0
_READ_BYTES: Final = 65536


class Orders:
    """What the station wishes, as it comes."""

    def __init__(self, settings: SourceSettings, order: Order, reader: CameraReader) -> None:
        self.settings, self.order = settings, order
        self._reader = reader

    @classmethod
    def first(cls, reader: CameraReader) -> "Orders | None":
        """Wait for the settings; ``None`` if standard input ends before.

        Raises:
            CameraWireError: If something else comes first.
        """
        while data := os.read(0, _READ_BYTES):
            messages = reader.take(data)
            if not messages:
                continue
            if not isinstance(messages[0], SourceSettings):
                raise CameraWireError("the first message is not the settings")
            orders = cls(messages[0], Order(), reader)
            orders.take(messages[1:])
            return orders
        return None

    def take(self, messages: Sequence[FromCamera | ToCamera]) -> None:
        """Take what came after the settings; the last order counts."""
        for message in messages:
            if not isinstance(message, Order):
                raise CameraWireError("a message is no order")
            self.order = message

    def follow(self) -> None:
        """Take orders until standard input ends, and end the process with it."""
        status = 0
        try:
            while data := os.read(0, _READ_BYTES):
                self.take(self._reader.take(data))
        except CameraWireError as error:
            sys.stderr.write(f"{error}\n")
            status = 2
        except OSError:
            status = 1
        # The main thread may be inside a library that never returns.
        os._exit(status)


def main() -> int:
    """Be the process of one camera; return the exit status."""
    output = _wire_output()
    os.nice(_NICENESS)
    try:
        orders = Orders.first(CameraReader())
    except CameraWireError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    if orders is None:
        return 0
    threading.Thread(target=orders.follow, name="orders", daemon=True).start()
    try:
        check_extra()
        uri = camera_uri(orders.settings.uri)
    except (CameraExtraMissingError, ValueError) as error:
        return _only_tell(orders, str(error), output)
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    from robot_link.camera.eye import Eye

    Eye(uri, orders, output).run()
    return 0


def _wire_output() -> int:
    """Return what was standard output, and let whatever libraries print go to standard error."""
    output = os.dup(1)
    os.dup2(2, 1)
    return output


def _only_tell(orders: Orders, words: str, output: int) -> int:
    """Say every second what is wrong, until the station ends."""
    report = SourceReport(orders.settings.camera, "failed", words, 0, 0, {})
    try:
        while True:
            os.write(output, framed(report))
            time.sleep(_REPORT_S)
    except BrokenPipeError:
        return 1


if __name__ == "__main__":
    sys.exit(main())
