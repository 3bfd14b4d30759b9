"""Which links the operator has unplugged; kept, so that a restart plugs nothing in by itself."""

from sqlalchemy.orm import Session

from db.query.settings import get_setting, put_setting
from db.store import Store

_SETTING = "unplugged links"


class Plugs:
    """Unplugged links by their URI. Belongs to one event loop."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._unplugged: set[str] = set()

    async def load(self) -> None:
        """Remember what was unplugged when the station stopped."""
        found = await self._store.query(lambda session: get_setting(session, _SETTING))
        self._unplugged = set() if found is None else set(found["uris"])

    @property
    def unplugged(self) -> frozenset[str]:
        """URIs of the links that must not be used."""
        return frozenset(self._unplugged)

    def is_plugged(self, uri: str) -> bool:
        """Tell whether a link may be used."""
        return uri not in self._unplugged

    async def set(self, uri: str, *, is_plugged: bool) -> None:
        """Pull a plug or put it back; kept before it takes effect.

        Raises:
            StoreUnavailableError: Nothing was changed.
        """
        wanted = self._unplugged - {uri} if is_plugged else self._unplugged | {uri}

        def write(session: Session) -> None:
            put_setting(session, _SETTING, {"uris": sorted(wanted)})

        await self._store.write(write)
        self._unplugged = wanted
