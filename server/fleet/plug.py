"""Which links the operator has unplugged; kept, so that a restart plugs nothing in by itself.

A plug is a radio's, not a robot's: links of several robots that share a radio share its plug.
"""

from sqlalchemy.orm import Session

from db.query.events import add_event
from db.query.settings import get_setting, put_setting
from db.store import Store
from robot_link.clock import Clock
from robot_link.station.path import RadioPath
from server.fleet.words import carrier_title

_SETTING = "unplugged links"


def plug_of(uri: str) -> str:
    """Return what names the plug of a link."""
    return RadioPath(uri).transport_uri


class Plugs:
    """Unplugged links by their plugs. Belongs to one event loop."""

    def __init__(self, store: Store, clock: Clock) -> None:
        self._store = store
        self._clock = clock
        self._unplugged: set[str] = set()

    async def load(self) -> None:
        """Remember what was unplugged when the station stopped."""
        found = await self._store.query(lambda session: get_setting(session, _SETTING))
        self._unplugged = set() if found is None else {plug_of(uri) for uri in found["uris"]}

    @property
    def unplugged(self) -> frozenset[str]:
        """Plugs of the links that must not be used."""
        return frozenset(self._unplugged)

    def is_plugged(self, uri: str) -> bool:
        """Tell whether a link may be used."""
        return plug_of(uri) not in self._unplugged

    async def set(self, uri: str, *, is_plugged: bool, robot: str, by: str) -> None:
        """Pull a plug or put it back; kept, with who did it, before it takes effect.

        Args:
            uri: The link.
            is_plugged: Whether it may be used from now on.
            robot: On whose page it was done.
            by: Who did it.

        Raises:
            StoreUnavailableError: Nothing was changed.
        """
        plug = plug_of(uri)
        wanted = self._unplugged - {plug} if is_plugged else self._unplugged | {plug}
        at = self._clock.now()
        carrier = carrier_title(uri.partition(":")[0])
        text = f"{by} {'plugged' if is_plugged else 'unplugged'} {carrier} of {robot}."

        def write(session: Session) -> None:
            put_setting(session, _SETTING, {"uris": sorted(wanted)})
            add_event(
                session,
                at,
                "link.plugged" if is_plugged else "link.unplugged",
                text,
                level="info" if is_plugged else "watch",
                robot=robot,
                data={"link": plug, "by": by},
            )

        await self._store.write(write)
        self._unplugged = wanted
