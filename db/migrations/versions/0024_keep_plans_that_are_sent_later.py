"""Keep plans that are sent later."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0024"
down_revision: str | None = "0023"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def _key() -> sa.BigInteger:
    return sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "scheduled_send",
        sa.Column("key", _key(), nullable=False),
        sa.Column("robot_key", _key(), nullable=False),
        sa.Column("plan_key", _key(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("condition", sa.JSON(), nullable=False),
        sa.Column("cursor", sa.Integer(), nullable=False),
        sa.Column("route", sa.String(), nullable=False),
        sa.Column("start", sa.Boolean(), nullable=False),
        sa.Column("confirmed", sa.Boolean(), nullable=False),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("expires_at", db.column.Utc(), nullable=False),
        sa.Column("due_at", db.column.Utc(), nullable=True),
        sa.Column("sent_at", db.column.Utc(), nullable=True),
        sa.Column("ended_at", db.column.Utc(), nullable=True),
        sa.Column("reason", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["plan_key"], ["plan.key"], name=op.f("fk_scheduled_send_plan_key_plan")
        ),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_scheduled_send_robot_key_robot")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_scheduled_send")),
        sqlite_autoincrement=True,
    )
    op.create_index(
        op.f("ix_scheduled_send_ended_at"), "scheduled_send", ["ended_at"], unique=False
    )
    op.create_index(
        op.f("ix_scheduled_send_robot_key_key"),
        "scheduled_send",
        ["robot_key", "key"],
        unique=False,
    )


def downgrade() -> None:
    op.drop_index(op.f("ix_scheduled_send_robot_key_key"), table_name="scheduled_send")
    op.drop_index(op.f("ix_scheduled_send_ended_at"), table_name="scheduled_send")
    op.drop_table("scheduled_send")
