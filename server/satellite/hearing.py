"""Who was heard by satellite when, as the fleet shows it."""

from datetime import UTC, datetime, timedelta
from typing import Final

from db.query.satellite.inbox import newest_session
from db.store import Store
from robot_link.clock import Clock
from robot_link.station.gateway.gateway import MobileOriginated
from server.fleet.disabled_links import DisabledLinks
from server.fleet.fleet import Fleet
from server.fleet.status import RobotStatus, SatelliteStatus
from server.satellite.account import Account, Settings
from server.satellite.contact import (
    Heard,
    contact_lost_at,
    link_report,
    next_session_at,
    overdue_at,
)
from server.satellite.modem import Modem, modems_of

LATEST_DELIVERY: Final = timedelta(days=5)
"""A gateway keeps a message no longer."""
_NEVER: Final = datetime.min.replace(tzinfo=UTC)


class Hearing:
    """Keeps the health of each satellite link, and shows it. Belongs to one event loop."""

    def __init__(
        self, store: Store, clock: Clock, fleet: Fleet, disabled_links: DisabledLinks
    ) -> None:
        self._store = store
        self._clock = clock
        self._fleet = fleet
        self._disabled_links = disabled_links
        self._heard: dict[str, Heard | None] = {}
        """By modem; ``None`` for one that never called."""

    async def remember(self, modem: Modem) -> None:
        """Read once when a modem called last."""
        if modem.imei in self._heard:
            return
        newest = await self._store.query(
            lambda session: newest_session(session, modem.imei, LATEST_DELIVERY)
        )
        self._heard.setdefault(modem.imei, None if newest is None else Heard(newest, 0, 0))

    def note(
        self, modem: Modem, message: MobileOriginated, settings: Settings, *, is_proved: bool
    ) -> None:
        """Note a message; only what the robot's key proves says that the robot was heard.

        A gateway whose clock is ahead hears nobody later than now, and one that names a session
        from before it could still deliver it hears nobody.
        """
        known = self._heard.get(modem.imei) or Heard(None, 0, 0)
        is_contact = is_proved and message.session_at >= message.arrived_at - LATEST_DELIVERY
        session_at = min(message.session_at, self._clock.now()) if is_contact else None
        self._heard[modem.imei] = Heard(
            max(filter(None, (known.session_at, session_at)), default=None),
            known.frames_received + is_proved,
            known.frames_bad + (not is_proved and bool(message.data)),
        )
        self._report(self._fleet.status(modem.robot), modem, settings)

    def show(self, status: RobotStatus, account: Account, *, waits_for_budget: bool) -> None:
        """Show where the satellite links of a robot stand."""
        modems = modems_of(status.record)
        self.show_links(status, account.settings)
        heard = [found for one in modems if (found := self._heard.get(one.imei)) is not None]
        called = [one for one in heard if one.session_at is not None]
        newest = max(called, key=lambda one: one.session_at or _NEVER, default=None)
        period_s = account.settings.satellite.session_period_s
        shown = SatelliteStatus(
            credits_today=account.budget.spent,
            credits_per_day=account.budget.per_day,
            waits_for_budget=waits_for_budget,
            next_session_at=next_session_at(status, newest, period_s),
            fault=account.fault,
        )
        self._fleet.set_satellite(status.record.id, shown)

    def due_at(self, status: RobotStatus, settings: Settings) -> list[datetime]:
        """Return when time alone changes the health of a robot's links."""
        heard = [found for one in modems_of(status.record) if (found := self._heard.get(one.imei))]
        lost_at = contact_lost_at(status, settings.satellite)
        moments = [overdue_at(one, settings.satellite) for one in heard]
        return [one for one in (*moments, lost_at) if one is not None]

    def show_links(self, status: RobotStatus, settings: Settings) -> None:
        """Show the satellite links of a robot by what is known of its settings already."""
        for modem in modems_of(status.record):
            self._report(status, modem, settings)

    def _report(self, status: RobotStatus, modem: Modem, settings: Settings) -> None:
        report = link_report(
            modem,
            status,
            self._heard.get(modem.imei),
            settings.satellite,
            self._clock.now(),
            is_enabled=self._disabled_links.is_enabled(modem.uri),
        )
        if status.links.get(modem.uri) != report:
            self._fleet.take_link(report)
