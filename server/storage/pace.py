"""How fast rows go: transactions so short that the writer's others do not notice, with rests."""

import time
from collections.abc import Callable
from typing import Final

from db.store import Store

TARGET_S: Final = 0.010
"""What a transaction should take; twice that is the limit for SQLite."""
_SIZE_FIRST: Final = 100
_SIZE_LEAST, _SIZE_MOST = 10, 4000
_REST_S: Final = 0.02
_REST_SHARE: Final = 2.0
"""Of what a transaction took: at most a third of the writer's time goes into pruning."""
_WAITING_ROWS: Final = 2000
"""With more rows of robots waiting, pruning waits."""
_LONGEST_WAIT_S: Final = 30.0


class Pace:
    """Says how many rows go at once, and rests in between. Belongs to the thread that prunes."""

    def __init__(self, store: Store, sleep: Callable[[float], None] = time.sleep) -> None:
        self._store = store
        self._sleep = sleep
        self.size = _SIZE_FIRST
        """Rows of the next transaction."""
        self.longest_s = 0.0
        self.transactions = 0

    def rest_after(self, took_s: float, rows: int) -> None:
        """Note what a transaction took, and rest; longer while robots' rows wait."""
        self.longest_s = max(self.longest_s, took_s)
        self.transactions += 1
        if rows >= self.size or took_s > TARGET_S:
            wanted = rows * min(1.5, max(0.3, TARGET_S / max(took_s, 1e-4)))
            self.size = max(_SIZE_LEAST, min(_SIZE_MOST, round(wanted)))
        self._sleep(max(_REST_S, _REST_SHARE * took_s))
        until_s = time.monotonic() + _LONGEST_WAIT_S
        while self._store.waiting_rows > _WAITING_ROWS and time.monotonic() < until_s:
            self._sleep(_REST_S)
