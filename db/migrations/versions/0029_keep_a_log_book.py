"""Keep a log book."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0029"
down_revision: str | None = "0028"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def _key() -> sa.BigInteger:
    return sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_index("ix_event_at", "event", ["at"])
    op.create_table(
        "shift",
        sa.Column("key", _key(), nullable=False),
        sa.Column("person", sa.String(), nullable=False),
        sa.Column("began_at", db.column.Utc(), nullable=False),
        sa.Column("ended_at", db.column.Utc(), nullable=True),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_shift")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_shift_person_began_at"), "shift", ["person", "began_at"])
    op.create_index(op.f("ix_shift_began_at"), "shift", ["began_at"])
    op.create_table(
        "shift_page",
        sa.Column("key", _key(), nullable=False),
        sa.Column("began_at", db.column.Utc(), nullable=False),
        sa.Column("ended_at", db.column.Utc(), nullable=False),
        sa.Column("content", sa.String(), nullable=False),
        sa.Column("sha256", sa.String(), nullable=False),
        sa.Column("left_by", sa.String(), nullable=False),
        sa.Column("left_at", db.column.Utc(), nullable=False),
        sa.Column("taken_by", sa.String(), nullable=True),
        sa.Column("taken_at", db.column.Utc(), nullable=True),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_shift_page")),
        sqlite_autoincrement=True,
    )
    _create_entries()


def _create_entries() -> None:
    op.create_table(
        "log_entry",
        sa.Column("key", _key(), nullable=False),
        sa.Column("corrects_key", _key(), nullable=True),
        sa.Column("page_key", _key(), nullable=True),
        sa.Column("versions", sa.Integer(), nullable=False),
        sa.Column("written_at", db.column.Utc(), nullable=False),
        sa.Column("written_by", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["corrects_key"], ["log_entry.key"], name=op.f("fk_log_entry_corrects_key_log_entry")
        ),
        sa.ForeignKeyConstraint(
            ["page_key"], ["shift_page.key"], name=op.f("fk_log_entry_page_key_shift_page")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_log_entry")),
        sqlite_autoincrement=True,
    )
    for column in ("corrects_key", "page_key", "written_at"):
        op.create_index(op.f(f"ix_log_entry_{column}"), "log_entry", [column])
    op.create_table(
        "log_entry_version",
        sa.Column("key", _key(), nullable=False),
        sa.Column("entry_key", _key(), nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("at", db.column.Utc(), nullable=False),
        sa.Column("robot_key", _key(), nullable=True),
        sa.Column("deployment_key", _key(), nullable=True),
        sa.Column("text", sa.String(), nullable=False),
        sa.Column("tags", sa.JSON(), nullable=False),
        sa.Column("attachments", sa.JSON(), nullable=False),
        sa.Column("is_struck", sa.Boolean(), nullable=False),
        sa.Column("written_at", db.column.Utc(), nullable=False),
        sa.Column("written_by", sa.String(), nullable=False),
        sa.Column("sha256", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["entry_key"], ["log_entry.key"], name=op.f("fk_log_entry_version_entry_key_log_entry")
        ),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_log_entry_version_robot_key_robot")
        ),
        sa.ForeignKeyConstraint(
            ["deployment_key"],
            ["deployment.key"],
            name=op.f("fk_log_entry_version_deployment_key_deployment"),
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_log_entry_version")),
        sa.UniqueConstraint(
            "entry_key", "number", name=op.f("uq_log_entry_version_entry_key_number")
        ),
        sqlite_autoincrement=True,
    )
    for column in ("at", "deployment_key"):
        op.create_index(op.f(f"ix_log_entry_version_{column}"), "log_entry_version", [column])


def downgrade() -> None:
    for table in ("log_entry_version", "log_entry", "shift_page", "shift"):
        op.drop_table(table)
    op.drop_index("ix_event_at", "event")
