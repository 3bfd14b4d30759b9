"""A real camera of a robot: the process that looks at its pictures, as a source of the node.

It is the process that a station runs for each of its cameras (``robot_link.camera.process``): the
detector is C code that can crash, and a process that ends is begun again. It sees every picture
whole, and is asked for no picture.
"""

import asyncio
import logging
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import suppress
from datetime import UTC, datetime

from onboard.node.camera import CameraWords, TagView
from robot_link.camera.process import COMMAND
from robot_link.camera.sighting import Sighting, SourceReport, SourceSettings
from robot_link.camera.wire import CameraReader, CameraWireError, framed
from robot_link.child_process import kill_child

_BEGIN_AGAIN_S = 2.0
_READ_BYTES = 65536
_END_S = 2.0

_log = logging.getLogger(__name__)


class CameraProcess:
    """One camera by its URI (``robot_link.camera.uri``), such as ``v4l2:///dev/video0?fps=2``.

    Args:
        settings: Which camera, its latency and its curve.
        count_s: The robot's counter now.
        command: The process; by default the real one.
    """

    def __init__(
        self,
        settings: SourceSettings,
        count_s: Callable[[], float],
        command: Sequence[str] = COMMAND,
    ) -> None:
        self._settings = settings
        self._count_s = count_s
        self._command = command
        self._words = ""

    async def views(self) -> AsyncIterator[TagView | CameraWords]:
        """Yield what is seen, for ever; while the process is gone, that."""
        while True:
            async for seen in self._life():
                yield seen
            self._words = "the process of the camera ended; it is begun again"
            yield CameraWords(self._words)
            await asyncio.sleep(_BEGIN_AGAIN_S)

    async def _life(self) -> AsyncIterator[TagView | CameraWords]:
        """Yield what one process sees until it ends or speaks nonsense."""
        pipe = asyncio.subprocess.PIPE
        starting = asyncio.ensure_future(
            asyncio.create_subprocess_exec(*self._command, stdin=pipe, stdout=pipe)
        )
        reader = CameraReader()
        try:
            process = await asyncio.shield(starting)
            assert process.stdin is not None  # noqa: S101 - as asked for
            assert process.stdout is not None  # noqa: S101 - as asked for
            process.stdin.write(framed(self._settings))
            while data := await process.stdout.read(_READ_BYTES):
                for message in reader.take(data):
                    if isinstance(message, Sighting):
                        yield self._view(message)
                    elif isinstance(message, SourceReport) and message.words != self._words:
                        self._words = message.words
                        yield CameraWords(message.words)
        except CameraWireError as error:
            _log.warning("camera %s speaks nonsense: %s", self._settings.camera, error)
        finally:
            ending = asyncio.ensure_future(_ended(starting))
            try:
                await asyncio.shield(ending)
            except asyncio.CancelledError:
                await ending  # whoever is cancelled leaves no process behind
                raise

    def _view(self, seen: Sighting) -> TagView:
        """Return a sighting with the count of the moment at which its picture was taken."""
        age_s = (datetime.now(UTC) - seen.taken_at).total_seconds()
        return TagView(self._count_s() - age_s, seen.tags)


async def _ended(starting: asyncio.Future[asyncio.subprocess.Process]) -> None:
    """End a process: by closing its input, and if it does not end then, for good."""
    process = await starting
    with suppress(TimeoutError):
        async with asyncio.timeout(_END_S):
            await process.communicate()
            return
    await kill_child(process)
