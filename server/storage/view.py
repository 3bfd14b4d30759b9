"""Storage as it is told by REST."""

from dataclasses import dataclass
from datetime import datetime

from db.query.storage.told import PrunedStretch
from db.record import same
from server.base.view import View
from server.storage.passes import Passes
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
    elsewhere_bytes: int
    """Of these, in a database that does not lie on the data folder's disk; how much room it has
    there is not seen."""
    free_inside_bytes: int
    """Inside the database's file, for rows to come."""
    disk_free_bytes: int
    """Of the data folder's disk."""
    disk_bytes: int
    growth_bytes_per_day: float | None
    """``null`` as long as it is not known."""
    full_in_days: float | None
    """Of the data folder's disk, at the growth of what lies on it; ``null`` if that does not grow,
    or as long as growth is not known."""


@dataclass(frozen=True, slots=True)
class PassView(View):
    """A pass over what is kept, as it ended."""

    at: datetime
    message: str
    """What went, in words."""
    is_whole: bool
    """Whether it saw to everything; else it was cancelled, or failed."""


@dataclass(frozen=True, slots=True)
class StoredSizesView(View):
    """What the station keeps, and what becomes of it."""

    look: LookView | None
    """``null`` until everything was counted once."""
    last_pass: PassView | None
    next_pass_at: datetime | None
    """``null`` while everything is kept for ever."""
    job: str | None
    """The pass under way."""
    pruned: list[str]
    """What is no longer all there, sentences."""


@dataclass(frozen=True, slots=True)
class PrunedStretchView(View):
    """Rows that went, on days one after another."""

    kind: str
    action: str
    """``thin``, ``move`` or ``delete``."""
    period_s: int
    """Of which one row stayed, 0 where none did."""
    first_at: datetime
    last_at: datetime
    rows: int
    text: str
    """The same in words."""


def storage_view(sizes: Sizes, passes: Passes, pruned: list[PrunedStretch]) -> StoredSizesView:
    """Return everything as it is told."""
    last = passes.last
    return StoredSizesView(
        look=_look(sizes),
        last_pass=None
        if last is None
        else PassView(datetime.fromisoformat(last["at"]), last["message"], last["is_whole"]),
        next_pass_at=passes.next_at,
        job=passes.job,
        pruned=[one.text for one in pruned],
    )


def stretch_view(stretch: PrunedStretch) -> PrunedStretchView:
    """Return what went as it is told."""
    return same(PrunedStretchView, stretch, text=stretch.text)


def _look(sizes: Sizes) -> LookView | None:
    look = sizes.look
    if look is None:
        return None
    return same(
        LookView,
        look,
        kinds=_kinds(look, sizes),
        growth_bytes_per_day=sizes.growth_bytes_per_day(),
        full_in_days=sizes.full_in_days(),
    )


def _kinds(look: Look, sizes: Sizes) -> list[KindSizeView]:
    kinds = {kind.key: kind for kind in STORED_KINDS}
    return [
        same(
            KindSizeView,
            one,
            title=kinds[one.key].title,
            rows=one.rows if kinds[one.key].tables else None,
            rows_per_day=sizes.growth_rows_per_day(one.key) if kinds[one.key].tables else None,
        )
        for one in look.kinds
    ]
