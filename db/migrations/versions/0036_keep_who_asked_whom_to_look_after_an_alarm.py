"""Keep who asked whom to look after an alarm, and to whom alone a notice goes."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0036"
down_revision: str | None = "0035"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column("alarm", sa.Column("assigned_by", sa.String(), nullable=True))
    op.add_column("notice_case", sa.Column("person", sa.String(), nullable=True))


def downgrade() -> None:
    """Forget what one person alone was to be told: it would be told to everyone."""
    told = "SELECT key FROM notice_case WHERE person IS NOT NULL"
    op.execute(f"DELETE FROM notice_item WHERE case_key IN ({told})")
    op.execute("DELETE FROM notice_case WHERE person IS NOT NULL")
    op.drop_column("notice_case", "person")
    op.drop_column("alarm", "assigned_by")
