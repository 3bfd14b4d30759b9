"""Keep how many samples of a variable a robot has, which took seconds to count."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0009"
down_revision: str | None = "0008"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "sample_count",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("variable", sa.String(), nullable=False),
        sa.Column("is_live", sa.Boolean(), nullable=False),
        sa.Column("samples", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_sample_count_robot_key")
        ),
        sa.PrimaryKeyConstraint("robot_key", "variable", "is_live", name=op.f("pk_sample_count")),
        sqlite_with_rowid=False,
    )
    op.execute(
        "INSERT INTO sample_count (robot_key, variable, is_live, samples) "
        "SELECT robot_key, variable, is_live, count(*) FROM ("
        "SELECT robot_key, variable, measured_at >= robot.created_at AS is_live "
        "FROM field_sample JOIN robot ON robot.key = robot_key) AS one "
        "GROUP BY robot_key, variable, is_live"
    )


def downgrade() -> None:
    op.drop_table("sample_count")
