"""Keep checklists: templates, runs and ticks."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0027"
down_revision: str | None = "0026"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def _key() -> sa.BigInteger:
    return sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "checklist_template",
        sa.Column("key", _key(), nullable=False),
        sa.Column("template", sa.String(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=True),
        sa.Column("saved_at", db.column.Utc(), nullable=False),
        sa.Column("saved_by", sa.String(), nullable=False),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_checklist_template")),
        sqlite_autoincrement=True,
    )
    op.create_index(
        op.f("ix_checklist_template_template_version"),
        "checklist_template",
        ["template", "version"],
        unique=True,
    )
    op.create_table(
        "checklist_run",
        sa.Column("key", _key(), nullable=False),
        sa.Column("robot_key", _key(), nullable=False),
        sa.Column("deployment_key", _key(), nullable=True),
        sa.Column("template", sa.String(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("begun_at", db.column.Utc(), nullable=False),
        sa.Column("begun_by", sa.String(), nullable=False),
        sa.Column("expires_at", db.column.Utc(), nullable=True),
        sa.Column("ended_at", db.column.Utc(), nullable=True),
        sa.Column("settled_at", db.column.Utc(), nullable=True),
        sa.Column("settled_by", sa.String(), nullable=False),
        sa.Column("reason", sa.String(), nullable=False),
        sa.Column("found", sa.JSON(), nullable=False),
        sa.ForeignKeyConstraint(
            ["deployment_key"],
            ["deployment.key"],
            name=op.f("fk_checklist_run_deployment_key_deployment"),
        ),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_checklist_run_robot_key_robot")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_checklist_run")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_checklist_run_ended_at"), "checklist_run", ["ended_at"], unique=False)
    op.create_index(
        op.f("ix_checklist_run_robot_key_key"),
        "checklist_run",
        ["robot_key", "key"],
        unique=False,
    )
    op.create_table(
        "checklist_tick",
        sa.Column("key", _key(), nullable=False),
        sa.Column("run_key", _key(), nullable=False),
        sa.Column("item", sa.String(), nullable=False),
        sa.Column("is_ticked", sa.Boolean(), nullable=False),
        sa.Column("at", db.column.Utc(), nullable=False),
        sa.Column("by", sa.String(), nullable=False),
        sa.Column("note", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["run_key"], ["checklist_run.key"], name=op.f("fk_checklist_tick_run_key_checklist_run")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_checklist_tick")),
        sqlite_autoincrement=True,
    )
    op.create_index(
        op.f("ix_checklist_tick_run_key_key"), "checklist_tick", ["run_key", "key"], unique=False
    )


def downgrade() -> None:
    op.drop_index(op.f("ix_checklist_tick_run_key_key"), table_name="checklist_tick")
    op.drop_table("checklist_tick")
    op.drop_index(op.f("ix_checklist_run_robot_key_key"), table_name="checklist_run")
    op.drop_index(op.f("ix_checklist_run_ended_at"), table_name="checklist_run")
    op.drop_table("checklist_run")
    op.drop_index(op.f("ix_checklist_template_template_version"), table_name="checklist_template")
    op.drop_table("checklist_template")
