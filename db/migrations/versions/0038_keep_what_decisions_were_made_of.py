"""Keep what decisions were made of, and what came of them."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0038"
down_revision: str | None = "0037"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def _key() -> sa.BigInteger:
    return sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "decision",
        sa.Column("key", _key(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("robot_key", _key(), nullable=False),
        sa.Column("about", sa.String(), nullable=False),
        sa.Column("at", db.column.Utc(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("input_sha256", sa.String(), nullable=False),
        sa.Column("map_sha256", sa.String(), nullable=False),
        sa.Column("outcome_sha256", sa.String(), nullable=True),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_decision_robot_key_robot")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_decision")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_decision_robot_key_at"), "decision", ["robot_key", "at"])
    op.create_index(op.f("ix_decision_at"), "decision", ["at"])
    op.create_table(
        "decision_content",
        sa.Column("sha256", sa.LargeBinary(32), nullable=False),
        sa.Column("deflated", sa.LargeBinary(), nullable=False),
        sa.PrimaryKeyConstraint("sha256", name=op.f("pk_decision_content")),
    )


def downgrade() -> None:
    op.drop_table("decision_content")
    op.drop_table("decision")
