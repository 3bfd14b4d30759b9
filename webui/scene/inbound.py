"""What a browser may say to a scene: where its camera is, and what it chose in the panel.

viser acts on whatever reaches it, a request for a public tunnel included; so a frame is read here,
held against the controls that there are, and written anew.
"""

import math
from collections.abc import Callable
from typing import Any, TypeAlias

import msgspec

FRAME_BYTES_MAX = 4096
"""A camera takes 300 bytes."""
Accepts: TypeAlias = Callable[[str, object], bool]
"""Tells whether a control of this id may take this value."""
_Three: TypeAlias = tuple[float, float, float]


class _Camera(
    msgspec.Struct, frozen=True, tag_field="type", tag="ViewerCameraMessage",
    forbid_unknown_fields=True,
):  # fmt: skip
    wxyz: tuple[float, float, float, float]
    position: _Three
    fov: float
    near: float
    far: float
    image_height: int
    image_width: int
    look_at: _Three
    up_direction: _Three

    def is_finite(self) -> bool:
        numbers = (*self.wxyz, *self.position, *self.look_at, *self.up_direction)
        return all(map(math.isfinite, (*numbers, self.fov, self.near, self.far)))


class _Update(
    msgspec.Struct, frozen=True, tag_field="type", tag="GuiUpdateMessage",
    forbid_unknown_fields=True,
):  # fmt: skip
    uuid: str
    updates: dict[str, Any]


_decoder = msgspec.msgpack.Decoder(_Camera | _Update)
_encoder = msgspec.msgpack.Encoder()


def admitted(frame: bytes, accepts: Accepts, *, may_change: bool) -> bytes | None:
    """Return what of a browser's frame goes to the scene, ``None`` where nothing does.

    Args:
        frame: One message of viser's page.
        accepts: What the controls of the scene's panel take.
        may_change: Whether the browser's person may change what everybody sees.
    """
    if len(frame) > FRAME_BYTES_MAX:
        return None
    try:
        message = _decoder.decode(frame)
    except (msgspec.DecodeError, RecursionError):
        return None
    match message:
        case _Camera() if message.is_finite():
            return _encoder.encode(message)
        case _Update(uuid, {"value": value, **more}) if may_change and not more:
            return _encoder.encode(message) if accepts(uuid, value) else None
        case _:
            return None
