"""Keep which channels robots announced."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0020"
down_revision: str | None = "0019"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.create_table(
        "robot_channel",
        sa.Column(
            "robot_key", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False
        ),
        sa.Column("log", sa.BigInteger(), nullable=False),
        sa.Column("sequence", sa.BigInteger(), nullable=False),
        sa.Column("version", sa.BigInteger(), nullable=False),
        sa.Column("since_at", db.column.Utc(), nullable=False),
        sa.Column("heard_at", db.column.Utc(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_robot_channel_robot_key_robot")
        ),
        sa.PrimaryKeyConstraint("robot_key", "log", "sequence", name=op.f("pk_robot_channel")),
        sqlite_with_rowid=False,
    )


def downgrade() -> None:
    op.drop_table("robot_channel")
