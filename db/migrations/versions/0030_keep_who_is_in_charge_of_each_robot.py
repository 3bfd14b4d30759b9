"""Keep who is in charge of each robot."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0030"
down_revision: str | None = "0029"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def _key() -> sa.BigInteger:
    return sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "lease",
        sa.Column("key", _key(), nullable=False),
        sa.Column("robot_key", _key(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("holder", sa.String(), nullable=True),
        sa.Column("holder_kind", sa.String(), nullable=True),
        sa.Column("holder_token", sa.String(), nullable=True),
        sa.Column("since", db.column.Utc(), nullable=True),
        sa.Column("reason", sa.String(), nullable=False),
        sa.Column("requested_by", sa.String(), nullable=True),
        sa.Column("requested_at", db.column.Utc(), nullable=True),
        sa.Column("request_note", sa.String(), nullable=False),
        sa.Column("script", sa.String(), nullable=True),
        sa.Column("script_token", sa.String(), nullable=True),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_lease_robot_key_robot")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_lease")),
        sa.UniqueConstraint("robot_key", name=op.f("uq_lease_robot_key")),
        sqlite_autoincrement=True,
    )


def downgrade() -> None:
    op.drop_table("lease")
