"""Keep smoothed samples and comparisons of maps."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0003"
down_revision: str | None = "0002"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "smoothed_sample",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("log", sa.BigInteger(), nullable=False),
        sa.Column("sequence", sa.BigInteger(), nullable=False),
        sa.Column("north_m", sa.Double(), nullable=False),
        sa.Column("east_m", sa.Double(), nullable=False),
        sa.Column("depth_m", sa.Double(), nullable=False),
        sa.Column("position_std_m", sa.Double(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key", "log", "sequence"],
            ["field_sample.robot_key", "field_sample.log", "field_sample.sequence"],
            name=op.f("fk_smoothed_sample_robot_key_log_sequence"),
        ),
        sa.PrimaryKeyConstraint("robot_key", "log", "sequence", name=op.f("pk_smoothed_sample")),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "map_comparison",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("variable", sa.String(), nullable=False),
        sa.Column("at", db.column.Utc(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("grid", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_map_comparison_robot_key")
        ),
        sa.PrimaryKeyConstraint("robot_key", "variable", name=op.f("pk_map_comparison")),
        sqlite_with_rowid=False,
    )


def downgrade() -> None:
    for table in ("map_comparison", "smoothed_sample"):
        op.drop_table(table)
