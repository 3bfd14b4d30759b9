"""A network camera by RTSP on loopback: JPEGs in RTP, interleaved on the one connection.

Source:
    RFC 2326 (RTSP), RFC 3550 (RTP), RFC 2435 (JPEG in RTP, quantization tables told in-band).
"""

import socketserver
import struct
import threading
import time
from base64 import b64encode
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress

_PART = 1200
_CLOCK_HZ = 90000


def _segments(jpeg: bytes) -> tuple[bytes, bytes]:
    """Return the quantization tables and the entropy-coded data of a baseline JPEG."""
    tables, at = b"", 2
    while True:
        marker, length = jpeg[at + 1], int.from_bytes(jpeg[at + 2 : at + 4], "big")
        if marker == 0xDB:
            body = jpeg[at + 4 : at + 2 + length]
            tables += b"".join(body[i + 1 : i + 65] for i in range(0, len(body), 65))
        at += 2 + length
        if marker == 0xDA:
            return tables, jpeg[at:-2]


def packets(jpeg: bytes, size: tuple[int, int], first: int, moment: int) -> list[bytes]:
    """Return a JPEG (4:2:0, sides divisible by 8) as RTP packets."""
    tables, data = _segments(jpeg)
    found: list[bytes] = []
    for begin in range(0, len(data), _PART):
        is_last = begin + _PART >= len(data)
        head = struct.pack(
            ">BBHII", 0x80, 26 | (0x80 if is_last else 0), (first + len(found)) % 65536, moment, 7
        )
        head += struct.pack(
            ">II", begin, (1 << 24) | (255 << 16) | size[0] // 8 << 8 | size[1] // 8
        )
        if begin == 0:
            head += struct.pack(">BBH", 0, 0, len(tables)) + tables
        found.append(head + data[begin : begin + _PART])
    return found


class _Handler(socketserver.StreamRequestHandler):
    @property
    def _camera(self) -> "RtspServer":
        assert isinstance(self.server, RtspServer)
        return self.server

    def handle(self) -> None:
        """Answer until the far end goes, or plays."""
        with suppress(OSError):
            while request := self._request():
                if not self._answer(*request):
                    self._play()

    def _request(self) -> tuple[str, str, dict[str, str]] | None:
        line = self.rfile.readline().decode()
        headers: dict[str, str] = {}
        while (text := self.rfile.readline().decode().strip()) or not line:
            if not line:
                return None
            name, _, value = text.partition(":")
            headers[name.lower()] = value.strip()
        method, url, _ = line.split(" ", 2)
        return method, url, headers

    def _answer(self, method: str, url: str, headers: dict[str, str]) -> bool:
        """Answer a request; return whether more of them may follow."""
        self._camera.asked.append((method, url, headers.get("transport", "")))
        wanted = "Basic " + b64encode(b"tank:secret").decode()
        status, more, body = "200 OK", "", ""
        if "/closed" in url and headers.get("authorization") != wanted:
            status, more = "401 Unauthorized", 'WWW-Authenticate: Basic realm="x"\r\n'
        elif "/elsewhere" in url and method != "OPTIONS":
            status, more = "302 Moved", f"Location: {self._camera.elsewhere}\r\n"
        elif method == "OPTIONS":
            more = "Public: OPTIONS, DESCRIBE, SETUP, PLAY, TEARDOWN\r\n"
        elif method == "DESCRIBE":
            body = "v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=x\r\nt=0 0\r\n"
            body += "m=video 0 RTP/AVP 26\r\na=control:track0\r\n"
            more = "Content-Type: application/sdp\r\n"
        elif method == "SETUP":
            more = "Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\nSession: 1\r\n"
        head = f"RTSP/1.0 {status}\r\nCSeq: {headers.get('cseq', '0')}\r\n{more}"
        self.wfile.write(f"{head}Content-Length: {len(body)}\r\n\r\n{body}".encode())
        return method != "PLAY" or not status.startswith("200")

    def _play(self) -> None:
        number, begun_s = 0, time.monotonic()
        while not self._camera.is_stopped.wait(0.05):
            moment = round((time.monotonic() - begun_s) * _CLOCK_HZ)
            for packet in packets(self._camera.picture(), self._camera.size, number, moment):
                self.wfile.write(struct.pack(">cBH", b"$", 0, len(packet)) + packet)
                number += 1


class RtspServer(socketserver.ThreadingTCPServer):
    """Plays what ``picture`` gives; ``/closed`` wants the user *tank* and the password *secret*.

    ``/elsewhere`` sends to another address.
    """

    daemon_threads = True

    def __init__(self, picture: Callable[[], bytes], size: tuple[int, int]) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.picture, self.size = picture, size
        self.asked: list[tuple[str, str, str]] = []
        self.elsewhere = ""
        self.is_stopped = threading.Event()

    @property
    def address(self) -> str:
        """Begin of its URLs."""
        return f"rtsp://127.0.0.1:{self.server_address[1]}"


@contextmanager
def playing(picture: Callable[[], bytes], size: tuple[int, int]) -> Generator[RtspServer]:
    """Run a camera."""
    with RtspServer(picture, size) as camera:
        thread = threading.Thread(target=camera.serve_forever, args=(0.05,))
        thread.start()
        try:
            yield camera
        finally:
            camera.is_stopped.set()
            camera.shutdown()
            thread.join()
