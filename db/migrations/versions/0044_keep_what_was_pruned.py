"""Keep which days were thinned, moved to files or deleted."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0044"
down_revision: str | None = "0043"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "pruned_day",
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("day", sa.Integer(), nullable=False),
        sa.Column("action", sa.String(), nullable=False),
        sa.Column("period_s", sa.Integer(), nullable=False),
        sa.Column("rows", sa.BigInteger(), nullable=False),
        sa.Column("first_at", sa.BigInteger(), nullable=True),
        sa.Column("last_at", sa.BigInteger(), nullable=True),
        sa.Column("is_whole", sa.Boolean(), server_default=sa.false(), nullable=False),
        sa.PrimaryKeyConstraint(
            "kind", "robot_key", "day", "action", "period_s", name=op.f("pk_pruned_day")
        ),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "archive_file",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("day", sa.Integer(), nullable=False),
        sa.Column("path", sa.String(), nullable=False),
        sa.Column("rows", sa.BigInteger(), nullable=False),
        sa.Column("bytes", sa.BigInteger(), nullable=False),
        sa.Column("sha256", sa.String(), nullable=False),
        sa.Column("first_at", sa.BigInteger(), nullable=False),
        sa.Column("last_at", sa.BigInteger(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("written_at", sa.BigInteger(), nullable=False),
        sa.Column("restored_at", sa.BigInteger(), nullable=True),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_archive_file")),
        sqlite_autoincrement=True,
    )
    op.create_index(
        op.f("ix_archive_file_kind_robot_key_day"), "archive_file", ["kind", "robot_key", "day"]
    )


def downgrade() -> None:
    op.drop_index(op.f("ix_archive_file_kind_robot_key_day"), table_name="archive_file")
    op.drop_table("archive_file")
    op.drop_table("pruned_day")
