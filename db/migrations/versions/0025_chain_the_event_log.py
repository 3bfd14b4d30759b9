"""Say who caused each event, and chain the event log by hashes."""

import json
from collections.abc import Sequence
from types import SimpleNamespace

import sqlalchemy as sa
from alembic import op

from db.column import moment
from db.query.station.event_chain import GENESIS, row_hash

revision: str = "0025"
down_revision: str | None = "0024"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_PAGE = 2000


def upgrade() -> None:
    op.add_column("event", sa.Column("actor", sa.String(), nullable=True))
    op.add_column("event", sa.Column("actor_kind", sa.String(), nullable=True))
    op.add_column("event", sa.Column("hash", sa.LargeBinary(32), nullable=True))
    key = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
    op.create_table(
        "event_head",
        sa.Column("key", key, nullable=False),
        sa.Column("rows", sa.Integer(), nullable=False),
        sa.Column("hash", sa.LargeBinary(32), nullable=False),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_event_head")),
    )
    _chain_what_is_there()
    with op.batch_alter_table("event", table_kwargs={"sqlite_autoincrement": True}) as event:
        event.alter_column("hash", existing_type=sa.LargeBinary(32), nullable=False)
    op.create_index(op.f("ix_event_actor"), "event", ["actor"])


def _chain_what_is_there() -> None:
    """Chain the rows of before as they are: from here on a change of them shows too."""
    connection, previous, place, cursor = op.get_bind(), GENESIS, 0, 0
    page_of = sa.text(
        "SELECT cursor, at, kind, level, robot_key, text, data FROM event "
        f"WHERE cursor > :cursor ORDER BY cursor LIMIT {_PAGE}"
    )
    update = sa.text("UPDATE event SET hash = :hash WHERE cursor = :cursor")
    while rows := connection.execute(page_of, {"cursor": cursor}).all():
        hashed = []
        for row in rows:
            data = json.loads(row.data) if isinstance(row.data, str) else row.data
            told = {**row._mapping, "at": moment(int(row.at)), "data": data}  # noqa: SLF001
            place += 1
            event = SimpleNamespace(**told, actor=None, actor_kind=None)
            previous = row_hash(previous, place, event)
            hashed.append({"hash": previous, "cursor": row.cursor})
        connection.execute(update, hashed)
        cursor = rows[-1].cursor
    if place:
        head = sa.text("INSERT INTO event_head (key, rows, hash) VALUES (1, :rows, :hash)")
        connection.execute(head, {"rows": place, "hash": previous})


def downgrade() -> None:
    op.drop_index(op.f("ix_event_actor"), "event")
    op.drop_table("event_head")
    with op.batch_alter_table("event", table_kwargs={"sqlite_autoincrement": True}) as event:
        for name in ("hash", "actor_kind", "actor"):
            event.drop_column(name)
