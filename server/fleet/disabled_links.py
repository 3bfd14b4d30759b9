"""Which links the operator has disabled; kept, so that a restart enables none by itself.

A port belongs to a radio, not to a robot: links of several robots that share a radio are disabled
and enabled together.
"""

import asyncio
from collections.abc import Set

from sqlalchemy.orm import Session

from db.query.station.events import add_event
from db.query.station.settings import get_setting, put_setting
from db.store import Store
from robot_link.clock import Clock
from robot_link.station.path import RadioPath
from server.base.event_bus import EventBus
from server.fleet.event import LinkSwitched
from server.fleet.words import carrier_title

_SETTING = "unplugged links"


def shared_port(uri: str) -> str:
    """Return what names the port of a link, which other robots may share."""
    return RadioPath(uri).transport_uri


class DisabledLinks:
    """Disabled links by their ports. Belongs to one event loop."""

    def __init__(self, store: Store, clock: Clock, bus: EventBus) -> None:
        self._store = store
        self._bus = bus
        self._clock = clock
        self._disabled: Set[str] = set()
        self._changing = asyncio.Lock()
        """Held from the look at what is disabled until its change is kept."""

    async def load(self) -> None:
        """Remember what was disabled when the station stopped."""
        found = await self._store.query(lambda session: get_setting(session, _SETTING))
        self._disabled = set() if found is None else {shared_port(uri) for uri in found["uris"]}

    @property
    def disabled(self) -> frozenset[str]:
        """Ports of the links that must not be used."""
        return frozenset(self._disabled)

    def is_enabled(self, uri: str) -> bool:
        """Tell whether a link may be used."""
        return shared_port(uri) not in self._disabled

    async def set(self, uri: str, *, is_enabled: bool, robot: str, by: str) -> None:
        """Enable or disable a port; kept, with who did it, before it takes effect.

        Args:
            uri: The link.
            is_enabled: Whether it may be used from now on.
            robot: On whose page it was done.
            by: Who did it.

        Raises:
            StoreUnavailableError: Nothing was changed.
        """
        port = shared_port(uri)
        at = self._clock.now()
        carrier = carrier_title(uri.partition(":")[0])
        text = f"{by} {'plugged' if is_enabled else 'unplugged'} {carrier} of {robot}."

        def write(session: Session, wanted: Set[str]) -> None:
            put_setting(session, _SETTING, {"uris": sorted(wanted)})
            add_event(
                session,
                at,
                "link.plugged" if is_enabled else "link.unplugged",
                text,
                level="info" if is_enabled else "watch",
                robot=robot,
                data={"link": port, "by": by},
            )

        async with self._changing:
            wanted = self._disabled - {port} if is_enabled else self._disabled | {port}
            await self._store.write(lambda session: write(session, wanted))
            self._disabled = wanted
            self._bus.publish(LinkSwitched(uri, is_enabled))
