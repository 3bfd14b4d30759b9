"""Keep what requests with a key made, and what jobs work for."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0047"
down_revision: str | None = "0046"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column("job", sa.Column("about", sa.String(), nullable=True))
    op.add_column("idempotency", sa.Column("made", sa.String(), nullable=True))
    op.add_column(
        "idempotency",
        sa.Column("has_acted", sa.Boolean(), server_default=sa.true(), nullable=False),
    )


def downgrade() -> None:
    op.drop_column("idempotency", "has_acted")
    op.drop_column("idempotency", "made")
    op.drop_column("job", "about")
