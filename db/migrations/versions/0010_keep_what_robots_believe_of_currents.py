"""Keep what robots believe of the current with which they reckon their position."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0010"
down_revision: str | None = "0009"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "current_report",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("measured_at", db.column.Utc(), nullable=False),
        sa.Column("received_at", db.column.Utc(), nullable=False),
        sa.Column("north_m_s", sa.Double(), nullable=False),
        sa.Column("east_m_s", sa.Double(), nullable=False),
        sa.Column("std_m_s", sa.Double(), nullable=False),
        sa.Column("doubt", sa.Double(), nullable=False),
        sa.Column("dives", sa.Integer(), nullable=False),
        sa.Column("fixes_refused", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_current_report_robot_key")
        ),
        sa.PrimaryKeyConstraint("robot_key", "measured_at", name=op.f("pk_current_report")),
        sqlite_with_rowid=False,
    )


def downgrade() -> None:
    op.drop_table("current_report")
