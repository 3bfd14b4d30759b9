"""What a long-running verb says while it runs, on standard error."""

import logging

_QUIET = ("alembic", "httpx")
"""They say much, and httpx every address that it asks: some hold a secret word."""


def log_to_console() -> None:
    """Say what happens from INFO on, each line with its time and who says it."""
    logging.basicConfig(
        level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s"
    )
    for name in _QUIET:
        logging.getLogger(name).setLevel(logging.WARNING)
