"""Sum up what robots report of themselves, so that charts of months need not read it all."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0045"
down_revision: str | None = "0044"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "state_rollup",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("channel", sa.String(), nullable=False),
        sa.Column("length_s", sa.Integer(), nullable=False),
        sa.Column("stretch", sa.BigInteger(), nullable=False),
        sa.Column("size", sa.BigInteger(), nullable=False),
        sa.Column("least", sa.Double(), nullable=False),
        sa.Column("least_at", db.column.Utc(), nullable=False),
        sa.Column("greatest", sa.Double(), nullable=False),
        sa.Column("greatest_at", db.column.Utc(), nullable=False),
        sa.ForeignKeyConstraint(["robot_key"], ["robot.key"], name="fk_state_rollup_robot_key"),
        sa.PrimaryKeyConstraint(
            "robot_key", "channel", "length_s", "stretch", name="pk_state_rollup"
        ),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "state_summed",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("until", db.column.Utc(), nullable=False),
        sa.ForeignKeyConstraint(["robot_key"], ["robot.key"], name="fk_state_summed_robot_key"),
        sa.PrimaryKeyConstraint("robot_key", name="pk_state_summed"),
        sqlite_with_rowid=False,
    )


def downgrade() -> None:
    op.drop_table("state_summed")
    op.drop_table("state_rollup")
