"""Keep after how many attempts a service may have a notice without having said so."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0032"
down_revision: str | None = "0031"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column(
        "notice", sa.Column("unanswered", sa.Integer(), nullable=False, server_default="0")
    )


def downgrade() -> None:
    op.drop_column("notice", "unanswered")
