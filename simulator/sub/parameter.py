"""The parameters of the submarine, and the file by which it describes them to ground stations."""

import json
import lzma
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from robot_link.service.file_store import FileEntry
from robot_link.service.parameter_table import Parameter, ParameterType

GENERAL: Final = "general.json"
_DETAIL: Final = "parameter.json.xz"
_REAL, _BYTE, _WORD = ParameterType.REAL32, ParameterType.INT8, ParameterType.INT16


@dataclass(frozen=True, slots=True)
class Described:
    """A parameter with what its metadata say beside its limits."""

    parameter: Parameter
    unit: str
    title: str
    values: tuple[tuple[int, str], ...] = ()


def _row(
    name: str,
    kind: ParameterType,
    limits: tuple[float, float, float],
    unit: str,
    title: str,
    text: str,
    values: tuple[tuple[int, str], ...] = (),
) -> Described:
    low, default, high = limits
    return Described(Parameter(name, kind, default, low, high, text), unit, title, values)


PARAMETERS: Final[Sequence[Described]] = (
    _row("SYSID_THISMAV", _WORD, (1, 4, 255), "", "System id", "MAVLink system id."),
    _row(
        "PILOT_SPEED_UP",
        _REAL,
        (10, 50, 500),
        "cm/s",
        "Ascent speed",
        "Greatest speed upwards that the pilot may ask for.",
    ),
    _row(
        "PILOT_SPEED_DN",
        _REAL,
        (10, 50, 500),
        "cm/s",
        "Descent speed",
        "Greatest speed downwards that the pilot may ask for.",
    ),
    _row(
        "WPNAV_SPEED",
        _REAL,
        (10, 60, 90),
        "cm/s",
        "Waypoint speed",
        "Horizontal speed on the way to a waypoint.",
    ),
    _row(
        "WPNAV_RADIUS",
        _REAL,
        (50, 200, 1000),
        "cm",
        "Waypoint radius",
        "A waypoint counts as reached within this distance.",
    ),
    _row(
        "SURFACE_DEPTH",
        _REAL,
        (-100, -10, 0),
        "cm",
        "Surface depth",
        "Depth at which the vehicle counts as at the surface.",
    ),
    _row(
        "FS_LEAK_ENABLE",
        _BYTE,
        (0, 1, 2),
        "",
        "Leak failsafe",
        "What it does when there is water inside.",
        ((0, "Disabled"), (1, "Warn only"), (2, "Enter surface mode")),
    ),
    _row(
        "FS_GCS_ENABLE",
        _BYTE,
        (0, 0, 4),
        "",
        "Ground station failsafe",
        "What it does when no ground station is heard.",
        ((0, "Disabled"), (1, "Warn only"), (2, "Disarm"), (3, "Hold depth"), (4, "Surface")),
    ),
    _row(
        "SIM_LEAK",
        _BYTE,
        (0, 0, 1),
        "",
        "Simulated leak",
        "Puts water into the simulated hull.",
        ((0, "Dry"), (1, "Leaking")),
    ),
)


class MetadataFiles:
    """The files behind COMPONENT_METADATA, in memory; a ``FileStore``."""

    def __init__(self) -> None:
        detail = lzma.compress(json.dumps(_document()).encode(), format=lzma.FORMAT_XZ)
        general = {
            "version": 1,
            "metadataTypes": [
                {"type": 1, "uri": f"mftp:///{_DETAIL}", "fileCrc": zlib.crc32(detail)}
            ],
        }
        self._files = {GENERAL: json.dumps(general).encode(), _DETAIL: detail}
        self.crc = zlib.crc32(self._files[GENERAL])

    def list(self, path: str) -> Sequence[FileEntry]:
        """Return the entries of the one folder."""
        if path.strip("/"):
            raise FileNotFoundError(path)
        return [FileEntry(name, len(content)) for name, content in self._files.items()]

    def size(self, path: str) -> int:
        """Return the bytes of a file."""
        return len(self._content(path))

    def read(self, path: str, offset: int, count: int) -> bytes:
        """Return bytes of a file from an offset on."""
        return self._content(path)[offset : offset + count]

    def _content(self, path: str) -> bytes:
        try:
            return self._files[path.strip("/")]
        except KeyError:
            raise FileNotFoundError(path) from None


def _document() -> dict[str, Any]:
    return {
        "version": 1,
        "parameters": [
            {
                "name": row.parameter.name,
                "type": "Float" if row.parameter.type is _REAL else "Int16",
                "shortDesc": row.title,
                "longDesc": row.parameter.text,
                "units": row.unit,
                "default": row.parameter.default,
                "min": row.parameter.minimum,
                "max": row.parameter.maximum,
                "values": [{"value": value, "description": text} for value, text in row.values],
            }
            for row in PARAMETERS
        ],
    }
