"""Sums up what robots reported of themselves, a few stretches of time at once."""

import asyncio
import logging
from datetime import timedelta
from typing import Final

from db.fault import StoreError
from db.state_sums import sum_up_next
from server.base.foundation import Foundation

log = logging.getLogger(__name__)

_BEHIND: Final = timedelta(minutes=1)
"""Reports may be on their way for so long before a stretch is summed up."""
_STRETCHES: Final = 20
"""Summed up in one transaction: some 50 ms of the writer."""
_REST_S: Final = 0.1
_PERIOD_S: Final = 60.0
"""Both by the wall."""


class StateSums:
    """Keeps the sums of state reports up to date. Belongs to one event loop.

    A database that has none yet, of an earlier version, is summed up from its beginning.
    """

    def __init__(self, foundation: Foundation) -> None:
        self._store = foundation.store
        self._clock = foundation.clock

    async def run(self) -> None:
        """Sum up until cancelled."""
        while True:
            has_more = False
            try:
                before = self._clock.now() - _BEHIND
                has_more = await self._store.write(
                    lambda session, before=before: sum_up_next(session, _STRETCHES, before)
                )
            except StoreError as error:
                log.warning("reports are summed up later: %s", error)
            await asyncio.sleep(_REST_S if has_more else _PERIOD_S)
