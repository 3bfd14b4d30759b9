"""Keep the clocks of robot and gateway with each packet of the journal."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0005"
down_revision: str | None = "0004"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column("raw_frame", sa.Column("robot_at", db.column.Utc(), nullable=True))
    op.add_column("raw_frame", sa.Column("arrived_at", db.column.Utc(), nullable=True))
    op.create_index(op.f("ix_raw_frame_at"), "raw_frame", ["at"])


def downgrade() -> None:
    op.drop_index(op.f("ix_raw_frame_at"), "raw_frame")
    op.drop_column("raw_frame", "arrived_at")
    op.drop_column("raw_frame", "robot_at")
