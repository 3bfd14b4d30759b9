"""What a verb says on standard error: how it fails on purpose, and what it logs meanwhile."""

import logging
import re
from typing import Final

_QUIET = ("alembic", "httpx")
"""They say much, and httpx every address that it asks: some hold a secret word."""


_SECRET: Final = re.compile(
    r"((?:token|ticket|password)=|/push/|[Bb]earer )[^\s&\"'<>,;)\]}]+|()grace_[\w-]{40,}"
)


class WithoutSecrets(logging.Formatter):
    """Leaves out what would let a reader of the log in, whoever has written it there.

    A server logs the addresses that it is asked for, and an exception may quote one.
    """

    def format(self, record: logging.LogRecord) -> str:
        """Return the line, and the exception with it, without secrets."""
        return _SECRET.sub(r"\1(secret)", super().format(record))


def log_to_console() -> None:
    """Say what happens from INFO on, each line with its time and who says it."""
    handler = logging.StreamHandler()
    handler.setFormatter(WithoutSecrets("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    logging.basicConfig(level=logging.INFO, handlers=[handler])
    for name in _QUIET:
        logging.getLogger(name).setLevel(logging.WARNING)


class CommandError(Exception):
    """The command cannot do what was asked; the sentence says why and what to do."""

    def __init__(self, sentence: str, status: int = 1) -> None:
        super().__init__(sentence)
        self.status = status
