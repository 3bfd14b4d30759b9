"""Keep which files were written of deployments."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0035"
down_revision: str | None = "0034"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def _key() -> sa.BigInteger:
    return sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "delivery_file",
        sa.Column("key", _key(), nullable=False),
        sa.Column("deployment_key", _key(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("mode", sa.String(), nullable=False),
        sa.Column("sha256", sa.String(), nullable=False),
        sa.Column("bytes", sa.BigInteger(), nullable=False),
        sa.Column("rows", sa.BigInteger(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("at", db.column.Utc(), nullable=False),
        sa.Column("by", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["deployment_key"],
            ["deployment.key"],
            name=op.f("fk_delivery_file_deployment_key_deployment"),
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_delivery_file")),
        sqlite_autoincrement=True,
    )
    name = op.f("ix_delivery_file_deployment_key_key")
    op.create_index(name, "delivery_file", ["deployment_key", "key"])


def downgrade() -> None:
    op.drop_table("delivery_file")
