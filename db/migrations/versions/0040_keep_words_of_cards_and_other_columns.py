"""Tell the words of cards apart from those of second files; keep columns that are no channel."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0040"
down_revision: str | None = "0039"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def _key() -> sa.BigInteger:
    return sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.add_column(
        "recovered_sample",
        sa.Column("is_card", sa.Boolean(), nullable=False, server_default=sa.false()),
    )
    op.create_table(
        "other_series",
        sa.Column("key", _key(), nullable=False),
        sa.Column("deployment_key", _key(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("unit", sa.String(), nullable=False),
        sa.Column("count", sa.BigInteger(), nullable=False),
        sa.Column("first_at", db.column.Utc(), nullable=False),
        sa.Column("last_at", db.column.Utc(), nullable=False),
        sa.Column("least", sa.Double(), nullable=False),
        sa.Column("greatest", sa.Double(), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(
            ["deployment_key"],
            ["deployment.key"],
            name=op.f("fk_other_series_deployment_key_deployment"),
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_other_series")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_other_series_deployment_key"), "other_series", ["deployment_key"])


def downgrade() -> None:
    op.drop_table("other_series")
    op.drop_column("recovered_sample", "is_card")
