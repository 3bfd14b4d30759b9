"""Storage as it is told by REST."""

from dataclasses import dataclass
from datetime import datetime

from server.base.view import View
from server.storage.sizes import Look, Sizes
from server.storage.stored_kind import STORED_KINDS


@dataclass(frozen=True, slots=True)
class KindSizeView(View):
    """One kind of data: about how much there is of it."""

    key: str
    title: str
    rows: int | None
    """``null`` of what lies in files."""
    bytes: int
    oldest_at: datetime | None
    newest_at: datetime | None
    rows_per_day: float | None
    """``null`` as long as growth is not known."""


@dataclass(frozen=True, slots=True)
class LookView(View):
    """What was found at the newest look; bytes of kinds are judged, about right."""

    at: datetime
    kinds: list[KindSizeView]
    other_bytes: int
    """Of all that has no name of its own."""
    used_bytes: int
    free_inside_bytes: int
    """Inside the database's file, for rows to come."""
    disk_free_bytes: int
    disk_bytes: int
    growth_bytes_per_day: float | None
    """``null`` as long as it is not known."""
    full_in_days: float | None
    """``null`` if it does not grow, or as long as growth is not known."""


@dataclass(frozen=True, slots=True)
class StorageView(View):
    """What the station keeps."""

    look: LookView | None
    """``null`` until everything was counted once."""


def look_view(sizes: Sizes) -> LookView | None:
    """Return the newest look as it is told."""
    look = sizes.look
    if look is None:
        return None
    return LookView(
        at=look.at,
        kinds=_kinds(look, sizes),
        other_bytes=look.other_bytes,
        used_bytes=look.used_bytes,
        free_inside_bytes=look.free_inside_bytes,
        disk_free_bytes=look.disk_free_bytes,
        disk_bytes=look.disk_bytes,
        growth_bytes_per_day=sizes.growth_bytes_per_day(),
        full_in_days=sizes.full_in_days(),
    )


def _kinds(look: Look, sizes: Sizes) -> list[KindSizeView]:
    kinds = {kind.key: kind for kind in STORED_KINDS}
    return [
        KindSizeView(
            one.key,
            kinds[one.key].title,
            one.rows if kinds[one.key].tables else None,
            one.bytes,
            one.oldest_at,
            one.newest_at,
            sizes.growth_rows_per_day(one.key) if kinds[one.key].tables else None,
        )
        for one in look.kinds
    ]
