"""What can go wrong with the station's memory, ordered by what the caller can do.

::

    StoreError
    ├── UnknownIdError        ask for something that exists
    ├── StoreUnavailableError try again later: locked, full, read-only or failing storage
    │   └── BufferFullError   rows were not taken; whoever holds them must keep them
    ├── StoreClosedError      the station is stopping
    └── DatabaseUrlError      give another URL, or install what this one needs
"""


class StoreError(Exception):
    """Parent of everything that ``db`` raises on purpose."""


class UnknownIdError(StoreError):
    """No row has this id; ``kind`` and ``identity`` say which was asked for."""

    def __init__(self, kind: str, identity: str) -> None:
        super().__init__(f"There is no {kind} {identity!r}.")
        self.kind = kind
        self.identity = identity


class StoreUnavailableError(StoreError):
    """The database did not take a change; nothing of it was kept."""


class BufferFullError(StoreUnavailableError):
    """The database has failed for so long that no more rows can wait for it."""


class StoreClosedError(StoreError):
    """The store takes no more work."""


class DatabaseUrlError(StoreError, ValueError):
    """The URL names no database that the store can keep its promises on."""
