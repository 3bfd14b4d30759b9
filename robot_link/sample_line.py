"""Lines of a robot's memory of samples and heard tags: written on board, read of a recovered card.

Each begins with its own checksum, and says an entry or which entries are known to be ashore::

    1f0a3b52 {"log": 1, "sequence": 0, "variable": "chlorophyll", "value": 2.5, ...}
    9b20cc41 {"log": 1, "sequence": 1, "receiver": 450052, "tag": "A69-1601-179", ...}
    77a1c09e {"log": 1, "stored": [0]}
"""

import json
import re
import zlib
from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import Any, Final

from robot_link.mavlink.detection import entry_message
from robot_link.messages import LogId
from robot_link.sample_log import HeardTag, LogEntry, Measurement, SampleKey

LINE_BEGIN: Final = re.compile(rb'^[0-9a-f]{8} \{"log": ', re.MULTILINE)
"""How every line begins: a file that has one of these is such a memory."""
_CHECKSUM_DIGITS: Final = 8


def entry_line(key: SampleKey, entry: LogEntry) -> bytes:
    """Return the line of an entry."""
    what = (
        {"receiver": entry.receiver, "tag": entry.tag, "sensor": entry.sensor}
        if isinstance(entry, HeardTag)
        else {"variable": entry.variable, "value": float(entry.value)}
    )
    return _line(
        {
            "log": key.log,
            "sequence": key.sequence,
            **what,
            "position_ned": [float(one) for one in entry.position_ned],
            "position_std_m": float(entry.position_std_m),
            "measured_at": entry.measured_at.isoformat(),
        }
    )


def stored_line(log: LogId, sequences: Iterable[int]) -> bytes:
    """Return the line that says of entries of one log that they are ashore."""
    return _line({"log": log, "stored": list(sequences)})


def read_line(line: bytes) -> tuple[SampleKey, LogEntry] | list[SampleKey]:
    """Return an entry with its name, or the names of those that are known to be ashore.

    Raises:
        ValueError: If the line is not whole, lacks something, or says what cannot be.
    """
    try:
        content = _content(line)
        log = LogId(int(content["log"]))
        if "stored" in content:
            return [SampleKey(log, int(sequence)) for sequence in content["stored"]]
        key = SampleKey(log, int(content["sequence"]))
        entry = _entry(content)
        entry_message(key.log, key.sequence, entry)
    except KeyError as error:
        raise ValueError(f"{error} is missing or not known") from error
    except TypeError as error:
        raise ValueError("a value is of another type") from error
    return key, entry


def _entry(content: Mapping[str, Any]) -> LogEntry:
    north_m, east_m, depth_m = content["position_ned"]
    position_ned = float(north_m), float(east_m), float(depth_m)
    position_std_m = float(content["position_std_m"])
    measured_at = datetime.fromisoformat(content["measured_at"])
    if "tag" in content:
        sensor = content["sensor"]
        return HeardTag(
            receiver=int(content["receiver"]),
            tag=str(content["tag"]),
            sensor=None if sensor is None else int(sensor),
            position_ned=position_ned,
            position_std_m=position_std_m,
            measured_at=measured_at,
        )
    return Measurement(
        variable=str(content["variable"]),
        value=float(content["value"]),
        position_ned=position_ned,
        position_std_m=position_std_m,
        measured_at=measured_at,
    )


def _line(content: Mapping[str, Any]) -> bytes:
    text = json.dumps(content).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def _content(line: bytes) -> Mapping[str, Any]:
    checksum, text = line[:_CHECKSUM_DIGITS], line[_CHECKSUM_DIGITS + 1 :]
    try:
        is_whole = int(checksum, 16) == zlib.crc32(text)
    except ValueError:
        is_whole = False
    if not is_whole:
        raise ValueError("the line is not whole")
    content = json.loads(text)
    if not isinstance(content, dict):
        raise TypeError("a line holds no values")
    return content
