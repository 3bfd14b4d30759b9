"""Keep measurements in narrow rows, each channel summed up, and readings beside them."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0019"
down_revision: str | None = "0018"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
_PLACE = {"north_m": "north_mm", "east_m": "east_mm", "depth_m": "depth_mm"}
_PLACES = ", ".join((*_PLACE.values(), "position_std_um"))
_METRES = (*_PLACE, "position_std_m")
_PLACE_OF_OLD = ", ".join(
    [
        *(f"CAST(round(old.{name} * 1000) AS INTEGER)" for name in _PLACE),
        "CAST(round(old.position_std_m * 1000000) AS BIGINT)",
    ]
)
_RUNS = """
INSERT INTO sample_run (log_key, first, last)
SELECT log_key, min(sequence), max(sequence) FROM (
  SELECT log_key, sequence,
         sequence - row_number() OVER (PARTITION BY log_key ORDER BY sequence) AS gap
  FROM sample
) AS one GROUP BY log_key, gap
"""
_ROLLUP = """
INSERT INTO sample_rollup (robot_key, channel_key, length_s, stretch, size, least, least_at,
                           greatest, greatest_at)
SELECT robot_key, channel_key, {0}, stretch, count(*), min(value), min(least_at), max(value),
       min(greatest_at) FROM (
  SELECT robot_key, channel_key, stretch, value,
         first_value(measured_at) OVER (
           PARTITION BY robot_key, channel_key, stretch ORDER BY value, measured_at) AS least_at,
         first_value(measured_at) OVER (
           PARTITION BY robot_key, channel_key, stretch ORDER BY value DESC, measured_at
         ) AS greatest_at
  FROM (
    SELECT robot_key, channel_key, value, measured_at,
           (measured_at - ((measured_at % {0}000000) + {0}000000) % {0}000000) / {0}000000
             AS stretch
    FROM sample
  ) AS placed
) AS one GROUP BY robot_key, channel_key, stretch
"""


def upgrade() -> None:
    _lay_out()
    op.execute(
        "INSERT INTO channel (name) SELECT DISTINCT variable FROM field_sample ORDER BY variable"
    )
    op.execute(
        "INSERT INTO sample_log (robot_key, log, received_at) SELECT robot_key, log,"
        " max(received_at) FROM field_sample GROUP BY robot_key, log ORDER BY robot_key, log"
    )
    op.execute(
        "INSERT INTO sample (robot_key, channel_key, measured_at, log_key, sequence, value,"
        f" {_PLACES}) SELECT old.robot_key, channel.key, old.measured_at, sample_log.key,"
        f" old.sequence, old.value, {_PLACE_OF_OLD} FROM field_sample AS old"
        " JOIN channel ON channel.name = old.variable JOIN sample_log"
        " ON sample_log.robot_key = old.robot_key AND sample_log.log = old.log"
        " ORDER BY old.robot_key, channel.key, old.measured_at, sample_log.key, old.sequence"
    )
    op.execute(_RUNS)
    for length_s in (300, 86400):
        op.execute(_ROLLUP.format(length_s))
    op.execute(
        f"INSERT INTO smoothed_place (log_key, sequence, {_PLACES})"
        f" SELECT sample_log.key, old.sequence, {_PLACE_OF_OLD}"
        " FROM smoothed_sample AS old JOIN sample_log"
        " ON sample_log.robot_key = old.robot_key AND sample_log.log = old.log"
        " ORDER BY sample_log.key, old.sequence"
    )
    for table in ("smoothed_sample", "sample_count", "field_sample"):
        op.drop_table(table)


def _place() -> list[sa.Column[int]]:
    whole = [sa.Column(name, sa.Integer(), nullable=False) for name in _PLACE.values()]
    return [*whole, sa.Column("position_std_um", sa.BigInteger(), nullable=False)]


def _foreign(table: str, column: str, other: str) -> sa.ForeignKeyConstraint:
    return sa.ForeignKeyConstraint([column], [other], name=op.f(f"fk_{table}_{column}"))


def _lay_out() -> None:
    op.create_table(
        "channel",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_channel")),
        sa.UniqueConstraint("name", name=op.f("uq_channel_name")),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "sample_log",
        sa.Column("key", _KEY, nullable=False),
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("log", sa.BigInteger(), nullable=False),
        sa.Column("received_at", db.column.Utc(), nullable=False),
        _foreign("sample_log", "robot_key", "robot.key"),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_sample_log")),
        sa.UniqueConstraint("robot_key", "log", name=op.f("uq_sample_log_robot_key_log")),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "sample_run",
        sa.Column("log_key", _KEY, nullable=False),
        sa.Column("first", sa.BigInteger(), nullable=False),
        sa.Column("last", sa.BigInteger(), nullable=False),
        _foreign("sample_run", "log_key", "sample_log.key"),
        sa.PrimaryKeyConstraint("log_key", "first", name=op.f("pk_sample_run")),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "sample",
        *_of_channel("sample"),
        sa.Column("measured_at", db.column.Utc(), nullable=False),
        sa.Column("log_key", _KEY, nullable=False),
        sa.Column("sequence", sa.BigInteger(), nullable=False),
        sa.Column("value", sa.Double(), nullable=False),
        *_place(),
        _foreign("sample", "log_key", "sample_log.key"),
        sa.PrimaryKeyConstraint(
            "robot_key",
            "channel_key",
            "measured_at",
            "log_key",
            "sequence",
            name=op.f("pk_sample"),
        ),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "reading",
        *_of_channel("reading"),
        sa.Column("measured_at", db.column.Utc(), nullable=False),
        sa.Column("value", sa.Double(), nullable=False),
        sa.PrimaryKeyConstraint("robot_key", "channel_key", "measured_at", name=op.f("pk_reading")),
        sqlite_with_rowid=False,
    )
    for table in ("sample_rollup", "reading_rollup"):
        op.create_table(
            table,
            *_of_channel(table),
            sa.Column("length_s", sa.Integer(), nullable=False),
            sa.Column("stretch", sa.BigInteger(), nullable=False),
            sa.Column("size", sa.BigInteger(), nullable=False),
            sa.Column("least", sa.Double(), nullable=False),
            sa.Column("least_at", db.column.Utc(), nullable=False),
            sa.Column("greatest", sa.Double(), nullable=False),
            sa.Column("greatest_at", db.column.Utc(), nullable=False),
            sa.PrimaryKeyConstraint(
                "robot_key", "channel_key", "length_s", "stretch", name=op.f(f"pk_{table}")
            ),
            sqlite_with_rowid=False,
        )
    op.create_table(
        "smoothed_place",
        sa.Column("log_key", _KEY, nullable=False),
        sa.Column("sequence", sa.BigInteger(), nullable=False),
        *_place(),
        _foreign("smoothed_place", "log_key", "sample_log.key"),
        sa.PrimaryKeyConstraint("log_key", "sequence", name=op.f("pk_smoothed_place")),
        sqlite_with_rowid=False,
    )


def _of_channel(table: str) -> list[sa.schema.SchemaItem]:
    return [
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("channel_key", _KEY, nullable=False),
        _foreign(table, "robot_key", "robot.key"),
        _foreign(table, "channel_key", "channel.key"),
    ]


def downgrade() -> None:
    """Make the tables of before again; a sample counts as received when its log's newest was."""
    op.create_table(
        "field_sample",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("log", sa.BigInteger(), nullable=False),
        sa.Column("sequence", sa.BigInteger(), nullable=False),
        sa.Column("variable", sa.String(), nullable=False),
        sa.Column("measured_at", db.column.Utc(), nullable=False),
        sa.Column("received_at", db.column.Utc(), nullable=False),
        *(sa.Column(name, sa.Double(), nullable=False) for name in ("value", *_METRES)),
        _foreign("field_sample", "robot_key", "robot.key"),
        sa.PrimaryKeyConstraint("robot_key", "log", "sequence", name=op.f("pk_field_sample")),
        sqlite_with_rowid=False,
    )
    op.create_index(
        op.f("ix_field_sample_robot_key_variable_measured_at_value"),
        "field_sample",
        ["robot_key", "variable", "measured_at", "value"],
    )
    op.create_table(
        "sample_count",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("variable", sa.String(), nullable=False),
        sa.Column("deployment_key", sa.BigInteger(), nullable=False),
        sa.Column("samples", sa.BigInteger(), nullable=False),
        _foreign("sample_count", "robot_key", "robot.key"),
        sa.PrimaryKeyConstraint(
            "robot_key", "variable", "deployment_key", name=op.f("pk_sample_count_2")
        ),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "smoothed_sample",
        sa.Column("robot_key", _KEY, nullable=False),
        sa.Column("log", sa.BigInteger(), nullable=False),
        sa.Column("sequence", sa.BigInteger(), nullable=False),
        *(sa.Column(name, sa.Double(), nullable=False) for name in _METRES),
        sa.ForeignKeyConstraint(
            ["robot_key", "log", "sequence"],
            ["field_sample.robot_key", "field_sample.log", "field_sample.sequence"],
            name=op.f("fk_smoothed_sample_robot_key_log_sequence"),
        ),
        sa.PrimaryKeyConstraint("robot_key", "log", "sequence", name=op.f("pk_smoothed_sample")),
        sqlite_with_rowid=False,
    )
    columns = ", ".join(_METRES)
    metres = ", ".join([*(f"{one} / 1000.0" for one in _PLACE.values()), "position_std_um / 1e6"])
    log = "JOIN sample_log ON sample_log.key = log_key"
    op.execute(
        "INSERT INTO field_sample (robot_key, log, sequence, variable, measured_at, received_at,"
        f" value, {columns}) SELECT sample.robot_key, log, sequence, channel.name, measured_at,"
        f" received_at, value, {metres} FROM sample {log}"
        " JOIN channel ON channel.key = channel_key"
    )
    op.execute(
        "INSERT INTO sample_count (robot_key, variable, deployment_key, samples) "
        "SELECT robot_key, variable, deployment_key, count(*) FROM ("
        "SELECT robot_key, variable, coalesce((SELECT max(deployment.key) FROM deployment "
        "WHERE deployment.robot_key = field_sample.robot_key AND kind = 'live' "
        "AND void_reason = '' AND started_at <= measured_at "
        "AND (ended_at IS NULL OR measured_at < ended_at)), 0) AS deployment_key "
        "FROM field_sample) AS one GROUP BY robot_key, variable, deployment_key"
    )
    op.execute(
        f"INSERT INTO smoothed_sample (robot_key, log, sequence, {columns})"
        f" SELECT robot_key, log, sequence, {metres} FROM smoothed_place {log}"
    )
    for table in (
        "smoothed_place",
        "reading_rollup",
        "sample_rollup",
        "reading",
        "sample",
        "sample_run",
        "sample_log",
        "channel",
    ):
        op.drop_table(table)
