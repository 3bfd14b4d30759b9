"""Which links the operator has unplugged; kept, so that a restart plugs nothing in by itself.

A plug is a radio's, not a robot's: links of several robots that share a radio share its plug.
"""

from sqlalchemy.orm import Session

from db.query.settings import get_setting, put_setting
from db.store import Store
from robot_link.path import RadioPath

_SETTING = "unplugged links"


def plug_of(uri: str) -> str:
    """Return what names the plug of a link."""
    return RadioPath(uri).transport_uri


class Plugs:
    """Unplugged links by their plugs. Belongs to one event loop."""

    def __init__(self, store: Store) -> None:
        self._store = store
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

    async def set(self, uri: str, *, is_plugged: bool) -> None:
        """Pull a plug or put it back; kept before it takes effect.

        Raises:
            StoreUnavailableError: Nothing was changed.
        """
        plug = plug_of(uri)
        wanted = self._unplugged - {plug} if is_plugged else self._unplugged | {plug}

        def write(session: Session) -> None:
            put_setting(session, _SETTING, {"uris": sorted(wanted)})

        await self._store.write(write)
        self._unplugged = wanted
