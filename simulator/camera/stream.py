"""Serves the pictures of emulated cameras on loopback as webcams do: an endless multipart of JPEGs.

``GET /camera/<id>`` answers ``multipart/x-mixed-replace``. A camera draws only while somebody
reads; who is slow gets the newest picture next and holds up nobody.
"""

import asyncio
import base64
import hmac
import logging
from collections.abc import AsyncGenerator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import asynccontextmanager
from dataclasses import dataclass

from robot_link.camera.extra import check_extra
from simulator.camera.painter import Painter
from simulator.camera.tank import EmulatedTank, Exposure

CLIENTS_MAX = 16
"""Of all cameras together."""
FPS = 10.0
_HEAD_MAX, _HEAD_S = 8192, 5.0
_STALLED_S = 20.0
"""A client that takes nothing for so long is hung up on."""
_LOOK_S = 0.1
_BOUNDARY = "picture"

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Account:
    """Who may look."""

    user: str
    password: str

    @property
    def header(self) -> str:
        """What such a client sends as ``Authorization``."""
        return "Basic " + base64.b64encode(f"{self.user}:{self.password}".encode()).decode()


class _Camera:
    """Draws one camera's pictures while somebody waits for them."""

    def __init__(self, name: str, tank: EmulatedTank, executor: Executor, fps: float) -> None:
        self.name = name
        self.drawn = 0
        """Pictures until now."""
        self._tank, self._executor, self._fps = tank, executor, fps
        self._painter: Painter | None = None
        self._newest = b""
        self._number = 0
        self._readers = 0
        self._wanted = asyncio.Event()
        self._fresh = asyncio.Condition()

    async def run(self) -> None:
        """Draw until cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            await self._wanted.wait()
            due = loop.time() + 1.0 / self._fps
            if not (self._tank.trouble(self.name).is_frozen and self._newest):
                exposure = self._tank.exposure(self.name)
                self._newest = await loop.run_in_executor(self._executor, self._draw, exposure)
                self.drawn += 1
            async with self._fresh:
                self._number += 1
                self._fresh.notify_all()
            await asyncio.sleep(max(due - loop.time(), 0.0))

    @asynccontextmanager
    async def watched(self) -> AsyncGenerator[None]:
        """Let it draw as long as the context lasts."""
        self._readers += 1
        self._wanted.set()
        try:
            yield
        finally:
            self._readers -= 1
            if not self._readers:
                self._wanted.clear()

    async def after(self, number: int) -> tuple[int, bytes]:
        """Wait for a picture that is newer than one; return the newest with its number."""
        async with self._fresh:
            await self._fresh.wait_for(lambda: self._number > number)
            return self._number, self._newest

    def _draw(self, exposure: Exposure) -> bytes:
        """Runs in the worker thread, which alone uses the painter."""
        painter = self._painter
        is_same = (
            painter is not None
            and painter.scene is exposure.scene
            and (painter.camera.packed == exposure.camera.packed).all()
        )
        if painter is None or not is_same:
            painter = self._painter = Painter(exposure.scene, exposure.camera)
        picture = painter.picture(exposure.at.timestamp(), exposure.robots, exposure.board)
        return painter.jpeg(picture)


class CameraServer:
    """Serves every camera of a tank. Belongs to one event loop.

    Args:
        tank: What they look at.
        account: Who may look; None for everybody on this machine.
        fps: Pictures a second of each camera, at most, by the wall's clock.
        clients_max: Readers of all cameras together.

    Raises:
        CameraExtraMissingError: If OpenCV is not installed.
    """

    def __init__(
        self,
        tank: EmulatedTank,
        account: Account | None = None,
        fps: float = FPS,
        clients_max: int = CLIENTS_MAX,
    ) -> None:
        check_extra()
        self._tank = tank
        self._account = account
        self._clients_max = clients_max
        self._executor = ThreadPoolExecutor(1, thread_name_prefix="camera")
        self._cameras = {
            camera.name: _Camera(camera.name, tank, self._executor, fps)
            for camera in tank.scene.cameras
        }
        self._clients: set[asyncio.Task[None]] = set()

    def drawn(self, camera: str) -> int:
        """Return how many pictures a camera has drawn."""
        return self._cameras[camera].drawn

    @property
    def clients(self) -> int:
        """How many readers there are."""
        return len(self._clients)

    @asynccontextmanager
    async def serve(self, port: int = 0) -> AsyncGenerator[str]:
        """Serve as long as the context lasts; give the address, such as ``http://127.0.0.1:8090``.

        Raises:
            OSError: If the port is taken.
            ExceptionGroup: If a camera could not draw.
        """
        server = await asyncio.start_server(self._took, "127.0.0.1", port, limit=_HEAD_MAX)
        try:
            async with asyncio.TaskGroup() as group:
                drawing = [
                    group.create_task(camera.run(), name=f"{name} pictures")
                    for name, camera in self._cameras.items()
                ]
                yield f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}"
                for task in drawing:
                    task.cancel()
        finally:
            server.close()
            for client in self._clients:
                client.cancel()
            if self._clients:
                await asyncio.wait(self._clients)
            await server.wait_closed()
            await asyncio.to_thread(self._executor.shutdown)

    def _took(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        client = asyncio.get_running_loop().create_task(
            self._client(reader, writer), name="camera client"
        )
        self._clients.add(client)
        client.add_done_callback(self._clients.discard)

    async def _client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            writer.transport.set_write_buffer_limits(high=0)
            async with asyncio.timeout(_HEAD_S):
                head = await reader.readuntil(b"\r\n\r\n")
            status, camera = self._asked(head.decode("latin-1"))
            if camera is None:
                writer.write(_refusal(status))
                async with asyncio.timeout(_HEAD_S):
                    await writer.drain()
            elif not self._tank.trouble(camera.name).is_cut:
                await self._stream(camera, writer)
        except (TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, OSError):
            pass  # it hung up, or said nothing that can be read
        finally:
            writer.transport.abort() if writer.transport.is_closing() else writer.close()

    def _asked(self, head: str) -> tuple[str, _Camera | None]:
        """Return the answer's status to a request, and the camera that it asks for."""
        first, *lines = head.split("\r\n")
        method, _, rest = first.partition(" ")
        path = rest.partition(" ")[0].partition("?")[0]
        fields = {
            name.strip().lower(): value.strip()
            for name, colon, value in (line.partition(":") for line in lines)
            if colon
        }
        said = fields.get("authorization", "").encode()
        if method != "GET":
            return "405 Method Not Allowed", None
        if self._account is not None and not hmac.compare_digest(
            said, self._account.header.encode()
        ):
            return "401 Unauthorized", None
        camera = self._cameras.get(path.removeprefix("/camera/"))
        if camera is None or not path.startswith("/camera/"):
            return "404 Not Found", None
        if len(self._clients) > self._clients_max:
            return "503 Service Unavailable", None
        return "200 OK", camera

    async def _stream(self, camera: _Camera, writer: asyncio.StreamWriter) -> None:
        """Send one picture after the other until the reader is gone, or the camera is cut off."""
        writer.write(
            b"HTTP/1.1 200 OK\r\nCache-Control: no-store\r\nConnection: close\r\n"
            b"Content-Type: multipart/x-mixed-replace; boundary=" + _BOUNDARY.encode() + b"\r\n\r\n"
        )
        number = 0
        async with camera.watched():
            while not self._tank.trouble(camera.name).is_cut:
                trouble = self._tank.trouble(camera.name)
                if trouble.is_silent:
                    await asyncio.sleep(_LOOK_S)
                    continue
                number, jpeg = await camera.after(number)
                head = f"--{_BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}"
                writer.write(head.encode() + b"\r\n\r\n" + jpeg + b"\r\n")
                async with asyncio.timeout(_STALLED_S):
                    await writer.drain()


def _refusal(status: str) -> bytes:
    asks = '\r\nWWW-Authenticate: Basic realm="cameras"' if status.startswith("401") else ""
    head = f"HTTP/1.1 {status}{asks}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
    return head.encode()
