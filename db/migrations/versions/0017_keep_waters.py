"""Keep waters in a table of their own, and refer to them from robots."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa
from alembic import op
from pydantic import ValidationError

import db.column
from autonomy.site import LAKE, TANK, Site

revision: str = "0017"
down_revision: str | None = "0016"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
_ROBOT = sa.table(
    "robot",
    sa.column("key", _KEY),
    sa.column("kind", sa.String()),
    sa.column("site", sa.JSON()),
    sa.column("water_key", _KEY),
)
_DELIVERED = (TANK, LAKE)


def upgrade() -> None:
    water = op.create_table(
        "water",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("changed_at", db.column.Utc(), nullable=False),
        sa.Column("retired_at", db.column.Utc(), nullable=True),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_water")),
        sa.UniqueConstraint("id", name=op.f("uq_water_id")),
        sqlite_autoincrement=True,
    )
    op.add_column("robot", sa.Column("water_key", _KEY, nullable=True))
    bind = op.get_bind()
    robots = bind.execute(sa.select(_ROBOT).order_by(_ROBOT.c.key)).all()
    sites: dict[int, Site] = {}
    for robot in robots:
        if robot.kind != "recorded":
            try:
                sites[robot.key] = Site.model_validate(robot.site)
            except ValidationError:
                continue  # a script's own; it stays with its robot as it is
    waters: dict[str, Site] = {}
    for site in (*_DELIVERED, *sites.values()):
        if site not in waters.values():
            waters[_free_id(site.name, waters)] = site
    at = datetime.now(UTC)
    rows: list[dict[str, Any]] = [
        {
            "key": key,
            "id": name,
            "document": site.model_dump(mode="json"),
            "version": 1,
            "created_at": at,
            "created_by": "station",
            "changed_at": at,
            "retired_at": None,
        }
        for key, (name, site) in enumerate(waters.items(), start=1)
    ]
    bind.execute(sa.insert(water), rows)
    if bind.dialect.name == "postgresql":
        op.execute("SELECT setval(pg_get_serial_sequence('water', 'key'), MAX(key)) FROM water")
    known = list(waters.values())
    for robot, site in sites.items():
        bind.execute(
            sa.update(_ROBOT)
            .where(_ROBOT.c.key == robot)
            .values(water_key=known.index(site) + 1, site={})
        )


def downgrade() -> None:
    bind = op.get_bind()
    water = sa.table("water", sa.column("key", _KEY), sa.column("document", sa.JSON()))
    for key, document in bind.execute(sa.select(water)).all():
        bind.execute(sa.update(_ROBOT).where(_ROBOT.c.water_key == key).values(site=document))
    op.drop_column("robot", "water_key")
    op.drop_table("water")


def _free_id(name: str, taken: dict[str, Site]) -> str:
    stem = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:36] or "water"
    numbered = (f"{stem}-{number}" for number in range(2, len(taken) + 3))
    return next(one for one in (stem, *numbered) if one not in taken)
