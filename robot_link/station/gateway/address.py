"""The URIs of links that are no radio: satellite modems, the acoustic modem, and cameras.

A satellite modem is reached by its IMEI through the gateway that knows it::

    rockblock://300234010753370
    directip://300234010753370
    cloudloop://<thing>?imei=300234010753370
    micromodem:///dev/ttyUSB1?us=1&peer=2&baud=19200
    micromodem://127.0.0.1:5005?us=1&peer=2

Cameras over the water see a robot by its tags, which are registered under a name::

    cameras:///?tags=mini-1
"""

from dataclasses import dataclass
from typing import Final
from urllib.parse import parse_qsl, urlsplit

from robot_link.station.gateway.gateway import is_imei
from robot_link.transport.opening import open_transport

SATELLITE_CARRIERS: Final = ("rockblock", "directip", "cloudloop")
ACOUSTIC_CARRIER: Final = "micromodem"
CAMERA_CARRIER: Final = "cameras"
_NODE_MAX: Final = 15
"""Micro-Modem addresses are 0..15."""


@dataclass(frozen=True, slots=True)
class AcousticAddress:
    """Where an acoustic modem is, and whom it speaks to."""

    device: str | None
    """Path of its serial line; None where it is a TCP port."""
    host: str | None
    port: int | None
    baud: int
    us: int
    """Address of the modem at the port."""
    peer: int
    """Address of the robot's modem."""


def is_satellite(uri: str) -> bool:
    """Tell whether a link goes by satellite; the URI need not be valid."""
    return uri.partition("://")[0] in SATELLITE_CARRIERS


def is_acoustic(uri: str) -> bool:
    """Tell whether a link is an acoustic modem; the URI need not be valid."""
    return uri.partition("://")[0] == ACOUSTIC_CARRIER


def is_cameras(uri: str) -> bool:
    """Tell whether a link is that by which cameras see a robot; the URI need not be valid."""
    return uri.partition(":")[0] == CAMERA_CARRIER


def camera_tags(uri: str) -> str:
    """Return under which name the tags are registered by which cameras know a robot.

    Raises:
        ValueError: If it is no such link; the message says what is wrong.
    """
    parts = urlsplit(uri)
    if parts.scheme != CAMERA_CARRIER:
        raise ValueError(f"{uri}: {parts.scheme!r} are no cameras")
    options = dict(parse_qsl(parts.query, keep_blank_values=True))
    tags = options.pop("tags", "")
    if not tags:
        raise ValueError(f"{uri}: a link by cameras says whose tags, such as ?tags=mini-1")
    if parts.netloc or parts.path.strip("/") or parts.fragment:
        raise ValueError(f"{uri}: a link by cameras names none; it is cameras:///?tags={tags}")
    if options:
        raise ValueError(f"{uri}: unknown option {', '.join(options)}")
    return tags


def satellite_address(uri: str) -> tuple[str, str]:
    """Return carrier and IMEI of a satellite link.

    Raises:
        ValueError: If it is none; the message says what is wrong.
    """
    parts = urlsplit(uri)
    options = dict(parse_qsl(parts.query, keep_blank_values=True))
    if parts.scheme not in SATELLITE_CARRIERS:
        raise ValueError(f"{uri}: {parts.scheme!r} is no satellite gateway")
    if parts.scheme == "cloudloop":
        if not parts.netloc:
            raise ValueError(f"{uri}: a Cloudloop link needs the id of its thing")
        imei = options.pop("imei", "")
    else:
        imei = parts.netloc
    if not is_imei(imei):
        raise ValueError(f"{uri}: an IMEI has 15 digits, unlike {imei!r}")
    if options or parts.path.strip("/"):
        raise ValueError(f"{uri}: unknown option {', '.join(options) or parts.path}")
    return parts.scheme, imei


def cloudloop_thing(uri: str) -> str:
    """Return Cloudloop's id of the modem of a ``cloudloop`` link; letters keep their case.

    Raises:
        ValueError: If it is no such link.
    """
    carrier, _ = satellite_address(uri)
    if carrier != "cloudloop":
        raise ValueError(f"{uri}: only a cloudloop link names a thing")
    return urlsplit(uri).netloc


def acoustic_address(uri: str) -> AcousticAddress:
    """Return where the acoustic modem of a link is, and whom it speaks to.

    Raises:
        ValueError: If it is no such link; the message says what is wrong.
    """
    parts = urlsplit(uri)
    if parts.scheme != ACOUSTIC_CARRIER:
        raise ValueError(f"{uri}: {parts.scheme!r} is no acoustic modem")
    options = dict(parse_qsl(parts.query, keep_blank_values=True))
    us, peer = (_node(uri, options, name) for name in ("us", "peer"))
    if us == peer:
        raise ValueError(f"{uri}: us and peer are both {us}")
    baud = options.pop("baud", "19200")
    if not (baud.isascii() and baud.isdecimal() and int(baud) > 0):
        raise ValueError(f"{uri}: baud must be a whole number, not {baud!r}")
    if options:
        raise ValueError(f"{uri}: unknown option {', '.join(options)}")
    if not parts.netloc:
        if not parts.path:
            raise ValueError(f"{uri}: a serial link needs the path of its line")
        return AcousticAddress(parts.path, None, None, int(baud), us, peer)
    if not parts.hostname or not parts.port:
        raise ValueError(f"{uri}: a TCP link needs host and port")
    return AcousticAddress(None, parts.hostname, parts.port, int(baud), us, peer)


def own_end(uri: str) -> str | None:
    """Return what names the modem at the robot's end of a link, which is one robot's alone.

    ``None`` for a radio that any number of robots share, and for what is no link.
    """
    try:
        if is_satellite(uri):
            return f"The modem {satellite_address(uri)[1]}"
        if is_acoustic(uri):
            line, _, _ = uri.partition("?")
            return f"Acoustic address {acoustic_address(uri).peer} at {line}"
        if is_cameras(uri):
            return f"The set of tags {camera_tags(uri)}"
    except ValueError:
        return None
    _, is_addressed, radio = uri.partition("#")
    return f"The radio {radio}" if is_addressed else None


def check_link(uri: str) -> None:
    """Refuse a URI that names no link of any kind.

    Raises:
        ValueError: The message says what is wrong with it.
    """
    if is_satellite(uri):
        satellite_address(uri)
    elif is_acoustic(uri):
        acoustic_address(uri)
    elif is_cameras(uri):
        camera_tags(uri)
    else:
        open_transport(uri)


def _node(uri: str, options: dict[str, str], name: str) -> int:
    text = options.pop(name, "")
    if not (text.isascii() and text.isdecimal() and int(text) <= _NODE_MAX):
        raise ValueError(f"{uri}: {name} must be a modem address of 0 to {_NODE_MAX}")
    return int(text)
