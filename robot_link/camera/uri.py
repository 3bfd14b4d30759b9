"""The one place where a URI says what kind of camera it is; nothing else is ever opened.

=========================================================  =====================================
``v4l2:///dev/video0?size=1280x720&fps=10&exposure=0.01``  a webcam here; exposure in s
``http://host:port/path?fps=10``, ``https://``             MJPEG, or single JPEGs, again and again
``rtsp://host:port/path?transport=tcp&fps=10``             a network camera
``folder:name?fps=5``, ``video:name.mp4``                  files below ``GRACE_CAMERA_DIR``
=========================================================  =====================================

``fps`` is how many pictures a second are looked at, at most; a camera that sends more is not asked
to send less. Other options of a network address are the camera's own and go to it as they are.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import ClassVar, Final

import httpx

from robot_link.transport.uri import LinkUri

_FPS, _FPS_MOST = 10, 60
_FOLDER_FPS: Final = 5
_SIDE_LEAST, _SIDE_MOST = 64, 4096
_EXPOSURE_LEAST_S, _EXPOSURE_MOST_S = 0.0001, 1.0
_LONGEST: Final = 2000
_DEVICE: Final = re.compile(r"/dev/video[\w-]{0,40}", re.ASCII)
_RESOLVED_DEVICE: Final = re.compile(r"/dev/video[0-9]{1,3}")
_SIZE: Final = re.compile(r"([0-9]{1,5})x([0-9]{1,5})")
_NAME: Final = re.compile(r"\w[\w.-]{0,99}(/\w[\w.-]{0,99}){0,9}", re.ASCII)
_VIDEO_ENDINGS: Final = (".mp4", ".mkv", ".webm", ".avi", ".mov")
_SECRET_OPTIONS: Final = frozenset(
    {"user", "usr", "username", "login", "password", "passwd", "pass", "pwd", "psw"}
    | {"loginuse", "loginpas", "auth", "token", "access_token", "key", "apikey", "api_key"}
)


@dataclass(frozen=True, slots=True)
class DeviceUri:
    """A webcam at this machine."""

    device: str
    size: tuple[int, int]
    fps: int
    exposure_s: float | None
    """As told by hand; ``None`` leaves it to the camera."""
    latency_s: ClassVar[float] = 0.08

    def path(self) -> Path:
        """Return the device, links resolved.

        Raises:
            ValueError: If it is a link to anything else than a video device.
        """
        path = Path(self.device).resolve()
        if not _RESOLVED_DEVICE.fullmatch(str(path)):
            raise ValueError(f"{self.device} leads to {path}, which is no video device")
        return path


@dataclass(frozen=True, slots=True)
class HttpUri:
    """A camera that is asked by HTTP."""

    url: str
    fps: int
    latency_s: ClassVar[float] = 0.03


@dataclass(frozen=True, slots=True)
class RtspUri:
    """A camera that streams by RTSP."""

    url: str
    transport: str
    """``tcp`` or ``udp``."""
    fps: int
    latency_s: ClassVar[float] = 0.30


@dataclass(frozen=True, slots=True)
class FileUri:
    """A folder of pictures, or a film."""

    name: str
    is_video: bool
    fps: int
    latency_s: ClassVar[float] = 0.0

    def path(self, folder: Path | str | None) -> Path:
        """Return where it lies, links resolved.

        Args:
            folder: ``GRACE_CAMERA_DIR``.

        Raises:
            ValueError: If there is no such folder, or the name leads out of it.
        """
        if folder is None:
            raise ValueError(
                "folders and videos are read below GRACE_CAMERA_DIR only, which is not set"
            )
        path = Path(folder, self.name).resolve()
        if not is_below(path, folder):
            raise ValueError(f"{self.name} leads out of GRACE_CAMERA_DIR")
        return path


CameraUri = DeviceUri | HttpUri | RtspUri | FileUri


def is_below(path: Path, folder: Path | str) -> bool:
    """Tell whether a path, links resolved, lies inside of a folder."""
    whole = Path(folder).resolve()
    resolved = path.resolve()
    return resolved.is_relative_to(whole) and resolved != whole


def camera_uri(text: str) -> CameraUri:
    """Return the camera that a URI names. Nothing is opened.

    Raises:
        ValueError: If it names none; the message begins with the URI and says what is wrong.
    """
    if len(text) > _LONGEST:
        raise ValueError(f"{text[:40]}...: a camera is written in at most {_LONGEST} characters")
    uri = LinkUri(text, "camera")
    taker = _TAKERS.get(uri.scheme)
    if taker is None:
        known = ", ".join(_TAKERS)
        uri.refuse(f"unknown kind of camera {uri.scheme!r}; known are {known}")
    return taker(uri)


def _device(uri: LinkUri) -> DeviceUri:
    if uri.netloc:
        uri.refuse("the path of a webcam begins after three slashes, as in :///dev/video0")
    if not _DEVICE.fullmatch(uri.path):
        uri.refuse("a webcam is a device /dev/video and a number")
    size, fps = _size(uri), _fps(uri)
    exposure_s = uri.decimal("exposure", None, _EXPOSURE_LEAST_S, _EXPOSURE_MOST_S)
    uri.finish()
    return DeviceUri(uri.path, size, fps, exposure_s)


def _size(uri: LinkUri) -> tuple[int, int]:
    text = uri.word("size", "1280x720")
    found = _SIZE.fullmatch(text)
    if found is None:
        uri.refuse(f"size must be width x height, as 1280x720, not {text[:20]!r}")
    width, height = int(found[1]), int(found[2])
    if not all(_SIDE_LEAST <= side <= _SIDE_MOST for side in (width, height)):
        uri.refuse(f"size must be {_SIDE_LEAST} to {_SIDE_MOST} px a side, not {text}")
    return width, height


def _http(uri: LinkUri) -> HttpUri:
    _check_network(uri)
    fps = _fps(uri)
    return HttpUri(_url(uri, ("fps",)), fps)


def _rtsp(uri: LinkUri) -> RtspUri:
    _check_network(uri)
    transport = uri.choice("transport", {"tcp": "tcp", "udp": "udp"}, default="tcp")
    fps = _fps(uri)
    return RtspUri(_url(uri, ("transport", "fps")), transport, fps)


def _check_network(uri: LinkUri) -> None:
    if not uri.host:
        uri.refuse("a camera in the network needs its host, as in http://192.0.2.7/video")
    if uri.port == 0:
        uri.refuse("port must be 1 to 65535, not 0")
    uri.check_host()
    for name in uri.options():
        if name.lower() in _SECRET_OPTIONS:
            uri.refuse(f"a camera has no user name and no password, and no option {name}")


def _url(uri: LinkUri, ours: tuple[str, ...]) -> str:
    """Return the camera's own address, without the options that are meant for the station."""
    theirs = [part for part in uri.query.split("&") if part.partition("=")[0] not in ours]
    query = "&".join(theirs)
    url = f"{uri.scheme}://{uri.netloc}{uri.path}" + (f"?{query}" if query else "")
    try:
        host = httpx.URL(url).host
    except (httpx.InvalidURL, UnicodeError) as error:
        uri.refuse(f"is no address: {error}")
    if not host:
        uri.refuse("is no address: it has no host")
    return url


def _file(uri: LinkUri) -> FileUri:
    is_video = uri.scheme == "video"
    if uri.netloc or not _NAME.fullmatch(uri.path):
        uri.refuse(
            f"a {uri.scheme} is named below GRACE_CAMERA_DIR, of letters, digits, _ - . and /,"
            f" as in {uri.scheme}:tank-1{'.mp4' if is_video else ''}"
        )
    if is_video and not uri.path.lower().endswith(_VIDEO_ENDINGS):
        uri.refuse(f"a video ends in {', '.join(_VIDEO_ENDINGS)}")
    fps = uri.whole("fps", _FOLDER_FPS, 1, _FPS_MOST)
    uri.finish()
    return FileUri(uri.path, is_video, fps)


def _fps(uri: LinkUri) -> int:
    return uri.whole("fps", _FPS, 1, _FPS_MOST)


_TAKERS: Final[Mapping[str, Callable[[LinkUri], CameraUri]]] = MappingProxyType(
    {"v4l2": _device, "http": _http, "https": _http, "rtsp": _rtsp, "folder": _file, "video": _file}
)
CAMERA_SCHEMES: Final = tuple(_TAKERS)
"""Kinds of cameras."""
