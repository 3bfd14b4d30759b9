"""What the station says of its work: plain lines on the terminal, JSON lines in files."""

import json
import logging
import logging.handlers
import os
import queue
from collections.abc import Generator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

from db.actor import acting
from server.watch.console import LogLevel, log_to_console, without_secrets
from server.watch.request import REQUEST_LOGGER, asked

LogFormat: TypeAlias = Literal["text", "json"]
FILE: Final = "station.jsonl"
FILES: Final = 10
"""The newest and those before it; each holds an equal part of what all may."""
WAITING_MAX: Final = 10_000
"""Lines that wait for a slow disk; more are dropped, and ``/metrics`` tells how many."""
_OWN: Final = frozenset(logging.makeLogRecord({}).__dict__) | {"message", "asctime", "taskName"}
_CONTEXT: Final = ("request_id", "person", "robot")


class JsonLines(logging.Formatter):
    """One JSON object a line: ``time`` (UTC), ``level``, ``logger``, ``message`` and what is known.

    That is ``request_id``, ``person`` and ``robot`` where the line belongs to one, ``exception``
    where one is told, and whatever the caller gave as ``extra``: numbers, and all else as text.
    """

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        line: dict[str, Any] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        more = {name: value for name, value in record.__dict__.items() if name not in _OWN}
        line |= {name: value for name, value in more.items() if value is not None}
        if record.exc_info and record.exc_info[0] is not None:
            line["exception"] = self.formatException(record.exc_info)
        told = {name: _told(value) for name, value in line.items()}
        return json.dumps(told, ensure_ascii=False)


def _told(value: object) -> object:
    return value if isinstance(value, bool | int | float) else without_secrets(str(value))


class _Context(logging.Filter):
    """Notes for whom a line is said, while that is known: a handler may write it elsewhere."""

    def filter(self, record: logging.LogRecord) -> bool:
        request, actor = asked.get(), acting.get()
        person = None if actor is None else actor.name
        known = (
            None if request is None else request.id,
            person or (None if request is None else request.person),
            None if request is None else request.robot,
        )
        for name, value in zip(_CONTEXT, known, strict=True):
            if getattr(record, name, None) is None:
                setattr(record, name, value)
        return True


class _Waiting(logging.handlers.QueueHandler):
    """Hands lines to the thread that writes them: nobody waits for a disk."""

    dropped = 0

    def prepare(self, record: logging.LogRecord) -> logging.LogRecord:
        return record

    def enqueue(self, record: logging.LogRecord) -> None:
        try:
            self.queue.put_nowait(record)
        except queue.Full:
            self.dropped += 1


class _Writing(logging.handlers.QueueListener):
    """Writes what waits, and at its end the last of it too, however many lines there are."""

    def __init__(self, lines: "queue.Queue[Any]", files: logging.Handler) -> None:
        super().__init__(lines, files)
        self._lines = lines

    def enqueue_sentinel(self) -> None:
        self._lines.put(None)  # by which the base class ends; its own does not wait for room


class _Files(logging.handlers.RotatingFileHandler):
    """Files for this user alone; where they cannot be written, the terminal is told once."""

    is_failing = False
    _newest: tuple[logging.LogRecord, str] | None = None

    def _open(self) -> Any:  # noqa: ANN401 - the base class's own stream
        stream = super()._open()
        os.chmod(self.baseFilename, 0o600)
        self.is_failing = False
        return stream

    def format(self, record: logging.LogRecord) -> str:
        """Return the line of a record, made once: the base class asks twice, also for its size."""
        if self._newest is None or self._newest[0] is not record:
            self._newest = record, super().format(record)
        return self._newest[1]

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - the base class's name
        if not self.is_failing and record.name != __name__:
            self.is_failing = True
            logging.getLogger(__name__).error("the log cannot be written to %s", self.baseFilename)


def log_station(log_format: LogFormat, level: LogLevel) -> None:
    """Say what happens at a station from a level on, on standard error.

    Plain lines leave out those of requests unless they failed: they are for a person.
    """
    if log_format == "json":
        log_to_console(level, _Context(), formatter=JsonLines())
    else:
        log_to_console(level, _Context(), _is_for_a_person)


@contextmanager
def logged_to_files(folder: Path, limit_bytes: int) -> Generator[None]:
    """Write every line into files of a folder too, which together hold at most so many bytes."""
    folder.mkdir(exist_ok=True, mode=0o700)
    files = _Files(
        folder / FILE, maxBytes=limit_bytes // FILES, backupCount=FILES - 1, encoding="utf-8"
    )
    files.setFormatter(JsonLines())
    lines: queue.Queue[Any] = queue.Queue(WAITING_MAX)
    waiting, listener = _Waiting(lines), _Writing(lines, files)
    waiting.addFilter(_Context())
    listener.start()
    logging.getLogger().addHandler(waiting)
    try:
        yield
    finally:
        logging.getLogger().removeHandler(waiting)
        listener.stop()
        files.close()


def dropped_lines() -> int:
    """Return how many lines the files of this process's log have missed for want of room."""
    handlers = logging.getLogger().handlers
    return sum(each.dropped for each in handlers if isinstance(each, _Waiting))


def _is_for_a_person(record: logging.LogRecord) -> bool:
    return record.name != REQUEST_LOGGER or record.levelno > logging.INFO
