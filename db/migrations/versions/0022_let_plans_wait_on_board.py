"""Let plans wait on board."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0022"
down_revision: str | None = "0021"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.create_table(
        "plan_queue",
        sa.Column(
            "robot_key", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False
        ),
        sa.Column("measured_at", db.column.Utc(), nullable=False),
        sa.Column("received_at", db.column.Utc(), nullable=False),
        sa.Column("sha256", sa.String(), nullable=True),
        sa.Column("next_sha256", sa.String(), nullable=True),
        sa.Column("next_starts", sa.Boolean(), nullable=False),
        sa.Column("last_sha256", sa.String(), nullable=True),
        sa.Column("last_done", sa.Boolean(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_plan_queue_robot_key_robot")
        ),
        sa.PrimaryKeyConstraint("robot_key", "measured_at", name=op.f("pk_plan_queue")),
        sqlite_with_rowid=False,
    )
    op.add_column("plan", sa.Column("waiting_at", db.column.Utc(), nullable=True))


def downgrade() -> None:
    op.drop_column("plan", "waiting_at")
    op.drop_table("plan_queue")
