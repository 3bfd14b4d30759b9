"""Keep what robots say of how their actuators follow."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0013"
down_revision: str | None = "0012"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
_FOLLOWING = ("rate_share", "rate_std_octaves", "delay_s", "delay_std_s")


def _following(actuator: str) -> list[sa.Column]:
    told = [sa.Column(f"{actuator}_{name}", sa.Double(), nullable=False) for name in _FOLLOWING]
    return [*told, sa.Column(f"{actuator}_learned_age_s", sa.Double(), nullable=True)]


def upgrade() -> None:
    op.create_table(
        "actuator_report",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("measured_at", db.column.Utc(), nullable=False),
        sa.Column("received_at", db.column.Utc(), nullable=False),
        *_following("mass"),
        *_following("pump"),
        sa.Column("speed_share", sa.Double(), nullable=False),
        sa.Column("is_mass_off", sa.Boolean(), nullable=False),
        sa.Column("is_swinging", sa.Boolean(), nullable=False),
        sa.Column("stuck", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_actuator_report_robot_key")
        ),
        sa.PrimaryKeyConstraint("robot_key", "measured_at", name=op.f("pk_actuator_report")),
        sqlite_with_rowid=False,
    )


def downgrade() -> None:
    op.drop_table("actuator_report")
