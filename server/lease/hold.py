"""Hold automation: one switch that stops every script and everything that sends by itself."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from sqlalchemy.orm import Session

from db.query.station.events import add_event
from db.query.station.settings import get_setting, put_setting
from db.writer import tell_after_commit
from server.access.caller import Caller
from server.base.foundation import Foundation
from server.base.problem import Problem, conflict
from server.base.view import View

_SETTING: Final = "automation_hold"
HELD: Final = 423
"""Status of what a script asks for meanwhile."""


@dataclass(frozen=True, slots=True)
class HoldView(View):
    """Whether automation is held, by whom and since when."""

    is_held: bool = False
    by: str = ""
    since: datetime | None = None
    reason: str = ""
    text: str = ""
    """It in one sentence; empty while it is not held."""
    refusal: str = ""
    """Why who asks cannot let it go on, one sentence; empty where they can."""


@dataclass(frozen=True, slots=True)
class HoldChanged:
    """Automation is held, or goes on; told after the commit."""

    hold: HoldView


class AutomationHold:
    """The switch of one station, kept over restarts. Belongs to one event loop."""

    def __init__(self, foundation: Foundation) -> None:
        self._store = foundation.store
        self._clock = foundation.clock
        self._hold = HoldView()

    async def load(self) -> None:
        """Take up whether it was held when the station stopped."""
        self._hold = _of(await self._store.query(lambda session: get_setting(session, _SETTING)))

    def take_change(self, event: HoldChanged) -> None:
        """Take that it was switched."""
        self._hold = event.hold

    @property
    def view(self) -> HoldView:
        """Whether it is held."""
        return self._hold

    @property
    def is_held(self) -> bool:
        """Whether nothing may be sent by itself now."""
        return self._hold.is_held

    def refuse(self, caller: Caller) -> None:
        """Refuse a change by a script while automation is held.

        Raises:
            Problem: 423 with who holds it.
        """
        if self.is_held and caller.proof.kind == "token":
            raise Problem(HELD, f"{self._hold.text} A pilot can let it go on.")

    async def set(self, *, held: bool, by: str, reason: str = "") -> HoldView:
        """Hold automation, or let it go on.

        Raises:
            Problem: 409 if it is so already; the sentence says by whom.
            StoreUnavailableError: Nothing was changed.
        """
        at = self._clock.now()

        def write(session: Session) -> HoldView:
            before = _of(get_setting(session, _SETTING))
            if before.is_held == held:
                raise conflict(before.text if held else "Automation is not held.")
            told = {"is_held": held, "by": by, "since": at.isoformat(), "reason": reason}
            put_setting(session, _SETTING, told)
            after = _of(told)
            why = f" because of “{reason}”" if reason and not held else ""
            text = after.text or f"{by} let the automation of the station go on{why}."
            kind = "automation.held" if held else "automation.resumed"
            add_event(session, at, kind, text, level="watch", data={"reason": reason})
            tell_after_commit(session, HoldChanged(after), _SETTING)
            return after

        return await self._store.write(write)


def _of(setting: Mapping[str, Any] | None) -> HoldView:
    if setting is None or not setting["is_held"]:
        return HoldView()
    by, reason = setting["by"], setting["reason"]
    text = f"{by} holds the automation of the station{f': {reason}' if reason else ''}."
    return HoldView(True, by, datetime.fromisoformat(setting["since"]), reason, text)
