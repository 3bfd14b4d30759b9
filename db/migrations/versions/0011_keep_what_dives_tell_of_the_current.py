"""Keep what dives tell of the current."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0011"
down_revision: str | None = "0010"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "current_observation",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("started_at", db.column.Utc(), nullable=False),
        sa.Column("ended_at", db.column.Utc(), nullable=False),
        sa.Column("is_surface", sa.Boolean(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_current_observation_robot_key")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_current_observation")),
        sa.UniqueConstraint(
            "robot_key",
            "ended_at",
            "started_at",
            name=op.f("uq_current_observation_robot_key_ended_at_started_at"),
        ),
        sqlite_autoincrement=True,
    )


def downgrade() -> None:
    op.drop_table("current_observation")
