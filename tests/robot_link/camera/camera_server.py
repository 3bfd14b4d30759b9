"""A camera in the network, on loopback: a stream of JPEGs, single ones, and every kind of fault."""

import threading
from base64 import b64encode
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import cv2
import numpy as np

from autonomy.vision.corner_kernel import Picture


def jpeg(grey: Picture, *options: int) -> bytes:
    """Return a picture as a JPEG."""
    return cv2.imencode(".jpg", grey, list(options))[1].tobytes()


def noise(rng: np.random.Generator, size: tuple[int, int] = (320, 240)) -> Picture:
    """Return a grey picture with noise, so that no two are the same."""
    width, height = size
    return np.clip(rng.normal(120.0, 5.0, (height, width)), 0, 255).astype(np.uint8)


class CameraServer:
    """Answers every path below ``/`` with what ``picture`` gives, as its name wishes.

    ``/stream`` sends parts with their length, ``/lengthless`` without; ``/cut`` ends after three;
    ``/one`` sends a single picture, ``/page`` no picture, ``/elsewhere`` a redirect, ``/closed``
    wants a password, ``/endless`` never ends its picture, ``/silent`` says nothing.
    """

    def __init__(self, picture: Callable[[], bytes], pause_s: float) -> None:
        self.picture, self.pause_s = picture, pause_s
        self.asked: list[str] = []
        self.is_stopped = threading.Event()
        self._http = ThreadingHTTPServer(("127.0.0.1", 0), self._handler())
        self._http.daemon_threads = True
        self._thread = threading.Thread(target=self._http.serve_forever, args=(0.05,))

    @property
    def address(self) -> str:
        """Begin of its URLs."""
        return f"http://127.0.0.1:{self._http.server_address[1]}"

    def start(self) -> None:
        """Begin to answer."""
        self._thread.start()

    def stop(self) -> None:
        """End every stream."""
        self.is_stopped.set()
        self._http.shutdown()
        self._http.server_close()
        self._thread.join()

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        camera = self

        class Handler(BaseHTTPRequestHandler):
            def log_message(self, format: str, *args: object) -> None:
                """Say nothing."""

            def do_GET(self) -> None:
                path = self.path.partition("?")[0]
                camera.asked.append(self.path)
                with suppress(BrokenPipeError, ConnectionResetError):
                    getattr(self, f"_{path.strip('/')}", self._nothing)()

            def _begin(self, status: int = 200, **headers: str) -> None:
                self.send_response(status)
                for name, value in headers.items():
                    self.send_header(name.replace("_", "-"), value)
                self.end_headers()

            def _nothing(self) -> None:
                self._begin(404, content_length="0")

            def _stream(self, count: int = 10**9, *, with_length: bool = True) -> None:
                self._begin(content_type="multipart/x-mixed-replace; boundary=--frame")
                while count and not camera.is_stopped.is_set():
                    body = camera.picture()
                    length = f"Content-Length: {len(body)}\r\n" if with_length else ""
                    head = f"--frame\r\nContent-Type: image/jpeg\r\n{length}\r\n"
                    self.wfile.write(head.encode() + body + b"\r\n")
                    camera.is_stopped.wait(camera.pause_s)
                    count -= 1

            def _lengthless(self) -> None:
                self._stream(with_length=False)

            def _cut(self) -> None:
                self._stream(3)

            def _one(self) -> None:
                body = camera.picture()
                self._begin(content_type="image/jpeg", content_length=str(len(body)))
                self.wfile.write(body)

            def _page(self) -> None:
                self._begin(content_type="text/html", content_length="0")

            def _elsewhere(self) -> None:
                self._begin(302, location="/one", content_length="0")

            def _closed(self) -> None:
                wanted = "Basic " + b64encode(b"tank:secret").decode()
                if self.headers.get("authorization") == wanted:
                    self._one()
                else:
                    self._begin(401, www_authenticate='Basic realm="x"', content_length="0")

            def _endless(self) -> None:
                self._begin(content_type="image/jpeg")
                while not camera.is_stopped.is_set():
                    self.wfile.write(bytes(1 << 20))

            def _silent(self) -> None:
                camera.is_stopped.wait()

        return Handler


@contextmanager
def serving(picture: Callable[[], bytes], pause_s: float = 0.02) -> Generator[CameraServer]:
    """Run a camera."""
    camera = CameraServer(picture, pause_s)
    camera.start()
    try:
        yield camera
    finally:
        camera.stop()
