"""What a robot knows of its own camera and of the tank's tags: two files in its memory.

``camera.json`` is lens, port and mount (``autonomy.vision.onboard.own_camera``). ``tank.json`` is
the layout of the tank's tags as the station has it, ``{"tags": [...]}``, with ``level_m`` and
``level_std_m`` of the water's surface where they are known.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from autonomy.vision.onboard.own_camera import OwnCamera, own_camera_of
from autonomy.vision.onboard.own_fix import TankWater
from autonomy.vision.tag import Layout, layout_of

CAMERA_FILE, TANK_FILE = "camera.json", "tank.json"
_BYTES_MAX = 1_000_000
_LEVEL_MAX_M, _LEVEL_STD_MAX_M = 100.0, 1.0


class OwnCameraFileError(ValueError):
    """A file is missing or wrong; the sentence names it, the field and the limit."""


@dataclass(frozen=True, slots=True, eq=False)
class OwnCameraSetup:
    """A robot's camera and the tank that it looks at."""

    camera: OwnCamera
    layout: Layout
    water: TankWater


def read_own_camera(folder: Path | None) -> OwnCameraSetup:
    """Read both files.

    Args:
        folder: The robot's memory; None where it has none.

    Raises:
        OwnCameraFileError: If one is missing or wrong, or the camera may not be used under water.
    """
    if folder is None:
        raise OwnCameraFileError(f"{CAMERA_FILE}: the robot has no memory to read it from")
    camera = _read(folder / CAMERA_FILE)
    tank = _read(folder / TANK_FILE)
    try:
        own = own_camera_of(camera)
    except ValueError as error:
        raise OwnCameraFileError(f"{CAMERA_FILE}: {error}") from None
    if own.refusal:
        raise OwnCameraFileError(f"{CAMERA_FILE}: {own.refusal}")
    try:
        layout, water = layout_of(tank), _water(tank)
    except ValueError as error:
        raise OwnCameraFileError(f"{TANK_FILE}: {error}") from None
    if not layout.tags:
        raise OwnCameraFileError(f"{TANK_FILE}: tags: there is none")
    return OwnCameraSetup(own, layout, water)


def _read(path: Path) -> dict[str, Any]:
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise OwnCameraFileError(f"{path.name}: there is no such file on the robot") from None
    except OSError as error:
        raise OwnCameraFileError(f"{path.name}: {error.strerror}") from None
    if len(data) > _BYTES_MAX:
        raise OwnCameraFileError(f"{path.name}: is longer than {_BYTES_MAX} bytes")
    try:
        document = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise OwnCameraFileError(f"{path.name}: is no JSON: {error}") from None
    if not isinstance(document, dict):
        raise OwnCameraFileError(f"{path.name}: is not a JSON object")
    return document


def _water(document: Mapping[str, Any]) -> TankWater:
    usual = TankWater()
    return TankWater(
        _number(document, "level_m", usual.level_m, -_LEVEL_MAX_M, _LEVEL_MAX_M),
        _number(document, "level_std_m", usual.level_std_m, 0.0, _LEVEL_STD_MAX_M),
    )


def _number(
    document: Mapping[str, Any], name: str, usual: float, least: float, most: float
) -> float:
    value = document.get(name, usual)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not least <= value <= most:
        raise ValueError(f"{name}: is not a number within {least:g} and {most:g}")
    return float(value)
