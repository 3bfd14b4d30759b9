"""One running process of a camera: started, told, heard, ended."""

import asyncio
import contextlib
from collections.abc import AsyncGenerator, Sequence
from typing import Final

from robot_link.camera.process import COMMAND
from robot_link.camera.sighting import BoardView, Order, Sighting, SourceReport, SourceSettings
from robot_link.camera.wire import CameraReader, CameraWireError, FromCamera, framed
from robot_link.child_process import kill_child

__all__ = ["COMMAND", "CameraChild"]
_CHUNK_BYTES: Final = 1 << 18


class CameraChild:
    """Belongs to one event loop.

    Its standard input is the station's alone: the process ends when that closes, also where the
    station was killed. What it writes on its standard error is not kept, for libraries repeat
    addresses there.
    """

    def __init__(self, process: asyncio.subprocess.Process, camera: str) -> None:
        self._process = process
        self._camera = camera

    @classmethod
    async def start(cls, command: Sequence[str], settings: SourceSettings) -> "CameraChild":
        """Start a process and tell it its settings.

        Raises:
            OSError: If it cannot be started.
        """
        process = await asyncio.create_subprocess_exec(
            *command,
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
            limit=_CHUNK_BYTES,
        )
        child = cls(process, settings.camera)
        child._write(framed(settings))
        return child

    @property
    def process_id(self) -> int:
        """Of the operating system."""
        return self._process.pid

    def tell(self, order: Order) -> None:
        """Have an order take the place of the one before."""
        self._write(framed(order))

    async def messages(self) -> AsyncGenerator[FromCamera]:
        """Yield what it says until it ends.

        Raises:
            CameraWireError: If it speaks nonsense.
        """
        reader, stdout = CameraReader(), self._process.stdout
        while stdout is not None and (data := await stdout.read(_CHUNK_BYTES)):
            for message in reader.take(data):
                yield self._of_a_camera(message)

    async def end(self) -> None:
        """End the process at once and wait until it is gone, and its pipes are closed."""
        await kill_child(self._process)

    def _of_a_camera(self, message: object) -> FromCamera:
        if isinstance(message, bytes):
            return message
        if isinstance(message, Sighting | SourceReport | BoardView):
            if message.camera != self._camera:
                raise CameraWireError("it speaks of another camera")
            return message
        raise CameraWireError("it says what only the station says")

    def _write(self, data: bytes) -> None:
        stdin = self._process.stdin
        if stdin is not None and not stdin.is_closing():
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):
                stdin.write(data)
