"""MAVLink 2 signatures: a secret per robot, stamps that never go back, and no frame twice.

Both ends of a link that is signed hold the same 32 bytes. Each frame ends with the link's number, a
stamp (10 us since 2015-01-01) and the first 6 bytes of SHA-256 over secret, frame, link and stamp.

pymavlink's own check is not used: it notes the stamp of a frame before it looks at the signature,
so that one forged stamp of the far future would silence a robot. Unlike the standard's rule, a
frame that was overtaken by a few others is taken; one that was taken already never is.
"""

import hashlib
import hmac
import json
import logging
from bisect import insort
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from pathlib import Path
from typing import Protocol

from robot_link.clock import Clock
from robot_link.mavlink.frame import INCOMPATIBLE, SIGNATURE_BYTES, SIGNED
from robot_link.whole_file import replace_file

SECRET_BYTES = 32

_EPOCH = datetime(2015, 1, 1, tzinfo=UTC)
_TICK = timedelta(microseconds=10)
_SECOND = 100_000
_AHEAD_S = 60
"""Wall seconds beyond what is kept that a sender may stamp before it keeps a new mark."""
_NEW_STREAM_LAG_S = 60
"""Wall seconds that the first frame of a stream may be behind our own stamp, as the standard
says."""
_MARK_STEP_S = 1
"""Wall seconds that a stream's stamps may move on before its mark is kept again."""
_OVERTAKEN = 64
"""Newest stamps of a stream that are remembered one by one."""
_SYSTEM, _COMPONENT = 5, 6

_log = logging.getLogger(__name__)

Stream = tuple[int, int, int]
"""Link number, system and component of a sender."""


class Verdict(StrEnum):
    """What a signature says of a frame."""

    GOOD = "good"
    UNSIGNED = "unsigned"
    FORGED = "forged"
    """The signature is not of our secret, or the frame was changed."""
    REPLAYED = "replayed"
    """The stamp is one that was taken already, or too old."""


@dataclass(frozen=True, slots=True)
class SigningMarks:
    """What must outlive a restart, so that nothing is stamped or taken twice."""

    stamp: int = 0
    """No frame was ever sent with a stamp beyond this one."""
    streams: Mapping[Stream, int] = field(default_factory=dict)
    """Stamps up to which nothing of a stream is taken after a restart; a little beyond the newest
    one that was, so that not every frame has to be marked. An end in order leaves the newest."""


class SigningMemory(Protocol):
    """Keeps the marks; saving happens about once a second while frames are exchanged."""

    def load(self) -> SigningMarks:
        """Return what was saved last; empty marks before."""
        ...

    def save(self, marks: SigningMarks) -> None:
        """Replace what is kept, whole or not at all."""
        ...


class MemorySigningMemory:
    """Marks that live as long as their process."""

    def __init__(self) -> None:
        self._marks = SigningMarks()

    def load(self) -> SigningMarks:
        """Return what was saved last."""
        return self._marks

    def save(self, marks: SigningMarks) -> None:
        """Replace what is kept."""
        self._marks = marks


class FileSigningMemory:
    """Marks in a small file that only its owner may read."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def load(self) -> SigningMarks:
        """Return what was saved last; empty marks where there is no file.

        A damaged file is set aside under another name and told in the log. A robot must be told to
        surface all the same: its streams begin anew, which lets in what was recorded in the last
        minute, and nothing older.

        Raises:
            OSError: If the file cannot be read.
        """
        try:
            text = self._path.read_bytes()
        except FileNotFoundError:
            return SigningMarks()
        try:
            kept = json.loads(text)
            streams = {
                (int(link), int(system), int(component)): int(stamp)
                for link, system, component, stamp in kept["streams"]
            }
            return SigningMarks(int(kept["stamp"]), streams)
        except (KeyError, TypeError, ValueError):
            aside = self._path.with_name(f"{self._path.name}.damaged")
            self._path.replace(aside)
            _log.error("%s held no marks of signed links; it is %s now", self._path, aside.name)
            return SigningMarks()

    def save(self, marks: SigningMarks) -> None:
        """Replace the file, whole or not at all."""
        kept = {
            "stamp": marks.stamp,
            "streams": [[*stream, stamp] for stream, stamp in sorted(marks.streams.items())],
        }
        replace_file(self._path, json.dumps(kept).encode(), mode=0o600)


class _Window:
    """Which stamps of one stream were taken."""

    def __init__(self, floor: int) -> None:
        self.floor = floor
        self._taken: list[int] = []

    @property
    def newest(self) -> int:
        return self._taken[-1] if self._taken else self.floor

    def is_fresh(self, stamp: int) -> bool:
        return stamp > self.floor and stamp not in self._taken

    def take(self, stamp: int) -> None:
        insort(self._taken, stamp)
        if len(self._taken) > _OVERTAKEN:
            self.floor = self._taken.pop(0)


class Signing:
    """Stamps what goes to one robot and checks what comes from it; at both ends alike.

    A robot whose clock is behind is heard as soon as it has heard the station: it goes on stamping
    from the newest stamp that it took. Marks that cannot be saved (a full disk) are told in the log
    and tried again a second later: no link falls silent for them.

    Args:
        secret: 32 bytes that both ends hold.
        memory: What outlives a restart.
        clock: Where stamps begin; they go on counting where it goes back.
        link: Number of this end's link, for peers that use several.

    Raises:
        ValueError: If the secret has another length.
    """

    def __init__(
        self, secret: bytes, memory: SigningMemory, clock: Clock, *, link: int = 0
    ) -> None:
        if len(secret) != SECRET_BYTES:
            raise ValueError(f"a signing secret has {SECRET_BYTES} bytes, not {len(secret)}")
        self.secret = secret
        self._memory = memory
        self._clock = clock
        self.link = link
        self.fault = ""
        """Why nobody can hold this secret, for a person; empty where somebody does."""
        marks = memory.load()
        self._stamp = marks.stamp
        self._reserved = marks.stamp
        self._windows = {stream: _Window(stamp) for stream, stamp in marks.streams.items()}
        self._marked = dict(marks.streams)
        self.counts: dict[Verdict, int] = dict.fromkeys(Verdict, 0)
        """Frames by verdict since the start."""

    def next_stamp(self) -> int:
        """Return the stamp of the next frame to send; none is ever given twice."""
        self._stamp = max(self._stamp + 1, _stamp_of(self._clock.now()))
        if self._stamp > self._reserved:
            self._reserved = self._stamp + self._ticks(_AHEAD_S)
            self._save()
        return self._stamp

    def check(self, frame: bytes) -> Verdict:
        """Judge a whole frame whose checksum is right; a good one is taken once."""
        verdict = self._judge(frame)
        self.counts[verdict] += 1
        return verdict

    def settle(self) -> None:
        """Mark exactly what was taken, once no more is heard: who goes on takes the next one."""
        self._marked = {stream: window.newest for stream, window in self._windows.items()}
        self._save()

    def _judge(self, frame: bytes) -> Verdict:
        if not frame[INCOMPATIBLE] & SIGNED or len(frame) < SIGNATURE_BYTES:
            return Verdict.UNSIGNED
        if not hmac.compare_digest(self._signature(frame[:-6]), bytes(frame[-6:])):
            return Verdict.FORGED
        stream: Stream = (frame[-13], frame[_SYSTEM], frame[_COMPONENT])
        stamp = int.from_bytes(frame[-12:-6], "little")
        window = self._windows.get(stream)
        if window is None:
            ours = max(self._stamp, _stamp_of(self._clock.now()))
            window = _Window(max(0, ours - self._ticks(_NEW_STREAM_LAG_S)))
        if not window.is_fresh(stamp):
            return Verdict.REPLAYED
        self._windows[stream] = window
        window.take(stamp)
        self._stamp = max(self._stamp, stamp)
        if window.newest >= self._marked.get(stream, 0):
            self._marked[stream] = window.newest + self._ticks(_MARK_STEP_S)
            self._save()
        return Verdict.GOOD

    def _signature(self, signed: bytes) -> bytes:
        return hashlib.sha256(self.secret + signed).digest()[:6]

    def _ticks(self, wall_s: float) -> int:
        """Return what stamps move on by within so many seconds of the wall."""
        return round(wall_s * _SECOND * max(1.0, self._clock.speed))

    def _save(self) -> None:
        try:
            self._memory.save(SigningMarks(self._reserved, dict(self._marked)))
        except OSError as error:
            self._reserved = self._stamp + _SECOND
            _log.error("marks of a signed link were not saved: %s", error)


def _stamp_of(moment: datetime) -> int:
    return max(0, (moment - _EPOCH) // _TICK)
