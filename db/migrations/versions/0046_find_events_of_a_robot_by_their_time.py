"""Find the events of a robot by their time."""

from collections.abc import Sequence

from alembic import op

revision: str = "0046"
down_revision: str | None = "0045"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.create_index(op.f("ix_event_robot_key_at"), "event", ["robot_key", "at"])


def downgrade() -> None:
    op.drop_index(op.f("ix_event_robot_key_at"), table_name="event")
