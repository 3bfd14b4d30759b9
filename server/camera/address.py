"""What a camera's URI must be before its process is given it, in words that repeat no secret."""

import re
from typing import Final
from urllib.parse import urlsplit

from robot_link.camera.uri import camera_uri

_SHORTEST_SECRET: Final = 3


def checked_uri(uri: str) -> str:
    """Return the URI of a camera.

    Raises:
        ValueError: If it is none; what is said does not repeat it, for it may hold a password.
    """
    try:
        _ = urlsplit(uri).port
    except ValueError:
        raise ValueError("this is no address") from None
    try:
        camera_uri(uri)
    except ValueError as error:
        words = str(error)
        told = words.removeprefix(f"{uri}: ") if words.startswith(f"{uri}: ") else ""
        if not told or ("@" in uri and _repeats(told, uri)):
            told = "is no camera"
        raise ValueError(told) from None
    return uri


def _repeats(told: str, uri: str) -> bool:
    """Tell whether words repeat a part of a URI, which may be a password where it has an ``@``."""
    parts = re.split("[:/?#&=@]", uri.partition(":")[2])
    return any(len(part) >= _SHORTEST_SECRET and part in told for part in parts)


def source_of(uri: str) -> str:
    """Return a URI without its options: another one is another camera, with lens and place."""
    return urlsplit(uri)._replace(query="", fragment="").geturl()


def host_of(uri: str) -> tuple[str, str]:
    """Return scheme and host with port: an account is for these alone."""
    parts = urlsplit(uri)
    return parts.scheme, parts.netloc
