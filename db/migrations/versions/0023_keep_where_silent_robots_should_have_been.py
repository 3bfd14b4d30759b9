"""Keep where robots that were not heard should have been, and where they were found."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0023"
down_revision: str | None = "0022"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    key = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
    op.create_table(
        "prediction",
        sa.Column("key", key, nullable=False),
        sa.Column("robot_key", key, nullable=False),
        sa.Column("said_at", db.column.Utc(), nullable=False),
        sa.Column("seen_at", db.column.Utc(), nullable=False),
        sa.Column("is_inside", sa.Boolean(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.ForeignKeyConstraint(["robot_key"], ["robot.key"], name=op.f("fk_prediction_robot_key")),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_prediction")),
        sa.UniqueConstraint("robot_key", "seen_at", name=op.f("uq_prediction_robot_key_seen_at")),
        sqlite_autoincrement=True,
    )


def downgrade() -> None:
    op.drop_table("prediction")
