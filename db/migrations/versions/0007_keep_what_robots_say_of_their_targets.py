"""Keep what robots that follow a target say of their hold on it."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0007"
down_revision: str | None = "0006"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "track_report",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("measured_at", db.column.Utc(), nullable=False),
        sa.Column("received_at", db.column.Utc(), nullable=False),
        sa.Column("phase", sa.Integer(), nullable=False),
        sa.Column("north_m", sa.Double(), nullable=False),
        sa.Column("east_m", sa.Double(), nullable=False),
        sa.Column("hypotheses", sa.JSON(), nullable=False),
        sa.Column("range_m", sa.Double(), nullable=True),
        sa.Column("range_age_s", sa.Double(), nullable=False),
        sa.Column("ranges_heard", sa.Integer(), nullable=False),
        sa.Column("ranges_rejected", sa.Integer(), nullable=False),
        sa.Column("determinant_m2_s", sa.Double(), nullable=False),
        sa.Column("barrier", sa.Double(), nullable=False),
        sa.Column("inverse_condition", sa.Double(), nullable=False),
        sa.Column("nominal_turn_rate_rad_s", sa.Double(), nullable=False),
        sa.Column("nominal_acceleration_m_s2", sa.Double(), nullable=False),
        sa.Column("turn_rate_rad_s", sa.Double(), nullable=False),
        sa.Column("acceleration_m_s2", sa.Double(), nullable=False),
        sa.Column("is_barrier_on", sa.Boolean(), nullable=False),
        sa.Column("is_feasible", sa.Boolean(), nullable=False),
        sa.Column("is_quiet", sa.Boolean(), nullable=False),
        sa.Column("true_north_m", sa.Double(), nullable=True),
        sa.Column("true_east_m", sa.Double(), nullable=True),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_track_report_robot_key")
        ),
        sa.PrimaryKeyConstraint("robot_key", "measured_at", name=op.f("pk_track_report")),
        sqlite_with_rowid=False,
    )


def downgrade() -> None:
    op.drop_table("track_report")
