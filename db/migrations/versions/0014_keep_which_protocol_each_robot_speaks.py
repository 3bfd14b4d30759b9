"""Keep which protocol each robot speaks, and states of vehicles that know no place."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0014"
down_revision: str | None = "0013"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_PLACE = ("north_m", "east_m", "depth_m")


def upgrade() -> None:
    op.add_column(
        "robot", sa.Column("protocol", sa.String(), nullable=False, server_default="grace")
    )
    _let_place_be_unknown(is_nullable=True)


def downgrade() -> None:
    op.execute("DELETE FROM state_report WHERE north_m IS NULL OR depth_m IS NULL")
    _let_place_be_unknown(is_nullable=False)
    op.drop_column("robot", "protocol")


def _let_place_be_unknown(*, is_nullable: bool) -> None:
    with op.batch_alter_table("state_report", table_kwargs={"sqlite_with_rowid": False}) as batch:
        for name in _PLACE:
            batch.alter_column(name, existing_type=sa.Double(), nullable=is_nullable)
