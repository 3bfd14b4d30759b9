"""Keep parameters and logs of robots ashore."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0006"
down_revision: str | None = "0005"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "robot_parameter",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("place", sa.Integer(), nullable=False),
        sa.Column("value", sa.Double(), nullable=False),
        sa.Column("type", sa.String(), nullable=False),
        sa.Column("read_at", db.column.Utc(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_robot_parameter_robot_key")
        ),
        sa.PrimaryKeyConstraint("robot_key", "name", name=op.f("pk_robot_parameter")),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "robot_log",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("path", sa.String(), nullable=False),
        sa.Column("size", sa.Integer(), nullable=False),
        sa.Column("listed_at", db.column.Utc(), nullable=False),
        sa.Column("fetched_size", sa.Integer(), nullable=True),
        sa.Column("sha256", sa.String(), nullable=True),
        sa.Column("fetched_at", db.column.Utc(), nullable=True),
        sa.ForeignKeyConstraint(["robot_key"], ["robot.key"], name=op.f("fk_robot_log_robot_key")),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_robot_log")),
        sa.UniqueConstraint("robot_key", "path", name=op.f("uq_robot_log_robot_key_path")),
        sqlite_autoincrement=True,
    )


def downgrade() -> None:
    for table in ("robot_log", "robot_parameter"):
        op.drop_table(table)
