"""Keep flags of quality: runs of rules, what they found, and what people set."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0033"
down_revision: str | None = "0032"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def _key() -> sa.BigInteger:
    return sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def _of_deployment(table: str) -> sa.ForeignKeyConstraint:
    return sa.ForeignKeyConstraint(
        ["deployment_key"], ["deployment.key"], name=op.f(f"fk_{table}_deployment_key_deployment")
    )


def upgrade() -> None:
    op.create_table(
        "quality_run",
        sa.Column("key", _key(), nullable=False),
        sa.Column("deployment_key", _key(), nullable=False),
        sa.Column("rules", sa.JSON(), nullable=False),
        sa.Column("sha256", sa.String(), nullable=False),
        sa.Column("counts", sa.JSON(), nullable=False),
        sa.Column("rows", sa.BigInteger(), nullable=False),
        sa.Column("at", db.column.Utc(), nullable=False),
        sa.Column("by", sa.String(), nullable=False),
        _of_deployment("quality_run"),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_quality_run")),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "quality_stretch",
        sa.Column("run_key", _key(), nullable=False),
        sa.Column("series", sa.String(), nullable=False),
        sa.Column("first_at", db.column.Utc(), nullable=False),
        sa.Column("last_at", db.column.Utc(), nullable=False),
        sa.Column("flag", sa.Integer(), nullable=False),
        sa.Column("tests", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["run_key"], ["quality_run.key"], name=op.f("fk_quality_stretch_run_key_quality_run")
        ),
        sa.PrimaryKeyConstraint("run_key", "series", "first_at", name=op.f("pk_quality_stretch")),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "manual_flag",
        sa.Column("key", _key(), nullable=False),
        sa.Column("deployment_key", _key(), nullable=False),
        sa.Column("series", sa.String(), nullable=False),
        sa.Column("first_at", db.column.Utc(), nullable=False),
        sa.Column("last_at", db.column.Utc(), nullable=False),
        sa.Column("flag", sa.Integer(), nullable=False),
        sa.Column("reason", sa.String(), nullable=False),
        sa.Column("at", db.column.Utc(), nullable=False),
        sa.Column("by", sa.String(), nullable=False),
        sa.Column("withdrawn_at", db.column.Utc(), nullable=True),
        sa.Column("withdrawn_by", sa.String(), nullable=True),
        _of_deployment("manual_flag"),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_manual_flag")),
        sqlite_autoincrement=True,
    )
    for table in ("quality_run", "manual_flag"):
        name = op.f(f"ix_{table}_deployment_key_key")
        op.create_index(name, table, ["deployment_key", "key"])


def downgrade() -> None:
    for table in ("manual_flag", "quality_stretch", "quality_run"):
        op.drop_table(table)
