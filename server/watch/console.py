"""Lines on the terminal; light to import, for the program that runs on board.

They leave out what would let a reader of the log in, whoever has written it there: a server logs
what it is asked for, and an exception may quote an address.
"""

import logging
import re
from collections.abc import Callable
from typing import Final, Literal, TypeAlias

LogLevel: TypeAlias = Literal["debug", "info", "warning", "error"]
_QUIET: Final = ("alembic", "httpx", "uvicorn.access")
"""They say much, and httpx every address that it asks: some hold a secret word."""
_SECRET: Final = re.compile(
    r"""
    ( (?:token|ticket|password|secret|key|code) (?: = | \\*["']\s*:\s* ) )
    (?: b?"(?:[^"\\]|\\.)*"? | b?'(?:[^'\\]|\\.)*'?  # quoted
      | \\+"[^"]*"? | \\+'[^']*'?                    # quoted within what is quoted
      | [^\s&"'<>,;)\]}]+ )
    | ( /push/ | /ack/ | [Bb]earer[ ] ) [^\s&"'<>,;)\]}]+
    | ( ://[^\s/:@]*: ) [^\s"'<>]*(?=@)              # of an address with a name and a password
    | () grace_[\w-]{40,}
    """,
    re.VERBOSE,
)
"""What stands before a secret, as the one group that takes part, and the secret."""
_TEXT: Final = "%(asctime)s %(levelname)s %(name)s: %(message)s"


def without_secrets(text: str) -> str:
    """Return a text without what would let its reader in."""
    return _SECRET.sub(lambda found: f"{found[found.lastindex or 0]}(secret)", text)


class WithoutSecrets(logging.Formatter):
    """Plain lines, with the exception of each, without secrets."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        return without_secrets(super().format(record))


def log_to_console(
    level: LogLevel = "info",
    *filters: logging.Filter | Callable[[logging.LogRecord], bool],
    formatter: logging.Formatter | None = None,
) -> None:
    """Say what happens from a level on, on standard error.

    Args:
        level: The least that is said.
        filters: What each line must pass, in their order.
        formatter: How lines look; plain ones by default.
    """
    handler = logging.StreamHandler()
    for each in filters:
        handler.addFilter(each)
    handler.setFormatter(formatter or WithoutSecrets(_TEXT))
    logging.basicConfig(level=level.upper(), handlers=[handler])
    for name in _QUIET:
        logging.getLogger(name).setLevel(logging.WARNING)
