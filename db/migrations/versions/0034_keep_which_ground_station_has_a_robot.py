"""Keep which other ground station is in charge of a robot, or asks for it.

Whoever held a robot before was a person or a script, and stays that.
"""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0034"
down_revision: str | None = "0033"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_COLUMNS = ("holder_system", "requested_system")


def upgrade() -> None:
    for column in _COLUMNS:
        op.add_column("lease", sa.Column(column, sa.Integer(), nullable=True))


def downgrade() -> None:
    """Free robots that another ground station holds, and forget which asks for one."""
    op.execute(
        "UPDATE lease SET state = 'free', holder = NULL, holder_kind = NULL, since = NULL"
        " WHERE holder_kind = 'station'"
    )
    op.execute(
        "UPDATE lease SET state = 'held', requested_by = NULL, requested_at = NULL"
        " WHERE requested_system IS NOT NULL"
    )
    for column in _COLUMNS:
        op.drop_column("lease", column)
