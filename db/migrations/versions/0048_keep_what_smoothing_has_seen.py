"""Keep from when on smoothing has not seen the samples of a log."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0048"
down_revision: str | None = "0047"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column("sample_log", sa.Column("unsmoothed_from", sa.BigInteger(), nullable=True))
    columns = {
        "sample": ("log_key", "sequence", "measured_at"),
        "smoothed_place": ("log_key", "sequence"),
        "sample_log": ("key", "unsmoothed_from"),
    }
    sample, smoothed, log = (
        sa.table(name, *(sa.column(one) for one in of)) for name, of in columns.items()
    )
    is_same = sa.and_(
        smoothed.c.log_key == sample.c.log_key, smoothed.c.sequence == sample.c.sequence
    )
    bind = op.get_bind()
    unseen = bind.execute(
        sa.select(sample.c.log_key, sa.func.min(sample.c.measured_at))
        .select_from(sample.outerjoin(smoothed, is_same))
        .where(smoothed.c.sequence.is_(None))
        .group_by(sample.c.log_key)
    ).all()
    for key, first in unseen:
        bind.execute(sa.update(log).where(log.c.key == key).values(unsmoothed_from=first))


def downgrade() -> None:
    op.drop_column("sample_log", "unsmoothed_from")
