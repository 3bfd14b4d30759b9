"""Keep which deliveries were packed of deployments."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0039"
down_revision: str | None = "0038"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def _key() -> sa.BigInteger:
    return sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "delivery_package",
        sa.Column("key", _key(), nullable=False),
        sa.Column("file_key", _key(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("sha256", sa.String(), nullable=False),
        sa.Column("bytes", sa.BigInteger(), nullable=False),
        sa.Column("has_journal", sa.Boolean(), nullable=False),
        sa.Column("at", db.column.Utc(), nullable=False),
        sa.Column("by", sa.String(), nullable=False),
        sa.Column("expires_at", db.column.Utc(), nullable=False),
        sa.ForeignKeyConstraint(
            ["file_key"],
            ["delivery_file.key"],
            name=op.f("fk_delivery_package_file_key_delivery_file"),
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_delivery_package")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_delivery_package_file_key"), "delivery_package", ["file_key"])


def downgrade() -> None:
    op.drop_table("delivery_package")
