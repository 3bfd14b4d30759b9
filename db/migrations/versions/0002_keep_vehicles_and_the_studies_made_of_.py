"""Keep vehicles and the studies made of them."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0002"
down_revision: str | None = "0001"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "vehicle",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("title", sa.String(), nullable=False),
        sa.Column("note", sa.String(), nullable=False),
        sa.Column("origin", sa.String(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_vehicle")),
        sa.UniqueConstraint("id", name=op.f("uq_vehicle_id")),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "whatif",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("job_key", _KEY, nullable=True),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("title", sa.String(), nullable=False),
        sa.Column("vehicle", sa.String(), nullable=False),
        sa.Column("scenario", sa.JSON(), nullable=False),
        sa.Column("controllers", sa.JSON(), nullable=False),
        sa.Column("message", sa.String(), nullable=False),
        sa.Column("result", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("shown_from", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("ended_at", db.column.Utc(), nullable=True),
        sa.ForeignKeyConstraint(["job_key"], ["job.key"], name=op.f("fk_whatif_job_key")),
        sa.ForeignKeyConstraint(["robot_key"], ["robot.key"], name=op.f("fk_whatif_robot_key")),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_whatif")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_whatif_robot_key_key"), "whatif", ["robot_key", "key"])
    op.create_index(op.f("ix_whatif_state"), "whatif", ["state"])

    op.create_table(
        "identification",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("deployment_key", _KEY, nullable=False),
        sa.Column("job_key", _KEY, nullable=True),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("vehicle", sa.String(), nullable=False),
        sa.Column("vehicle_document", sa.JSON(), nullable=False),
        sa.Column("config", sa.JSON(), nullable=False),
        sa.Column("data_start_at", db.column.Utc(), nullable=False),
        sa.Column("data_end_at", db.column.Utc(), nullable=False),
        sa.Column("progress", sa.Double(), nullable=False),
        sa.Column("message", sa.String(), nullable=False),
        sa.Column("convergence", sa.JSON(), nullable=False),
        sa.Column("checkpoint", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("result", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("accepted_vehicle", sa.String(), nullable=True),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("ended_at", db.column.Utc(), nullable=True),
        sa.ForeignKeyConstraint(
            ["deployment_key"], ["deployment.key"], name=op.f("fk_identification_deployment_key")
        ),
        sa.ForeignKeyConstraint(["job_key"], ["job.key"], name=op.f("fk_identification_job_key")),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_identification_robot_key")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_identification")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_identification_robot_key_key"), "identification", ["robot_key", "key"])
    op.create_index(op.f("ix_identification_state"), "identification", ["state"])

    op.create_table(
        "trim_advice",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("deployment_key", _KEY, nullable=False),
        sa.Column("trim_version", sa.String(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("accepted_at", db.column.Utc(), nullable=True),
        sa.Column("accepted_by", sa.String(), nullable=True),
        sa.Column("accepted_share", sa.Double(), nullable=True),
        sa.ForeignKeyConstraint(
            ["deployment_key"], ["deployment.key"], name=op.f("fk_trim_advice_deployment_key")
        ),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_trim_advice_robot_key")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_trim_advice")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_trim_advice_robot_key_key"), "trim_advice", ["robot_key", "key"])


def downgrade() -> None:
    for table in ("trim_advice", "identification", "whatif", "vehicle"):
        op.drop_table(table)
