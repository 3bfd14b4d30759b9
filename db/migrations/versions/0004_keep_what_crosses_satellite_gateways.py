"""Keep what crosses satellite gateways, ranges, and the route of each transfer."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0004"
down_revision: str | None = "0003"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.create_table(
        "inbox",
        sa.Column("key", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("robot_key", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=True),
        sa.Column("carrier", sa.String(), nullable=False),
        sa.Column("imei", sa.String(), nullable=False),
        sa.Column("momsn", sa.Integer(), nullable=False),
        sa.Column("mtmsn", sa.Integer(), nullable=True),
        sa.Column("session_at", db.column.Utc(), nullable=False),
        sa.Column("arrived_at", db.column.Utc(), nullable=False),
        sa.Column("session_status", sa.Integer(), nullable=False),
        sa.Column("latitude_deg", sa.Double(), nullable=True),
        sa.Column("longitude_deg", sa.Double(), nullable=True),
        sa.Column("cep_km", sa.Double(), nullable=True),
        sa.Column("sha256", sa.String(), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
        sa.Column("deliveries", sa.Integer(), nullable=False),
        sa.Column("is_decoded", sa.Boolean(), nullable=False),
        sa.Column("handled_at", db.column.Utc(), nullable=True),
        sa.Column("text", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(["robot_key"], ["robot.key"], name=op.f("fk_inbox_robot_key")),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_inbox")),
        sa.UniqueConstraint(
            "imei",
            "momsn",
            "session_at",
            "sha256",
            name=op.f("uq_inbox_imei_momsn_session_at_sha256"),
        ),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_inbox_handled_at"), "inbox", ["handled_at"])
    op.create_index(op.f("ix_inbox_robot_key_key"), "inbox", ["robot_key", "key"])

    op.create_table(
        "range_measurement",
        sa.Column("key", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column(
            "robot_key", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False
        ),
        sa.Column("peer", sa.Integer(), nullable=False),
        sa.Column("at", db.column.Utc(), nullable=False),
        sa.Column("travel_time_s", sa.Double(), nullable=True),
        sa.Column("range_m", sa.Double(), nullable=True),
        sa.Column("is_valid", sa.Boolean(), nullable=False),
        sa.Column("reason", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_range_measurement_robot_key")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_range_measurement")),
        sqlite_autoincrement=True,
    )
    op.create_index(
        op.f("ix_range_measurement_robot_key_at"), "range_measurement", ["robot_key", "at"]
    )

    op.create_table(
        "outbox",
        sa.Column("key", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column(
            "robot_key", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False
        ),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column(
            "transfer_key", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=True
        ),
        sa.Column(
            "command_key", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=True
        ),
        sa.Column("carrier", sa.String(), nullable=False),
        sa.Column("imei", sa.String(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("level", sa.String(), nullable=False),
        sa.Column("counter", sa.BigInteger(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("expires_at", db.column.Utc(), nullable=False),
        sa.Column("ended_at", db.column.Utc(), nullable=True),
        sa.Column("reason", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["command_key"], ["command.key"], name=op.f("fk_outbox_command_key")
        ),
        sa.ForeignKeyConstraint(["robot_key"], ["robot.key"], name=op.f("fk_outbox_robot_key")),
        sa.ForeignKeyConstraint(
            ["transfer_key"], ["transfer.key"], name=op.f("fk_outbox_transfer_key")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_outbox")),
        sa.UniqueConstraint("command_key", "imei", name=op.f("uq_outbox_command_key_imei")),
        sa.UniqueConstraint("transfer_key", name=op.f("uq_outbox_transfer_key")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_outbox_ended_at"), "outbox", ["ended_at"])
    op.create_index(op.f("ix_outbox_robot_key_key"), "outbox", ["robot_key", "key"])

    op.create_table(
        "satellite_message",
        sa.Column("key", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column(
            "robot_key", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False
        ),
        sa.Column(
            "outbox_key", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False
        ),
        sa.Column("part", sa.Integer(), nullable=False),
        sa.Column("carrier", sa.String(), nullable=False),
        sa.Column("imei", sa.String(), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
        sa.Column("credits", sa.Integer(), nullable=False),
        sa.Column("flush", sa.Boolean(), nullable=False),
        sa.Column("priority", sa.Integer(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("attempts", sa.Integer(), nullable=False),
        sa.Column("message_id", sa.String(), nullable=False),
        sa.Column("mtmsn", sa.Integer(), nullable=True),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("retry_at", db.column.Utc(), nullable=True),
        sa.Column("queued_at", db.column.Utc(), nullable=True),
        sa.Column("radio_at", db.column.Utc(), nullable=True),
        sa.Column("text", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["outbox_key"], ["outbox.key"], name=op.f("fk_satellite_message_outbox_key")
        ),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_satellite_message_robot_key")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_satellite_message")),
        sqlite_autoincrement=True,
    )
    op.create_index(
        op.f("ix_satellite_message_outbox_key_key"), "satellite_message", ["outbox_key", "key"]
    )
    op.create_index(
        op.f("ix_satellite_message_robot_key_created_at"),
        "satellite_message",
        ["robot_key", "created_at"],
    )
    op.create_index(op.f("ix_satellite_message_state"), "satellite_message", ["state"])

    op.add_column(
        "transfer", sa.Column("route", sa.String(), server_default="auto", nullable=False)
    )
    op.add_column("transfer", sa.Column("carrier", sa.String(), server_default="", nullable=False))
    op.add_column(
        "transfer", sa.Column("is_forced", sa.Boolean(), server_default=sa.false(), nullable=False)
    )


def downgrade() -> None:
    for column in ("is_forced", "carrier", "route"):
        op.drop_column("transfer", column)
    for table in ("satellite_message", "outbox", "range_measurement", "inbox"):
        op.drop_table(table)
