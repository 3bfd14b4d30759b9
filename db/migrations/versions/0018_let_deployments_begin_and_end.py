"""Let deployments begin and end, and robots retire."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0018"
down_revision: str | None = "0017"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.add_column("robot", sa.Column("retired_at", db.column.Utc(), nullable=True))
    op.add_column("robot", sa.Column("former_system_id", sa.Integer(), nullable=True))
    _widen_deployments()
    _count_by_deployment()


def _widen_deployments() -> None:
    for column in (
        sa.Column("state", sa.String(), nullable=False, server_default="in_water"),
        sa.Column("purpose", sa.String(), nullable=False, server_default=""),
        sa.Column("people", sa.JSON(), nullable=False, server_default="[]"),
        sa.Column("site", sa.JSON(), nullable=False, server_default="{}"),
        sa.Column("void_reason", sa.String(), nullable=False, server_default=""),
    ):
        op.add_column("deployment", column)
    op.execute("UPDATE deployment SET state = 'recovered' WHERE kind <> 'live'")
    op.execute(
        "UPDATE deployment SET site = (SELECT robot.site FROM robot "
        "WHERE robot.key = deployment.robot_key) WHERE kind <> 'live'"
    )
    with op.batch_alter_table(
        "deployment", table_kwargs={"sqlite_autoincrement": True}
    ) as deployment:
        deployment.alter_column("started_at", existing_type=db.column.Utc(), nullable=True)
        for name in ("state", "purpose", "people", "site", "void_reason"):
            deployment.alter_column(name, server_default=None)


def _count_by_deployment() -> None:
    op.rename_table("sample_count", "old_sample_count")
    _make_counts(sa.Column("deployment_key", sa.BigInteger(), nullable=False), "_2")
    op.execute(
        "INSERT INTO sample_count (robot_key, variable, deployment_key, samples) "
        "SELECT old.robot_key, old.variable, "
        "CASE WHEN old.is_live THEN coalesce((SELECT max(deployment.key) FROM deployment "
        "WHERE deployment.robot_key = old.robot_key AND deployment.kind = 'live'), 0) "
        "ELSE 0 END, old.samples FROM old_sample_count AS old"
    )
    op.drop_table("old_sample_count")


def downgrade() -> None:
    """Forget what was planned, why deployments were made, and who retired."""
    _count_by_life()
    op.execute("DELETE FROM deployment WHERE started_at IS NULL")
    with op.batch_alter_table(
        "deployment", table_kwargs={"sqlite_autoincrement": True}
    ) as deployment:
        deployment.alter_column("started_at", existing_type=db.column.Utc(), nullable=False)
        for name in ("state", "purpose", "people", "site", "void_reason"):
            deployment.drop_column(name)
    op.drop_column("robot", "former_system_id")
    op.drop_column("robot", "retired_at")


def _count_by_life() -> None:
    op.rename_table("sample_count", "new_sample_count")
    _make_counts(sa.Column("is_live", sa.Boolean(), nullable=False), "")
    op.execute(
        "INSERT INTO sample_count (robot_key, variable, is_live, samples) "
        "SELECT robot_key, variable, is_live, sum(samples) FROM ("
        "SELECT robot_key, variable, deployment_key <> 0 AS is_live, samples "
        "FROM new_sample_count) AS one GROUP BY robot_key, variable, is_live"
    )
    op.drop_table("new_sample_count")


def _make_counts(by: sa.Column, suffix: str) -> None:
    """Make the table of counts; names of constraints must differ from those of the other one."""
    op.create_table(
        "sample_count",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("variable", sa.String(), nullable=False),
        by,
        sa.Column("samples", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f(f"fk_sample_count_robot_key{suffix}")
        ),
        sa.PrimaryKeyConstraint(
            "robot_key", "variable", by.name, name=op.f(f"pk_sample_count{suffix}")
        ),
        sqlite_with_rowid=False,
    )
