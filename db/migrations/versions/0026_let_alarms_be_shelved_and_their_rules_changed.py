"""Let alarms be shelved, noted and assigned, and people change their rules."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0026"
down_revision: str | None = "0025"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_ADDED = ("rule", "action", "count", "first_raised_at", "note", "noted_by", "assigned_to",
          "shelved_until", "shelved_by")  # fmt: skip


def _key() -> sa.BigInteger:
    return sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    with op.batch_alter_table("alarm", table_kwargs={"sqlite_autoincrement": True}) as alarm:
        alarm.add_column(sa.Column("rule", sa.String(), nullable=True))
        alarm.add_column(sa.Column("action", sa.String(), nullable=False, server_default=""))
        alarm.add_column(sa.Column("count", sa.Integer(), nullable=False, server_default="1"))
        alarm.add_column(sa.Column("first_raised_at", db.column.Utc(), nullable=True))
        alarm.add_column(sa.Column("note", sa.String(), nullable=False, server_default=""))
        alarm.add_column(sa.Column("noted_by", sa.String(), nullable=True))
        alarm.add_column(sa.Column("assigned_to", sa.String(), nullable=True))
        alarm.add_column(sa.Column("shelved_until", db.column.Utc(), nullable=True))
        alarm.add_column(sa.Column("shelved_by", sa.String(), nullable=True))
    with op.batch_alter_table("alarm", table_kwargs={"sqlite_autoincrement": True}) as alarm:
        alarm.alter_column("action", existing_type=sa.String(), server_default=None)
        alarm.alter_column("count", existing_type=sa.Integer(), server_default=None)
        alarm.alter_column("note", existing_type=sa.String(), server_default=None)
    op.create_index(op.f("ix_alarm_rule"), "alarm", ["rule"])
    op.create_table(
        "alarm_rule_version",
        sa.Column("key", _key(), nullable=False),
        sa.Column("rule", sa.String(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=True),
        sa.Column("changed_at", db.column.Utc(), nullable=False),
        sa.Column("changed_by", sa.String(), nullable=False),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_alarm_rule_version")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_alarm_rule_version_rule"), "alarm_rule_version", ["rule"])
    op.create_table(
        "alarm_out_of_service",
        sa.Column("key", _key(), nullable=False),
        sa.Column("rule", sa.String(), nullable=False),
        sa.Column("robot_key", _key(), nullable=True),
        sa.Column("reason", sa.String(), nullable=False),
        sa.Column("begun_at", db.column.Utc(), nullable=False),
        sa.Column("begun_by", sa.String(), nullable=False),
        sa.Column("ended_at", db.column.Utc(), nullable=True),
        sa.Column("ended_by", sa.String(), nullable=True),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_alarm_out_of_service_robot_key_robot")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_alarm_out_of_service")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_alarm_out_of_service_ended_at"), "alarm_out_of_service", ["ended_at"])


def downgrade() -> None:
    op.drop_table("alarm_out_of_service")
    op.drop_table("alarm_rule_version")
    op.drop_index(op.f("ix_alarm_rule"), table_name="alarm")
    op.execute("UPDATE alarm SET state = 'unacknowledged' WHERE state IN "
               "('shelved', 'suppressed', 'out_of_service')")  # fmt: skip
    op.execute("UPDATE alarm SET level = 'warning' WHERE level = 'severe'")
    op.execute("UPDATE alarm SET level = 'watch' WHERE level = 'info'")
    with op.batch_alter_table("alarm", table_kwargs={"sqlite_autoincrement": True}) as alarm:
        for name in _ADDED:
            alarm.drop_column(name)
