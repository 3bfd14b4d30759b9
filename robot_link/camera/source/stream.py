"""What FFmpeg reads: cameras that stream by RTSP, and films.

FFmpeg is chosen by name, for the backend that OpenCV would choose itself ignores the timeouts. It
is told which protocols and kinds of files it may open: a film that is in truth a list of other
addresses is none. It follows redirects of RTSP and cannot be told not to, so the camera is asked
before, without its account, whether it sends elsewhere.
"""

import os
import socket
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from typing import Final
from urllib.parse import quote, urlsplit

import cv2
import numpy as np

from robot_link.camera.sighting import SourceSettings
from robot_link.camera.source.frame import (
    TIMEOUT_S,
    Frames,
    SourceEndedError,
    SourceError,
    arrived,
)
from robot_link.camera.uri import FileUri, RtspUri

_OPTIONS: Final = "OPENCV_FFMPEG_CAPTURE_OPTIONS"
_LOG_LEVEL: Final = "OPENCV_FFMPEG_LOGLEVEL"
_SAYS_NOTHING: Final = "-8"
"""FFmpeg's log would repeat addresses with their passwords."""
_PROBES_NO_RATE: Final = "0"
"""FFmpeg would look at twenty pictures for their rate before it gives the first; of a camera that
sends four a second, or fewer, until the opening is given up."""
_RTSP_PORT, _LINE_MAX = 554, 1024
_FILM_KINDS: Final = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi"


def rtsp_frames(uri: RtspUri, settings: SourceSettings) -> Frames:
    """Return the pictures of a network camera as they come."""
    latency_s = uri.latency_s if settings.latency_s is None else settings.latency_s
    options = {"rtsp_transport": uri.transport, "protocol_whitelist": "rtsp,rtp,tcp,udp"}
    options["fpsprobesize"] = _PROBES_NO_RATE
    url = _with_password(uri.url, settings)
    failure = "the camera cannot be reached, or wants another user and password"
    _refuse_redirect(uri.url, failure)
    with _opened(url, options, failure) as camera:
        for picture in _read(camera):
            yield arrived(picture, latency_s)
    raise SourceError("the camera ended its stream, or said nothing for a while")


def film_frames(uri: FileUri, settings: SourceSettings) -> Frames:
    """Return the pictures of a film, so many a second as the URI says."""
    try:
        path = uri.path(settings.folder)
    except ValueError as error:
        raise SourceError(str(error)) from None
    if not path.is_file():
        raise SourceError(f"there is no film {uri.name} in GRACE_CAMERA_DIR")
    options = {"protocol_whitelist": "file", "format_whitelist": _FILM_KINDS}
    shown = 0
    with _opened(str(path), options, f"{uri.name} is no film that can be read") as film:
        for picture in _read(film):
            yield arrived(picture, settings.latency_s or 0.0)
            shown += 1
            time.sleep(1.0 / uri.fps)
    raise SourceEndedError(f"all {shown} pictures of the film were shown")


def _refuse_redirect(url: str, failure: str) -> None:
    """Ask a camera what it would show.

    Raises:
        SourceError: If nobody answers, or the camera sends elsewhere.
    """
    parts = urlsplit(url)
    ask = f"DESCRIBE {url} RTSP/1.0\r\nCSeq: 1\r\nAccept: application/sdp\r\n\r\n"
    try:
        where = parts.hostname, parts.port or _RTSP_PORT
        with socket.create_connection(where, TIMEOUT_S) as line:
            line.sendall(ask.encode())
            begin = line.makefile("rb").readline(_LINE_MAX)
    except OSError:
        raise SourceError(failure) from None
    if begin.startswith(b"RTSP/") and begin.partition(b" ")[2].startswith(b"3"):
        raise SourceError("the camera sends elsewhere, which is not followed: write where it is")


def _with_password(url: str, settings: SourceSettings) -> str:
    if not settings.user and not settings.password:
        return url
    parts = urlsplit(url)
    who = f"{quote(settings.user, safe='')}:{quote(settings.password, safe='')}"
    return parts._replace(netloc=f"{who}@{parts.netloc}").geturl()


def _read(camera: cv2.VideoCapture) -> Iterator[np.ndarray]:
    while True:
        is_there, picture = camera.read()
        if not is_there:
            return
        yield np.asarray(picture)


@contextmanager
def _opened(url: str, options: dict[str, str], failure: str) -> Generator[cv2.VideoCapture]:
    os.environ[_OPTIONS] = "|".join(f"{name};{value}" for name, value in options.items())
    os.environ[_LOG_LEVEL] = _SAYS_NOTHING
    timeout_ms = round(1e3 * TIMEOUT_S)
    numbers = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, timeout_ms]
    numbers += [cv2.CAP_PROP_READ_TIMEOUT_MSEC, timeout_ms, cv2.CAP_PROP_N_THREADS, 1]
    camera = cv2.VideoCapture(url, cv2.CAP_FFMPEG, numbers)
    try:
        if not camera.isOpened():
            raise SourceError(failure)
        yield camera
    finally:
        camera.release()
