"""Sentences that a vehicle says in pieces of fifty characters."""

from dataclasses import dataclass, field
from datetime import datetime, timedelta

from robot_link.mavlink.wire import grace

_PIECE = 50
_GAP = "[...]"
_PATIENCE = timedelta(seconds=3)
_OPEN_MAX = 8


@dataclass(slots=True)
class _Sentence:
    """What came of one sentence so far."""

    severity: int
    at: datetime
    pieces: dict[int, str] = field(default_factory=dict)
    last: int | None = None
    """Number of the piece that ends it; None until that came."""

    @property
    def is_whole(self) -> bool:
        return self.last is not None and len(self.pieces) == self.last + 1

    @property
    def text(self) -> str:
        end = max(self.pieces) if self.last is None else self.last
        words = (self.pieces.get(number, _GAP) for number in range(end + 1))
        return "".join(words) + ("" if self.last is not None else _GAP)


class StatusTexts:
    """Puts STATUSTEXT together; what stays incomplete is told with its gaps."""

    def __init__(self) -> None:
        self._open: dict[tuple[int, int], _Sentence] = {}

    def hear(
        self, message: grace.MAVLink_statustext_message, at: datetime
    ) -> list[tuple[int, str, datetime]]:
        """Return severity, text and time of what is whole now, or will never be."""
        if not message.id:
            return [*self.overdue(at), (message.severity, message.text.strip(), at)]
        key = (message.get_srcComponent(), message.id)
        sentence = self._open.setdefault(key, _Sentence(message.severity, at))
        sentence.pieces[message.chunk_seq] = message.text
        if len(message.text) < _PIECE:
            sentence.last = message.chunk_seq
        told = self.overdue(at)
        if sentence.is_whole and key in self._open:
            del self._open[key]
            told.append((sentence.severity, sentence.text.strip(), at))
        return told

    def overdue(self, at: datetime) -> list[tuple[int, str, datetime]]:
        """Return what has waited for its other pieces for too long."""
        late = [key for key, one in self._open.items() if at - one.at > _PATIENCE]
        late += list(self._open)[: max(0, len(self._open) - _OPEN_MAX)]
        told = [self._open.pop(key) for key in dict.fromkeys(late)]
        return [(one.severity, one.text.strip(), one.at) for one in told]
