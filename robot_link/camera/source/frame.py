"""One picture as its source gives it, and why a source gives none."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Final, TypeAlias

from robot_link.camera.picture import Content

TIMEOUT_S: Final = 5.0
"""After so long an opening, or a wait for the next bytes, is given up."""


class SourceError(Exception):
    """A source cannot be opened, or ended; the sentence says why. It may be opened again."""


class SourceEndedError(SourceError):
    """A source has shown all that it has; there is no use in opening it again."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One picture."""

    content: Content
    taken_at: datetime
    """By the wall's clock."""
    arrived_at: datetime


Frames: TypeAlias = Iterator[Frame]
"""Blocks until the next picture is there; raises ``SourceError``."""


def arrived(content: Content, latency_s: float) -> Frame:
    """Return a picture that came now and was taken so much earlier."""
    now = datetime.now(UTC)
    return Frame(content, now - timedelta(seconds=latency_s), now)
