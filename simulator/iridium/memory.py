"""What a network must not forget when its process ends: a real one never restarts."""

import logging
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from simulator.iridium.message_queue import QueuedMessage
from simulator.iridium.session import MobileOriginatedMessage

_log = logging.getLogger(__name__)


@dataclass(slots=True)
class LineMemory:
    """What is remembered of one modem."""

    momsn: int = 0
    mtmsn: int = 0
    credits_charged: int = 0
    mobile_originated_credits: int = 0
    queue: list[QueuedMessage] = field(default_factory=list[QueuedMessage])
    outgoing: list[MobileOriginatedMessage] = field(default_factory=list[MobileOriginatedMessage])
    """Messages of the modem that the customer has not taken yet."""


@dataclass(slots=True)
class NetworkMemory:
    """What is remembered of a network."""

    next_id: int = 1
    lines: dict[str, LineMemory] = field(default_factory=dict[str, LineMemory])


class MemoryFile:
    """Keeps the memory in a file, which is replaced at once whenever something has changed."""

    def __init__(self, file: Path) -> None:
        self._file = file

    def load(self) -> NetworkMemory:
        """Return what was kept; of a file that cannot be read nothing is remembered."""
        try:
            return msgspec.json.decode(self._file.read_bytes(), type=NetworkMemory)
        except FileNotFoundError:
            return NetworkMemory()
        except msgspec.MsgspecError as error:
            _log.warning("%s holds no memory of a satellite network: %s", self._file, error)
            return NetworkMemory()

    def save(self, memory: NetworkMemory) -> None:
        """Keep it."""
        self._file.parent.mkdir(parents=True, exist_ok=True)
        fresh = self._file.with_name(f".{self._file.name}.new")
        fresh.write_bytes(msgspec.json.encode(memory))
        fresh.replace(self._file)
