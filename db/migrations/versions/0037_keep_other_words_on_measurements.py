"""Keep what recovered cards and second files say of measurements that are kept."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0037"
down_revision: str | None = "0036"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def _key() -> sa.BigInteger:
    return sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "recovered_sample",
        sa.Column("log_key", _key(), nullable=False),
        sa.Column("sequence", sa.BigInteger(), nullable=False),
        sa.Column("measured_at", db.column.Utc(), nullable=False),
        sa.Column("value", sa.Double(), nullable=False),
        sa.Column("north_mm", sa.Integer(), nullable=False),
        sa.Column("east_mm", sa.Integer(), nullable=False),
        sa.Column("depth_mm", sa.Integer(), nullable=False),
        sa.Column("position_std_um", sa.BigInteger(), nullable=False),
        sa.Column("received_at", db.column.Utc(), nullable=False),
        sa.ForeignKeyConstraint(
            ["log_key"], ["sample_log.key"], name=op.f("fk_recovered_sample_log_key_sample_log")
        ),
        sa.PrimaryKeyConstraint("log_key", "sequence", name=op.f("pk_recovered_sample")),
        sqlite_with_rowid=False,
    )


def downgrade() -> None:
    op.drop_table("recovered_sample")
