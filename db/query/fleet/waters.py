"""The waters in which robots work."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from autonomy.site import Site
from db.fault import StoreError, UnknownIdError
from db.record import same
from db.tables import Robot
from db.water_tables import WaterRow


class WaterExistsError(StoreError):
    """There is a water of this id already."""


class WaterChangedError(StoreError):
    """Somebody changed the water meanwhile."""


class WaterInUseError(StoreError):
    """Robots work in the water."""


@dataclass(frozen=True, slots=True)
class WaterRecord:
    """A water."""

    id: str
    site: Site
    """Its document."""
    version: int
    """Grows by one with each change."""
    created_at: datetime
    created_by: str
    changed_at: datetime
    retired_at: datetime | None
    """Since when no robot can be put there, None where it can."""


def add_water(session: Session, water: str, site: Site, *, at: datetime, by: str) -> WaterRecord:
    """Add a water.

    Raises:
        WaterExistsError: If its id is taken, be it by a retired one.
    """
    if session.scalar(select(WaterRow.key).where(WaterRow.id == water)) is not None:
        raise WaterExistsError(f"There is a water {water!r} already.")
    row = WaterRow(
        id=water,
        document=site.model_dump(mode="json"),
        version=1,
        created_at=at,
        created_by=by,
        changed_at=at,
        retired_at=None,
    )
    session.add(row)
    session.flush()
    return _record(row)


def change_water(
    session: Session,
    water: str,
    *,
    at: datetime,
    site: Site | None = None,
    is_retired: bool | None = None,
    version: int | None = None,
) -> WaterRecord:
    """Change the document of a water, or retire it or bring it back.

    Args:
        session: Transaction.
        water: Its id.
        at: Now.
        site: The new document; None leaves it.
        is_retired: Whether it is retired from now on; None leaves that.
        version: The version that the change was made from; None overwrites any.

    Raises:
        UnknownIdError: If there is none of this id.
        WaterChangedError: If it has another version.
        WaterInUseError: If it is to be retired, but robots work there.
    """
    row = _row(session, water)
    if version is not None and row.version != version:
        raise WaterChangedError(f"{water} was changed meanwhile.")
    if is_retired:
        robots = robots_of(session).get(water, [])
        if robots:
            names = ", ".join(robots)
            raise WaterInUseError(f"{names} work in {water}; put them elsewhere first.")
    if site is not None:
        row.document = site.model_dump(mode="json")
    if is_retired is not None:
        row.retired_at = (row.retired_at or at) if is_retired else None
    row.version += 1
    row.changed_at = at
    session.flush()
    return _record(row)


def get_water(session: Session, water: str) -> WaterRecord:
    """Return one water.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return _record(_row(session, water))


def list_waters(session: Session) -> list[WaterRecord]:
    """Return every water in the order in which they were added."""
    return [_record(row) for row in session.scalars(select(WaterRow).order_by(WaterRow.key))]


def robots_of(session: Session) -> dict[str, list[str]]:
    """Return the ids of the robots that work in each water that has any."""
    found: dict[str, list[str]] = {}
    places = select(WaterRow.id, Robot.id).join(Robot, Robot.water_key == WaterRow.key)
    for water, robot in session.execute(places.order_by(Robot.key)):
        found.setdefault(water, []).append(robot)
    return found


def water_row(session: Session, water: str) -> WaterRow:
    """Return the row of a water in which robots can be put, for the queries of this package.

    Raises:
        UnknownIdError: If there is none of this id.
        WaterInUseError: If it is retired.
    """
    row = _row(session, water)
    if row.retired_at is not None:
        raise WaterInUseError(f"{water} is retired; bring it back first.")
    return row


def row_of_site(session: Session, site: Site) -> WaterRow | None:
    """Return the water in use whose document a site is, None where it is a script's own."""
    rows = session.scalars(
        select(WaterRow).where(WaterRow.retired_at.is_(None)).order_by(WaterRow.key)
    )
    return next((row for row in rows if Site.model_validate(row.document) == site), None)


def _row(session: Session, water: str) -> WaterRow:
    row = session.scalar(select(WaterRow).where(WaterRow.id == water))
    if row is None:
        raise UnknownIdError("water", water)
    return row


def _record(row: WaterRow) -> WaterRecord:
    return same(WaterRecord, row, site=Site.model_validate(row.document))
