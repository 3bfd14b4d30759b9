"""Lay out the station's memory."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0001"
down_revision: str | None = None
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "idempotency",
        sa.Column("caller", sa.String(), nullable=False),
        sa.Column("request_key", sa.String(), nullable=False),
        sa.Column("fingerprint", sa.String(), nullable=False),
        sa.Column("status", sa.Integer(), nullable=True),
        sa.Column("body", sa.LargeBinary(), nullable=True),
        sa.Column("at", db.column.Utc(), nullable=False),
        sa.PrimaryKeyConstraint("caller", "request_key", name=op.f("pk_idempotency")),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "job",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("progress", sa.Double(), nullable=False),
        sa.Column("message", sa.String(), nullable=False),
        sa.Column("result", sa.JSON(), nullable=True),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("ended_at", db.column.Utc(), nullable=True),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_job")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_job_state"), "job", ["state"])

    op.create_table(
        "person",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("role", sa.String(), nullable=False),
        sa.Column("password_hash", sa.String(), nullable=True),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("disabled_at", db.column.Utc(), nullable=True),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_person")),
        sa.UniqueConstraint("name", name=op.f("uq_person_name")),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "robot",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("model", sa.String(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("system_id", sa.Integer(), nullable=True),
        sa.Column("links", sa.JSON(), nullable=False),
        sa.Column("site", sa.JSON(), nullable=False),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_robot")),
        sa.UniqueConstraint("id", name=op.f("uq_robot_id")),
        sa.UniqueConstraint("system_id", name=op.f("uq_robot_system_id")),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "setting",
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("value", sa.JSON(), nullable=False),
        sa.PrimaryKeyConstraint("name", name=op.f("pk_setting")),
    )
    op.create_table(
        "alarm",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("cause", sa.String(), nullable=False),
        sa.Column("robot_key", _KEY, nullable=True),
        sa.Column("level", sa.String(), nullable=False),
        sa.Column("text", sa.String(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("raised_at", db.column.Utc(), nullable=False),
        sa.Column("acknowledged_at", db.column.Utc(), nullable=True),
        sa.Column("acknowledged_by", sa.String(), nullable=True),
        sa.Column("cleared_at", db.column.Utc(), nullable=True),
        sa.ForeignKeyConstraint(["robot_key"], ["robot.key"], name=op.f("fk_alarm_robot_key")),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_alarm")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_alarm_state"), "alarm", ["state"])

    op.create_table(
        "command",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("plan_sha256", sa.String(), nullable=True),
        sa.Column("level", sa.String(), nullable=False),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("expires_at", db.column.Utc(), nullable=False),
        sa.ForeignKeyConstraint(["robot_key"], ["robot.key"], name=op.f("fk_command_robot_key")),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_command")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_command_level"), "command", ["level"])
    op.create_index(op.f("ix_command_robot_key_key"), "command", ["robot_key", "key"])

    op.create_table(
        "configuration",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("robot_key", _KEY, nullable=True),
        sa.Column("value", sa.JSON(), nullable=False),
        sa.Column("changed_at", db.column.Utc(), nullable=False),
        sa.Column("changed_by", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_configuration_robot_key")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_configuration")),
        sqlite_autoincrement=True,
    )
    op.create_index(
        op.f("ix_configuration_kind_robot_key_key"), "configuration", ["kind", "robot_key", "key"]
    )

    op.create_table(
        "deployment",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("title", sa.String(), nullable=False),
        sa.Column("log", sa.BigInteger(), nullable=True),
        sa.Column("started_at", db.column.Utc(), nullable=False),
        sa.Column("ended_at", db.column.Utc(), nullable=True),
        sa.Column("rows", sa.Integer(), nullable=False),
        sa.Column("variables", sa.JSON(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.ForeignKeyConstraint(["robot_key"], ["robot.key"], name=op.f("fk_deployment_robot_key")),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_deployment")),
        sa.UniqueConstraint("robot_key", "log", name=op.f("uq_deployment_robot_key_log")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_deployment_robot_key_key"), "deployment", ["robot_key", "key"])

    op.create_table(
        "event",
        sa.Column("cursor", _KEY, nullable=False),
        sa.Column("at", db.column.Utc(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("level", sa.String(), nullable=False),
        sa.Column("robot_key", _KEY, nullable=True),
        sa.Column("text", sa.String(), nullable=False),
        sa.Column("data", sa.JSON(), nullable=False),
        sa.ForeignKeyConstraint(["robot_key"], ["robot.key"], name=op.f("fk_event_robot_key")),
        sa.PrimaryKeyConstraint("cursor", name=op.f("pk_event")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_event_robot_key_cursor"), "event", ["robot_key", "cursor"])

    op.create_table(
        "field_sample",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("log", sa.BigInteger(), nullable=False),
        sa.Column("sequence", sa.BigInteger(), nullable=False),
        sa.Column("variable", sa.String(), nullable=False),
        sa.Column("measured_at", db.column.Utc(), nullable=False),
        sa.Column("received_at", db.column.Utc(), nullable=False),
        sa.Column("value", sa.Double(), nullable=False),
        sa.Column("north_m", sa.Double(), nullable=False),
        sa.Column("east_m", sa.Double(), nullable=False),
        sa.Column("depth_m", sa.Double(), nullable=False),
        sa.Column("position_std_m", sa.Double(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_field_sample_robot_key")
        ),
        sa.PrimaryKeyConstraint("robot_key", "log", "sequence", name=op.f("pk_field_sample")),
        sqlite_with_rowid=False,
    )
    op.create_index(
        op.f("ix_field_sample_robot_key_variable_measured_at_value"),
        "field_sample",
        ["robot_key", "variable", "measured_at", "value"],
    )

    op.create_table(
        "map_snapshot",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("variable", sa.String(), nullable=False),
        sa.Column("model", sa.String(), nullable=False),
        sa.Column("at", db.column.Utc(), nullable=False),
        sa.Column("samples", sa.Integer(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("grid", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_map_snapshot_robot_key")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_map_snapshot")),
        sqlite_autoincrement=True,
    )
    op.create_index(
        op.f("ix_map_snapshot_robot_key_variable_model_key"),
        "map_snapshot",
        ["robot_key", "variable", "model", "key"],
    )

    op.create_table(
        "mission",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("automation", sa.Boolean(), nullable=False),
        sa.Column("config", sa.JSON(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(["robot_key"], ["robot.key"], name=op.f("fk_mission_robot_key")),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_mission")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_mission_robot_key_key"), "mission", ["robot_key", "key"])
    op.create_index(op.f("ix_mission_state"), "mission", ["state"])

    op.create_table(
        "plan_report",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("measured_at", db.column.Utc(), nullable=False),
        sa.Column("received_at", db.column.Utc(), nullable=False),
        sa.Column("sha256", sa.String(), nullable=True),
        sa.Column("state", sa.Integer(), nullable=False),
        sa.Column("leg", sa.Integer(), nullable=False),
        sa.Column("legs", sa.Integer(), nullable=False),
        sa.Column("energy_used", sa.Double(), nullable=False),
        sa.Column("reason", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_plan_report_robot_key")
        ),
        sa.PrimaryKeyConstraint("robot_key", "measured_at", name=op.f("pk_plan_report")),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "raw_frame",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("robot_key", _KEY, nullable=True),
        sa.Column("at", db.column.Utc(), nullable=False),
        sa.Column("carrier", sa.String(), nullable=False),
        sa.Column("outgoing", sa.Boolean(), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(["robot_key"], ["robot.key"], name=op.f("fk_raw_frame_robot_key")),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_raw_frame")),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "session",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("secret_hash", sa.String(), nullable=False),
        sa.Column("csrf_token", sa.String(), nullable=False),
        sa.Column("person_key", _KEY, nullable=False),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("expires_at", db.column.Utc(), nullable=False),
        sa.ForeignKeyConstraint(["person_key"], ["person.key"], name=op.f("fk_session_person_key")),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_session")),
        sa.UniqueConstraint("secret_hash", name=op.f("uq_session_secret_hash")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_session_person_key"), "session", ["person_key"])

    op.create_table(
        "state_report",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("measured_at", db.column.Utc(), nullable=False),
        sa.Column("received_at", db.column.Utc(), nullable=False),
        sa.Column("north_m", sa.Double(), nullable=False),
        sa.Column("east_m", sa.Double(), nullable=False),
        sa.Column("depth_m", sa.Double(), nullable=False),
        sa.Column("position_std_m", sa.Double(), nullable=False),
        sa.Column("has_fix", sa.Boolean(), nullable=False),
        sa.Column("velocity_north_m_s", sa.Double(), nullable=True),
        sa.Column("velocity_east_m_s", sa.Double(), nullable=True),
        sa.Column("velocity_down_m_s", sa.Double(), nullable=True),
        sa.Column("roll_rad", sa.Double(), nullable=True),
        sa.Column("pitch_rad", sa.Double(), nullable=True),
        sa.Column("heading_rad", sa.Double(), nullable=True),
        sa.Column("net_buoyancy_kg", sa.Double(), nullable=True),
        sa.Column("mass_position_m", sa.Double(), nullable=True),
        sa.Column("tail_rad", sa.Double(), nullable=True),
        sa.Column("battery_fraction", sa.Double(), nullable=True),
        sa.Column("battery_v", sa.Double(), nullable=True),
        sa.Column("energy_used", sa.Double(), nullable=True),
        sa.Column("mode", sa.Integer(), nullable=True),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_state_report_robot_key")
        ),
        sa.PrimaryKeyConstraint("robot_key", "measured_at", name=op.f("pk_state_report")),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "token",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("secret_hash", sa.String(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("role", sa.String(), nullable=False),
        sa.Column("person_key", _KEY, nullable=True),
        sa.Column("one_time", sa.Boolean(), nullable=False),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("expires_at", db.column.Utc(), nullable=False),
        sa.Column("used_at", db.column.Utc(), nullable=True),
        sa.Column("revoked_at", db.column.Utc(), nullable=True),
        sa.ForeignKeyConstraint(["person_key"], ["person.key"], name=op.f("fk_token_person_key")),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_token")),
        sa.UniqueConstraint("secret_hash", name=op.f("uq_token_secret_hash")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_token_person_key"), "token", ["person_key"])

    op.create_table(
        "command_level",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("command_key", _KEY, nullable=False),
        sa.Column("level", sa.String(), nullable=False),
        sa.Column("at", db.column.Utc(), nullable=False),
        sa.Column("carrier", sa.String(), nullable=False),
        sa.Column("reason", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["command_key"], ["command.key"], name=op.f("fk_command_level_command_key")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_command_level")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_command_level_command_key"), "command_level", ["command_key"])

    op.create_table(
        "plan",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("mission_key", _KEY, nullable=True),
        sa.Column("round", sa.Integer(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("sha256", sa.String(), nullable=True),
        sa.Column("config", sa.JSON(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("draft_at", db.column.Utc(), nullable=True),
        sa.Column("sent_at", db.column.Utc(), nullable=True),
        sa.Column("on_board_at", db.column.Utc(), nullable=True),
        sa.Column("running_at", db.column.Utc(), nullable=True),
        sa.Column("ended_at", db.column.Utc(), nullable=True),
        sa.ForeignKeyConstraint(["mission_key"], ["mission.key"], name=op.f("fk_plan_mission_key")),
        sa.ForeignKeyConstraint(["robot_key"], ["robot.key"], name=op.f("fk_plan_robot_key")),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_plan")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_plan_mission_key"), "plan", ["mission_key"])
    op.create_index(op.f("ix_plan_robot_key_key"), "plan", ["robot_key", "key"])
    op.create_index(op.f("ix_plan_robot_key_sha256"), "plan", ["robot_key", "sha256"])
    op.create_index(op.f("ix_plan_state"), "plan", ["state"])

    op.create_table(
        "transfer",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("plan_key", _KEY, nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("level", sa.String(), nullable=False),
        sa.Column("items", sa.Integer(), nullable=False),
        sa.Column("items_sent", sa.Integer(), nullable=False),
        sa.Column("bytes", sa.Integer(), nullable=False),
        sa.Column("start", sa.Boolean(), nullable=False),
        sa.Column("started_at", db.column.Utc(), nullable=False),
        sa.Column("ended_at", db.column.Utc(), nullable=True),
        sa.Column("reason", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(["plan_key"], ["plan.key"], name=op.f("fk_transfer_plan_key")),
        sa.ForeignKeyConstraint(["robot_key"], ["robot.key"], name=op.f("fk_transfer_robot_key")),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_transfer")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_transfer_robot_key_key"), "transfer", ["robot_key", "key"])


def downgrade() -> None:
    for table in (
        "transfer",
        "plan",
        "command_level",
        "token",
        "state_report",
        "session",
        "raw_frame",
        "plan_report",
        "mission",
        "map_snapshot",
        "field_sample",
        "event",
        "deployment",
        "configuration",
        "command",
        "alarm",
        "setting",
        "robot",
        "person",
        "job",
        "idempotency",
    ):
        op.drop_table(table)
