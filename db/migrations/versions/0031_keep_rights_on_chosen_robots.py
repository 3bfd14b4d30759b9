"""Keep rights on chosen robots, groups of robots, read-only links and identities elsewhere.

Everybody keeps the role that they have, which goes on to hold for all robots.
"""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0031"
down_revision: str | None = "0030"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def _key() -> sa.BigInteger:
    return sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def _reference(table: str, column: str, to: str) -> sa.ForeignKeyConstraint:
    return sa.ForeignKeyConstraint([column], [f"{to}.key"], name=op.f(f"fk_{table}_{column}_{to}"))


def upgrade() -> None:
    _make_groups()
    _make_grants()
    op.create_table(
        "person_identity",
        sa.Column("key", _key(), nullable=False),
        sa.Column("person_key", _key(), nullable=False),
        sa.Column("issuer", sa.String(), nullable=False),
        sa.Column("subject", sa.String(), nullable=False),
        _reference("person_identity", "person_key", "person"),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_person_identity")),
        sa.UniqueConstraint("issuer", "subject", name=op.f("uq_person_identity_issuer_subject")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_person_identity_person_key"), "person_identity", ["person_key"])
    op.add_column(
        "token", sa.Column("is_link", sa.Boolean(), nullable=False, server_default=sa.false())
    )
    op.add_column("job", sa.Column("robot", sa.String(), nullable=True))
    with op.batch_alter_table("session", table_kwargs={"sqlite_autoincrement": True}) as session:
        session.alter_column("person_key", existing_type=_key(), nullable=True)
        session.add_column(sa.Column("token_key", _key(), nullable=True))
        session.add_column(sa.Column("address", sa.String(), nullable=False, server_default=""))
        session.add_column(sa.Column("browser", sa.String(), nullable=False, server_default=""))
        session.add_column(sa.Column("seen_at", db.column.Utc(), nullable=True))
        session.create_foreign_key(
            op.f("fk_session_token_key_token"), "token", ["token_key"], ["key"]
        )
    with op.batch_alter_table("session", table_kwargs={"sqlite_autoincrement": True}) as session:
        session.alter_column("address", server_default=None)
        session.alter_column("browser", server_default=None)
    op.create_index(op.f("ix_session_token_key"), "session", ["token_key"])


def _make_groups() -> None:
    op.create_table(
        "robot_group",
        sa.Column("key", _key(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_robot_group")),
        sa.UniqueConstraint("name", name=op.f("uq_robot_group_name")),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "robot_group_member",
        sa.Column("group_key", _key(), nullable=False),
        sa.Column("robot_key", _key(), nullable=False),
        _reference("robot_group_member", "group_key", "robot_group"),
        _reference("robot_group_member", "robot_key", "robot"),
        sa.PrimaryKeyConstraint("group_key", "robot_key", name=op.f("pk_robot_group_member")),
        sqlite_with_rowid=False,
    )


def _make_grants() -> None:
    op.create_table(
        "robot_grant",
        sa.Column("key", _key(), nullable=False),
        sa.Column("person_key", _key(), nullable=True),
        sa.Column("token_key", _key(), nullable=True),
        sa.Column("robot_key", _key(), nullable=True),
        sa.Column("group_key", _key(), nullable=True),
        sa.Column("role", sa.String(), nullable=False),
        _reference("robot_grant", "person_key", "person"),
        _reference("robot_grant", "token_key", "token"),
        _reference("robot_grant", "robot_key", "robot"),
        _reference("robot_grant", "group_key", "robot_group"),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_robot_grant")),
        sqlite_autoincrement=True,
    )
    for column in ("person_key", "token_key"):
        op.create_index(op.f(f"ix_robot_grant_{column}"), "robot_grant", [column])


def downgrade() -> None:
    """Forget rights on chosen robots, and end what lived by them alone."""
    op.drop_index(op.f("ix_session_token_key"), "session")
    op.execute("DELETE FROM session WHERE person_key IS NULL")
    with op.batch_alter_table("session", table_kwargs={"sqlite_autoincrement": True}) as session:
        session.drop_constraint(op.f("fk_session_token_key_token"), type_="foreignkey")
        for column in ("token_key", "address", "browser", "seen_at"):
            session.drop_column(column)
        session.alter_column("person_key", existing_type=_key(), nullable=False)
    op.drop_column("job", "robot")
    op.drop_table("robot_grant")
    op.drop_table("robot_group_member")
    op.drop_table("robot_group")
    op.drop_table("person_identity")
    op.execute("DELETE FROM token WHERE is_link")
    op.drop_column("token", "is_link")
