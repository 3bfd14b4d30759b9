"""Keep cameras, the tags that they look for, their calibrations and their fixes."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0042"
down_revision: str | None = "0041"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "tag_set",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("layout", sa.JSON(), nullable=False),
        sa.Column("bundles", sa.JSON(), nullable=False),
        sa.Column("at", db.column.Utc(), nullable=False),
        sa.Column("by", sa.String(), nullable=False),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_tag_set")),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "camera_calibration",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("camera_key", _KEY, nullable=True),
        sa.Column("tag_set_key", _KEY, nullable=True),
        sa.Column("result", sa.JSON(), nullable=False),
        sa.Column("covariance", sa.LargeBinary(), nullable=False),
        sa.Column("inputs", sa.JSON(), nullable=False),
        sa.Column("at", db.column.Utc(), nullable=False),
        sa.Column("by", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["tag_set_key"], ["tag_set.key"], name=op.f("fk_camera_calibration_tag_set_key_tag_set")
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_camera_calibration")),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "camera",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("uri", sa.String(), nullable=False),
        sa.Column("latency_s", sa.Double(), nullable=True),
        sa.Column("latency_std_s", sa.Double(), nullable=True),
        sa.Column("lens_key", _KEY, nullable=True),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("changed_at", db.column.Utc(), nullable=False),
        sa.ForeignKeyConstraint(
            ["lens_key"],
            ["camera_calibration.key"],
            name=op.f("fk_camera_lens_key_camera_calibration"),
        ),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_camera")),
        sa.UniqueConstraint("id", name=op.f("uq_camera_id")),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "camera_fix",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("measured_at", db.column.Utc(), nullable=False),
        sa.Column("received_at", db.column.Utc(), nullable=False),
        sa.Column("north_m", sa.Double(), nullable=False),
        sa.Column("east_m", sa.Double(), nullable=False),
        sa.Column("depth_m", sa.Double(), nullable=False),
        sa.Column("covariance_m2", sa.JSON(), nullable=False),
        sa.Column("considered_covariance_m2", sa.JSON(), nullable=False),
        sa.Column("heading_rad", sa.Double(), nullable=True),
        sa.Column("heading_std_rad", sa.Double(), nullable=False),
        sa.Column("roll_rad", sa.Double(), nullable=True),
        sa.Column("pitch_rad", sa.Double(), nullable=True),
        sa.Column("tilt_std_rad", sa.Double(), nullable=False),
        sa.Column("cameras", sa.JSON(), nullable=False),
        sa.Column("tags", sa.JSON(), nullable=False),
        sa.Column("rms", sa.Double(), nullable=False),
        sa.Column("quality", sa.String(), nullable=False),
        sa.Column("reason", sa.String(), nullable=False),
        sa.Column("calibration_key", _KEY, nullable=True),
        sa.Column("sent_at", db.column.Utc(), nullable=True),
        sa.ForeignKeyConstraint(
            ["calibration_key"],
            ["camera_calibration.key"],
            name=op.f("fk_camera_fix_calibration_key_camera_calibration"),
        ),
        sa.ForeignKeyConstraint(
            ["robot_key"], ["robot.key"], name=op.f("fk_camera_fix_robot_key_robot")
        ),
        sa.PrimaryKeyConstraint("robot_key", "measured_at", name=op.f("pk_camera_fix")),
        sqlite_with_rowid=False,
    )


def downgrade() -> None:
    op.drop_table("camera_fix")
    op.drop_table("camera")
    op.drop_table("camera_calibration")
    op.drop_table("tag_set")
