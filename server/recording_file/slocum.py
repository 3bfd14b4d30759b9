"""Reads Slocum gliders' binary files (dbd, ebd, sbd, tbd, mbd, nbd), by the format alone.

Compressed ones (dcd, ecd, ...) and their cache files (ccc) are unpacked first.

A file is a header of text lines; a list of sensors in text, or the check sum of one that lies in a
cache file; a known-bytes cycle, which tells the byte order; and cycles. A cycle is the letter
``d``, two bits for each sensor (0 not told, 1 as before, 2 new, the first sensor in the highest
bits), and the new values one after another; any other letter ends the data.

Source:
    WRC Doc "Dinkum Binary Data", masterdata of Teledyne Webb Research: header tags and the state
    bits; figures of the tests are those of public files.
"""

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from autonomy.arrays import FloatArray
from server.recording_file.lz4_block import PackedError, is_packed, unpacked
from server.recording_file.raw import ROWS_MAX, UnreadableError

LABEL: Final = b"dbd_label:"
CACHE_BEGINS: Final = (b"s: T", b"s: F")
_VERSION: Final = 5
_EXPANSION_MAX: Final = 50
"""Compressed files are not unpacked to more than so many times their size."""
_FREE_BYTES: Final = 1 << 20
"""So much may come of any compressed file."""
_TAGS_MAX: Final = 40
_SENSORS_MAX: Final = 20_000
_KNOWN: Final = 17
"""Octets of the known-bytes cycle: ``s``, ``a``, 0x1234, 123.456 and 123456789.12345."""
_NOT_TOLD, _SAME, _NEW = 0, 1, 2
_CODES: Final = {1: "b", 2: "h", 4: "f", 8: "d"}
_END: Final = ord("X")


@dataclass(frozen=True, slots=True)
class Sensor:
    """One sensor of a list."""

    name: str
    unit: str
    octets: int


@dataclass(frozen=True, slots=True)
class Cycles:
    """What one file tells of the sensors that were asked for."""

    header: Mapping[str, str]
    sensors: int
    """How many the list has."""
    units: Mapping[str, str]
    values: Mapping[str, FloatArray]
    """By sensor, shape ``(n,)`` for the ``n`` cycles; NaN where a cycle does not tell."""


def read_slocum(path: Path, name: str, caches: Mapping[str, Path], wanted: Sequence[str]) -> Cycles:
    """Read what a file tells of some sensors.

    A value that is told ``as before`` is the one before; the opening cycle, which repeats what the
    mission before left behind, is left out.

    Args:
        path: The file.
        name: As the operator knows it.
        caches: Cache files by their check sum, eight hexadecimal digits in lower case.
        wanted: Names of sensors.

    Raises:
        UnreadableError: If it is no such file, is written in another version, has no cycle, or its
            cache file is missing.
    """
    data = _octets(path, name)
    header, at = _header(data, name)
    sensors, at = _sensors(data, at, header, name, caches)
    order, at = _order(data, at, name)
    values = _cycles(data, at, name, order, sensors, set(wanted))
    units = {one.name: one.unit for one in sensors if one.name in values}
    return Cycles(header, int(header.get("total_num_sensors", len(sensors))), units, values)


def is_packed_slocum(head: bytes) -> bool:
    """Tell whether a file's first 16 octets are those of a compressed one."""
    return is_packed(head, LABEL)


def is_cache(head: bytes) -> bool:
    """Tell whether a file's first 16 octets are those of a cache file, compressed or not."""
    return any(head.startswith(one) or is_packed(head, one) for one in CACHE_BEGINS)


def _octets(path: Path, name: str) -> bytes:
    """Return a file's content, unpacked if it is compressed."""
    data = path.read_bytes()
    head = data[:16]
    if not is_packed_slocum(head) and not any(is_packed(head, one) for one in CACHE_BEGINS):
        return data
    try:
        return unpacked(data, max(_FREE_BYTES, _EXPANSION_MAX * len(data)))
    except PackedError as error:
        raise UnreadableError(f"{name} is compressed, and {error}.") from error


def _line(data: bytes, at: int, name: str) -> tuple[str, int]:
    end = data.find(b"\n", at)
    if end < 0:
        raise UnreadableError(f"{name} ends within its header.")
    return data[at:end].decode("ascii", "replace").strip(), end + 1


def _header(data: bytes, name: str) -> tuple[dict[str, str], int]:
    if not data.startswith(LABEL):
        what = "it is empty" if not data else "it does not begin with dbd_label:"
        raise UnreadableError(f"Invalid DBD file: {name}: {what}.")
    header: dict[str, str] = {}
    at, tags = 0, 3
    while len(header) < tags:
        line, at = _line(data, at, name)
        key, colon, value = line.partition(":")
        if not colon or key in header:
            raise UnreadableError(f"Invalid DBD file: {name}: the header line {line[:40]!r}.")
        header[key] = value.strip()
        if key == "num_ascii_tags":
            tags = min(_TAGS_MAX, _integer(header, key, name))
    if header.get("encoding_ver") != str(_VERSION):
        said = header.get("encoding_ver", "none")[:20]
        raise UnreadableError(
            f"Invalid encoding version: {name} says {said!r}, and {_VERSION} is read."
        )
    return header, at


def _integer(header: Mapping[str, str], key: str, name: str) -> int:
    try:
        return int(header[key])
    except (KeyError, ValueError):
        raise UnreadableError(f"Invalid DBD file: {name}: {key} is no number.") from None


def _sensors(
    data: bytes, at: int, header: Mapping[str, str], name: str, caches: Mapping[str, Path]
) -> tuple[list[Sensor], int]:
    """Return the sensors that cycles carry, in their order."""
    total = _integer(header, "total_num_sensors", name)
    if not 0 < total <= _SENSORS_MAX:
        raise UnreadableError(f"Invalid DBD file: {name}: it says {total} sensors.")
    if header.get("sensor_list_factored") != "1":
        lines: list[str] = []
        while len(lines) < total:
            line, at = _line(data, at, name)
            lines.append(line)
        return _listed(lines, header, name), at
    crc = header.get("sensor_list_crc", "").lower()
    cache = caches.get(crc)
    if cache is None:
        raise UnreadableError(f"{name}: cache file {crc}.cac is missing; add it to the upload.")
    text = _octets(cache, f"{crc}.ccc").decode("ascii", "replace")
    return _listed(text.splitlines(), header, f"{crc}.cac"), at


def _listed(lines: Sequence[str], header: Mapping[str, str], name: str) -> list[Sensor]:
    found: dict[int, Sensor] = {}
    for line in lines:
        parts = line.split()
        if len(parts) < 6 or parts[0] != "s:":
            raise UnreadableError(f"Invalid DBD file: {name}: the sensor line {line[:40]!r}.")
        if parts[1] == "T":
            found[int(parts[3])] = Sensor(
                parts[5], parts[6] if len(parts) > 6 else "", int(parts[4])
            )
    count = _integer(header, "sensors_per_cycle", name)
    if sorted(found) != list(range(count)) or any(s.octets not in _CODES for s in found.values()):
        raise UnreadableError(
            f"Invalid DBD file: {name} lists {len(found)} sensors, the header says {count}."
        )
    return [found[index] for index in range(count)]


def _order(data: bytes, at: int, name: str) -> tuple[str, int]:
    """Return the byte order, by the known-bytes cycle."""
    known = data[at : at + _KNOWN]
    for order in "<>":
        if len(known) == _KNOWN and known[:2] == b"sa":
            number, single, double = struct.unpack(f"{order}hfd", known[2:16])
            if (
                number == 0x1234
                and abs(single - 123.456) < 1e-3
                and abs(double - 123456789.12345) < 1e-4
            ):
                return order, at + 16
    raise UnreadableError(f"{name} is truncated: its known-bytes cycle is missing.")


def _cycles(
    data: bytes, at: int, name: str, order: str, sensors: Sequence[Sensor], wanted: set[str]
) -> dict[str, FloatArray]:
    state_octets = (len(sensors) + 3) // 4
    sizes = np.array([one.octets for one in sensors])
    readers = {
        place: (one.name, struct.Struct(f"{order}{_CODES[one.octets]}"))
        for place, one in enumerate(sensors)
        if one.name in wanted
    }
    last = dict.fromkeys((name for name, _ in readers.values()), math.nan)
    rows: dict[str, list[float]] = {key: [] for key in last}
    cycles = 0
    while at < len(data) and data[at] == ord("d"):
        begin = at + 1 + state_octets
        states = _states(data[at + 1 : begin], len(sensors))
        is_new = states == _NEW
        at = begin + int(sizes[is_new].sum())
        if at > len(data) or len(states) < len(sensors):
            break
        places = begin + np.cumsum(np.where(is_new, sizes, 0)) - np.where(is_new, sizes, 0)
        for place, (key, reader) in readers.items():
            if is_new[place]:
                last[key] = float(reader.unpack_from(data, int(places[place]))[0])
            rows[key].append(math.nan if states[place] == _NOT_TOLD else last[key])
        cycles += 1
        if cycles > ROWS_MAX:
            raise UnreadableError(f"{name} has more than {ROWS_MAX:,} cycles.")
    if cycles < 2:
        raise UnreadableError(f"{name} has no data: it ends after its first cycle.")
    return {key: np.array(column[1:], dtype=np.float64) for key, column in rows.items()}


def _states(octets: bytes, count: int) -> np.ndarray:
    """Return the two bits of each sensor, the first in the highest bits of the first octet."""
    packed = np.frombuffer(octets, dtype=np.uint8)
    pairs = np.stack([packed >> 6, packed >> 4 & 3, packed >> 2 & 3, packed & 3], axis=1)
    return pairs.reshape(-1)[:count]
