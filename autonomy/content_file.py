"""Files that are named by the SHA-256 of their content: the same content is kept once."""

import hashlib
import json
import os
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy.typing as npt

_LENGTH = struct.Struct("<I")


def content_of(magic: bytes, head: Mapping[str, Any], arrays: Sequence[npt.NDArray[Any]]) -> bytes:
    """Return a magic word, a head as JSON, and the bytes of arrays behind each other."""
    words = json.dumps(head).encode()
    return b"".join([magic, _LENGTH.pack(len(words)), words, *(a.tobytes() for a in arrays)])


def head_of(magic: bytes, content: bytes) -> tuple[dict[str, Any], int]:
    """Return the head of a content, and where its arrays begin.

    Raises:
        ValueError: If it does not begin with the magic word and a head.
    """
    if not content.startswith(magic):
        raise ValueError("it begins otherwise")
    at = len(magic)
    try:
        (length,) = _LENGTH.unpack_from(content, at)
    except struct.error as error:
        raise ValueError("it is cut off") from error
    at += _LENGTH.size
    head: dict[str, Any] = json.loads(content[at : at + length])
    return head, at + length


def keep_content(folder: Path, content: bytes, suffix: str) -> str:
    """Write a content into a folder, whole or not at all, and return its SHA-256."""
    sha256 = hashlib.sha256(content).hexdigest()
    place = folder / f"{sha256}{suffix}"
    if not place.exists():
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        part = folder / f".{sha256}.{os.getpid()}.part"
        part.write_bytes(content)
        part.replace(place)
    return sha256


def find_content(folder: Path, sha256: str, suffix: str) -> bytes | None:
    """Return a content, None where the folder has it not, or not whole."""
    try:
        content = (folder / f"{sha256}{suffix}").read_bytes()
    except OSError:
        return None
    return content if hashlib.sha256(content).hexdigest() == sha256 else None
