"""Keep what runs of quality rules saw, so that what came later is not called good."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0041"
down_revision: str | None = "0040"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column("quality_run", sa.Column("samples", sa.BigInteger(), nullable=True))
    op.add_column("quality_run", sa.Column("seen", sa.LargeBinary(), nullable=True))


def downgrade() -> None:
    op.drop_column("quality_run", "seen")
    op.drop_column("quality_run", "samples")
