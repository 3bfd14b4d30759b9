"""Files about parameters: what a maker says of them, and the values that somebody saved.

Metadata are JSON of MAVLink's component metadata (type 1), plain or compressed (``.xz``,
``.lzma``); values are those of QGroundControl (``.params``) and of ArduPilot (``.param``,
``.parm``). What is too large when unpacked is refused before it is unpacked whole.
"""

import json
import lzma
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, cast

LARGEST_BYTES: Final = 8 * 2**20
"""Of a file, also when unpacked; that of PX4 has some 2 MB."""
_XZ, _LZMA = b"\xfd7zXZ\x00", b"\x5d\x00\x00"
_QGC_COLUMNS: Final = 5
_LINES_MAX: Final = 20_000
_TEXT_MAX: Final = 600
_VALUES_MAX: Final = 64
PARAMETER_METADATA: Final = 1
"""Type of the metadata that describe parameters (COMP_METADATA_TYPE)."""


class ParameterFileError(ValueError):
    """A file cannot be read; the sentence names the line or the field."""


@dataclass(frozen=True, slots=True)
class ParameterDescription:
    """What the maker of a vehicle says of a parameter; what is not told is None or empty."""

    name: str
    title: str = ""
    help: str = ""
    unit: str = ""
    default: float | None = None
    minimum: float | None = None
    maximum: float | None = None
    values: tuple[tuple[float, str], ...] = ()
    """Values that have names."""
    needs_reboot: bool = False


def unpacked(content: bytes) -> bytes:
    """Return a file's content, unpacked where it is compressed.

    Raises:
        ParameterFileError: If it is damaged, or too large.
    """
    if len(content) > LARGEST_BYTES:
        raise ParameterFileError(f"the file is larger than {LARGEST_BYTES // 2**20} MB")
    if not content.startswith((_XZ, _LZMA)):
        return content
    opener = lzma.LZMADecompressor(memlimit=64 * 2**20)
    try:
        plain = opener.decompress(content, max_length=LARGEST_BYTES + 1)
    except lzma.LZMAError as error:
        raise ParameterFileError(f"the file cannot be unpacked: {error}") from error
    if len(plain) > LARGEST_BYTES:
        raise ParameterFileError(f"unpacked it is larger than {LARGEST_BYTES // 2**20} MB")
    if not opener.eof:
        raise ParameterFileError("the compressed file ends too early")
    return plain


def parameter_uri(general: bytes) -> tuple[str, int | None]:
    """Return where ``general.json`` says that parameters are described, and the file's CRC32.

    Raises:
        ParameterFileError: If it says nothing of them, or is no such file.
    """
    document = _document(general)
    for one in _list(document, "metadataTypes"):
        if one.get("type") == PARAMETER_METADATA and isinstance(one.get("uri"), str):
            crc = one.get("fileCrc")
            return one["uri"], crc if isinstance(crc, int) else None
    raise ParameterFileError("general.json names no file that describes parameters")


def descriptions(content: bytes) -> dict[str, ParameterDescription]:
    """Read a file of metadata, plain or compressed.

    Raises:
        ParameterFileError: If it is none; the sentence names the parameter that is wrong.
    """
    document = _document(unpacked(content))
    found: dict[str, ParameterDescription] = {}
    for number, one in enumerate(_list(document, "parameters"), start=1):
        name = one.get("name")
        if not isinstance(name, str) or not 1 <= len(name) <= 16:
            raise ParameterFileError(f"parameter {number} of the file has no name")
        found[name] = ParameterDescription(
            name=name,
            title=_text(one, "shortDesc"),
            help=_text(one, "longDesc"),
            unit=_text(one, "units"),
            default=_number(one, "default"),
            minimum=_number(one, "min"),
            maximum=_number(one, "max"),
            values=_values(one.get("values")),
            needs_reboot=one.get("rebootRequired") is True,
        )
    return found


def saved_values(text: str) -> dict[str, float]:
    """Read values that a ground station saved.

    Raises:
        ParameterFileError: If a line is none; the sentence has its number.
    """
    found: dict[str, float] = {}
    lines = text.splitlines()
    if len(text) > LARGEST_BYTES or len(lines) > _LINES_MAX:
        raise ParameterFileError(f"the file has more than {_LINES_MAX} lines")
    for number, line in enumerate(lines, start=1):
        stripped = line.split("#", 1)[0].strip()
        if not stripped:
            continue
        words = stripped.replace(",", " ").split()
        if len(words) == _QGC_COLUMNS:
            words = words[2:4]
        if len(words) != 2:
            raise ParameterFileError(f"line {number} holds no name and value: {stripped[:40]!r}")
        name, value = words[0], _float(words[1])
        if value is None or len(name) > 16:
            told = f"{words[1][:20]!r} of {name[:20]}"
            raise ParameterFileError(f"line {number}: {told} is no number")
        if name in found:
            raise ParameterFileError(f"line {number} names {name} a second time")
        found[name] = value
    if not found:
        raise ParameterFileError("the file holds no parameter")
    return found


def _document(content: bytes) -> Mapping[str, Any]:
    if len(content) > LARGEST_BYTES:
        raise ParameterFileError(f"the file is larger than {LARGEST_BYTES // 2**20} MB")
    try:
        document = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise ParameterFileError(f"the file is no JSON: {error}") from error
    if not isinstance(document, dict):
        raise ParameterFileError("the file holds no JSON object")
    return cast("Mapping[str, Any]", document)


def _list(document: Mapping[str, Any], name: str) -> Iterator[Mapping[str, Any]]:
    rows = document.get(name)
    if not isinstance(rows, list):
        raise ParameterFileError(f"the file has no list {name!r}")
    for number, one in enumerate(cast("Sequence[Any]", rows), start=1):
        if not isinstance(one, dict):
            raise ParameterFileError(f"entry {number} of {name!r} is no object")
        yield cast("Mapping[str, Any]", one)


def _text(row: Mapping[str, Any], name: str) -> str:
    value = row.get(name)
    return value.strip()[:_TEXT_MAX] if isinstance(value, str) else ""


def _number(row: Mapping[str, Any], name: str) -> float | None:
    value = row.get(name)
    if not isinstance(value, int | float) or isinstance(value, bool):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _values(rows: object) -> tuple[tuple[float, str], ...]:
    if not isinstance(rows, list):
        return ()
    found: list[tuple[float, str]] = []
    for one in cast("Sequence[Any]", rows)[:_VALUES_MAX]:
        if isinstance(one, dict):
            row = cast("Mapping[str, Any]", one)
            value = _number(row, "value")
            if value is not None:
                found.append((value, _text(row, "description")))
    return tuple(found)


def _float(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
