"""Keep notices."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0028"
down_revision: str | None = "0027"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def _key() -> sa.BigInteger:
    return sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "notice_person",
        sa.Column("person_key", _key(), autoincrement=False, nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.ForeignKeyConstraint(
            ["person_key"], ["person.key"], name=op.f("fk_notice_person_person_key_person")
        ),
        sa.PrimaryKeyConstraint("person_key", name=op.f("pk_notice_person")),
    )
    op.create_table(
        "notice_contact",
        sa.Column("key", _key(), nullable=False),
        sa.Column("person_key", _key(), nullable=False),
        sa.Column("title", sa.String(), nullable=False),
        sa.Column("form", sa.String(), nullable=False),
        sa.Column("hint", sa.String(), nullable=False),
        sa.Column("enabled", sa.Boolean(), nullable=False),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("removed_at", db.column.Utc(), nullable=True),
        sa.ForeignKeyConstraint(
            ["person_key"], ["person.key"], name=op.f("fk_notice_contact_person_key_person")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_notice_contact")),
        sqlite_autoincrement=True,
    )
    op.create_index(
        op.f("ix_notice_contact_person_key"), "notice_contact", ["person_key"], unique=False
    )
    op.create_table(
        "notice_case",
        sa.Column("key", _key(), nullable=False),
        sa.Column("topic", sa.String(), nullable=False),
        sa.Column("level", sa.String(), nullable=False),
        sa.Column("robot", sa.String(), nullable=True),
        sa.Column("text", sa.String(), nullable=False),
        sa.Column("alarm", sa.String(), nullable=True),
        sa.Column("raised_at", db.column.Utc(), nullable=False),
        sa.Column("cursor", _key(), nullable=True),
        sa.Column("step", sa.Integer(), nullable=False),
        sa.Column("told_at", db.column.Utc(), nullable=True),
        sa.Column("next_at", db.column.Utc(), nullable=True),
        sa.Column("ended_at", db.column.Utc(), nullable=True),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_notice_case")),
        sa.UniqueConstraint("cursor", name=op.f("uq_notice_case_cursor")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_notice_case_alarm"), "notice_case", ["alarm"], unique=False)
    op.create_index(
        op.f("ix_notice_case_ended_at_next_at"),
        "notice_case",
        ["ended_at", "next_at"],
        unique=False,
    )
    op.create_table(
        "notice",
        sa.Column("key", _key(), nullable=False),
        sa.Column("contact_key", _key(), nullable=False),
        sa.Column("topic", sa.String(), nullable=False),
        sa.Column("level", sa.String(), nullable=False),
        sa.Column("title", sa.String(), nullable=False),
        sa.Column("text", sa.String(), nullable=False),
        sa.Column("items", sa.Integer(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("attempts", sa.Integer(), nullable=False),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("tried_at", db.column.Utc(), nullable=True),
        sa.Column("ended_at", db.column.Utc(), nullable=True),
        sa.Column("reply", sa.String(), nullable=False),
        sa.Column("link_expires_at", db.column.Utc(), nullable=True),
        sa.Column("link_used_at", db.column.Utc(), nullable=True),
        sa.ForeignKeyConstraint(
            ["contact_key"],
            ["notice_contact.key"],
            name=op.f("fk_notice_contact_key_notice_contact"),
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_notice")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_notice_contact_key"), "notice", ["contact_key"], unique=False)
    op.create_index(op.f("ix_notice_state_key"), "notice", ["state", "key"], unique=False)
    op.create_table(
        "notice_item",
        sa.Column("key", _key(), nullable=False),
        sa.Column("case_key", _key(), nullable=False),
        sa.Column("contact_key", _key(), nullable=False),
        sa.Column("step", sa.Integer(), nullable=False),
        sa.Column("level", sa.String(), nullable=False),
        sa.Column("raised_at", db.column.Utc(), nullable=False),
        sa.Column("not_before", db.column.Utc(), nullable=False),
        sa.Column("notice_key", _key(), nullable=True),
        sa.ForeignKeyConstraint(
            ["case_key"], ["notice_case.key"], name=op.f("fk_notice_item_case_key_notice_case")
        ),
        sa.ForeignKeyConstraint(
            ["contact_key"],
            ["notice_contact.key"],
            name=op.f("fk_notice_item_contact_key_notice_contact"),
        ),
        sa.ForeignKeyConstraint(
            ["notice_key"], ["notice.key"], name=op.f("fk_notice_item_notice_key_notice")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_notice_item")),
        sa.UniqueConstraint(
            "case_key",
            "contact_key",
            "step",
            "level",
            "raised_at",
            name=op.f("uq_notice_item_case_key_contact_key_step_level_raised_at"),
        ),
        sqlite_autoincrement=True,
    )
    op.create_index(
        op.f("ix_notice_item_notice_key_contact_key"),
        "notice_item",
        ["notice_key", "contact_key"],
        unique=False,
    )


def downgrade() -> None:
    op.drop_table("notice_item")
    op.drop_table("notice")
    op.drop_table("notice_case")
    op.drop_table("notice_contact")
    op.drop_table("notice_person")
