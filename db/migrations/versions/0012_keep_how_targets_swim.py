"""Keep how targets swim, whether they are too fast to follow, and how late their ranges are."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0012"
down_revision: str | None = "0011"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column(
        "track_report",
        sa.Column("is_too_fast", sa.Boolean(), server_default=sa.false(), nullable=False),
    )
    op.add_column("track_report", sa.Column("speed_class", sa.Integer(), nullable=True))
    op.add_column("track_report", sa.Column("delay_s", sa.Double(), nullable=True))


def downgrade() -> None:
    for name in ("delay_s", "speed_class", "is_too_fast"):
        op.drop_column("track_report", name)
