"""Keep designs of missions, their steps, versions and templates."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0021"
down_revision: str | None = "0020"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "design",
        sa.Column("key", KEY, nullable=False),
        sa.Column("robot_key", KEY, nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("water", sa.String(), nullable=True),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.Column("cursor", sa.Integer(), nullable=False),
        sa.Column("is_archived", sa.Boolean(), server_default=sa.false(), nullable=False),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("changed_at", db.column.Utc(), nullable=False),
        sa.Column("changed_by", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_design_robot_key_robot")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_design")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_design_robot_key_key"), "design", ["robot_key", "key"])
    op.create_table(
        "design_step",
        sa.Column("design_key", KEY, nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("what", sa.String(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("changed_at", db.column.Utc(), nullable=False),
        sa.Column("changed_by", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["design_key"], ["design.key"], name=op.f("fk_design_step_design_key_design")
        ),
        sa.PrimaryKeyConstraint("design_key", "number", name=op.f("pk_design_step")),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "design_version",
        sa.Column("design_key", KEY, nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("comment", sa.String(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("saved_at", db.column.Utc(), nullable=False),
        sa.Column("saved_by", sa.String(), nullable=False),
        sa.Column("plan_key", KEY, nullable=True),
        sa.ForeignKeyConstraint(
            ["design_key"], ["design.key"], name=op.f("fk_design_version_design_key_design")
        ),
        sa.ForeignKeyConstraint(
            ["plan_key"], ["plan.key"], name=op.f("fk_design_version_plan_key_plan")
        ),
        sa.PrimaryKeyConstraint("design_key", "number", name=op.f("pk_design_version")),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "design_template",
        sa.Column("key", KEY, nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("parameters", sa.JSON(), nullable=False),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("is_archived", sa.Boolean(), server_default=sa.false(), nullable=False),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_design_template")),
        sqlite_autoincrement=True,
    )


def downgrade() -> None:
    op.drop_table("design_template")
    op.drop_table("design_version")
    op.drop_table("design_step")
    op.drop_index(op.f("ix_design_robot_key_key"), table_name="design")
    op.drop_table("design")
