"""Keep the tags of animals that robots hear, and how their receivers fare."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0016"
down_revision: str | None = "0015"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
_PLACE = ("north_m", "east_m", "depth_m", "position_std_m")
_COUNTS = ("receiver", "heard", "refused_sum", "refused_date", "refused_code")


def upgrade() -> None:
    op.create_table(
        "detection",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("measured_at", db.column.Utc(), nullable=False),
        sa.Column("tag", sa.String(), nullable=False),
        sa.Column("receiver", sa.String(), nullable=False),
        sa.Column("received_at", db.column.Utc(), nullable=False),
        sa.Column("sensor", sa.Double(), nullable=True),
        sa.Column("sensor_unit", sa.String(), nullable=True),
        *(sa.Column(name, sa.Double(), nullable=True) for name in _PLACE),
        sa.Column("tag_name", sa.String(), nullable=True),
        sa.Column("tag_serial", sa.String(), nullable=True),
        sa.Column("station", sa.String(), nullable=True),
        sa.ForeignKeyConstraint(["robot_key"], ["robot.key"], name=op.f("fk_detection_robot_key")),
        sa.PrimaryKeyConstraint(
            "robot_key", "measured_at", "tag", "receiver", name=op.f("pk_detection")
        ),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "receiver_report",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("measured_at", db.column.Utc(), nullable=False),
        sa.Column("received_at", db.column.Utc(), nullable=False),
        *(sa.Column(name, sa.BigInteger(), nullable=False) for name in _COUNTS),
        sa.Column("clock_offset_s", sa.Double(), nullable=True),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_receiver_report_robot_key")
        ),
        sa.PrimaryKeyConstraint("robot_key", "measured_at", name=op.f("pk_receiver_report")),
        sqlite_with_rowid=False,
    )


def downgrade() -> None:
    op.drop_table("receiver_report")
    op.drop_table("detection")
