"""Keep all studies in one table."""

from collections.abc import Callable, Sequence
from typing import Any

import sqlalchemy as sa
from alembic import op

import db.column

revision: str = "0008"
down_revision: str | None = "0007"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

_KEY = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
_ABSENT = sa.JSON(none_as_null=True)
_NAMES = sa.MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "fk": "fk_%(table_name)s_%(column_0_N_name)s",
        "pk": "pk_%(table_name)s",
    }
)
Row = dict[str, Any]


def _robot() -> sa.Column[int]:
    return sa.Column("robot_key", _KEY, sa.ForeignKey("robot.key"), nullable=False)


def _table(name: str, *columns: sa.Column[Any]) -> sa.Table:
    """Return a table whose rows somebody asked for about a robot."""
    return sa.Table(
        name,
        _NAMES,
        sa.Column("key", _KEY, primary_key=True),
        _robot(),
        *columns,
        sa.Column("created_at", db.column.Utc(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sqlite_autoincrement=True,
    )


def _running(*columns: sa.Column[Any]) -> tuple[sa.Column[Any], ...]:
    """Return the columns of what takes its time and ends."""
    return (
        sa.Column("job_key", _KEY, sa.ForeignKey("job.key")),
        sa.Column("state", sa.String(), nullable=False, index=True),
        sa.Column("message", sa.String(), nullable=False),
        *columns,
        sa.Column("result", _ABSENT),
        sa.Column("ended_at", db.column.Utc()),
    )


def _deployment() -> sa.Column[int]:
    return sa.Column("deployment_key", _KEY, sa.ForeignKey("deployment.key"), nullable=False)


for _other in ("robot", "job", "deployment"):
    sa.Table(_other, _NAMES, sa.Column("key", _KEY, primary_key=True))

STUDY = _table(
    "study",
    *_running(
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("asked", sa.JSON(), nullable=False),
        sa.Column("news", sa.JSON(), nullable=False),
        sa.Column("use", _ABSENT),
        sa.Column("checkpoint", _ABSENT),
        sa.Column("arrays", sa.LargeBinary()),
    ),
)
STUDY.append_constraint(sa.UniqueConstraint("kind", "number"))
sa.Index(None, STUDY.c.robot_key, STUDY.c.kind, STUDY.c.number)

WHATIF = _table(
    "whatif",
    *_running(
        sa.Column("title", sa.String(), nullable=False),
        sa.Column("vehicle", sa.String(), nullable=False),
        sa.Column("scenario", sa.JSON(), nullable=False),
        sa.Column("controllers", sa.JSON(), nullable=False),
        sa.Column("shown_from", _ABSENT),
    ),
)
IDENTIFICATION = _table(
    "identification",
    *_running(
        _deployment(),
        sa.Column("vehicle", sa.String(), nullable=False),
        sa.Column("vehicle_document", sa.JSON(), nullable=False),
        sa.Column("config", sa.JSON(), nullable=False),
        sa.Column("data_start_at", db.column.Utc(), nullable=False),
        sa.Column("data_end_at", db.column.Utc(), nullable=False),
        sa.Column("progress", sa.Double(), nullable=False),
        sa.Column("convergence", sa.JSON(), nullable=False),
        sa.Column("checkpoint", _ABSENT),
        sa.Column("accepted_vehicle", sa.String()),
    ),
)
TRIM_ADVICE = _table(
    "trim_advice",
    _deployment(),
    sa.Column("trim_version", sa.String(), nullable=False),
    sa.Column("document", sa.JSON(), nullable=False),
    sa.Column("accepted_at", db.column.Utc()),
    sa.Column("accepted_by", sa.String()),
    sa.Column("accepted_share", sa.Double()),
)
MAP_COMPARISON = sa.Table(
    "map_comparison",
    _NAMES,
    sa.Column("robot_key", _KEY, sa.ForeignKey("robot.key"), primary_key=True),
    sa.Column("variable", sa.String(), primary_key=True),
    sa.Column("at", db.column.Utc(), nullable=False),
    sa.Column("document", sa.JSON(), nullable=False),
    sa.Column("grid", sa.LargeBinary(), nullable=False),
    sqlite_with_rowid=False,
)
for _index in (WHATIF, IDENTIFICATION, TRIM_ADVICE):
    sa.Index(None, _index.c.robot_key, _index.c.key)


def _whatif(row: Row) -> Row:
    return {
        **{name: row[name] for name in ("job_key", "state", "message", "result", "ended_at")},
        "asked": {name: row[name] for name in ("title", "vehicle", "scenario", "controllers")},
        "use": row["shown_from"],
    }


def _identification(row: Row) -> Row:
    vehicle = row["accepted_vehicle"]
    kept = ("job_key", "state", "message", "result", "checkpoint", "ended_at")
    return {
        **{name: row[name] for name in kept},
        "asked": {
            "deployment": f"deployment-{row['deployment_key']}",
            "base_vehicle": row["vehicle"],
            "vehicle_document": row["vehicle_document"],
            "config": row["config"],
            "data_start_at": row["data_start_at"].isoformat(),
            "data_end_at": row["data_end_at"].isoformat(),
        },
        "news": {name: row[name] for name in ("progress", "convergence")},
        "use": None if vehicle is None else {"vehicle": vehicle},
    }


def _advice(row: Row) -> Row:
    document, at = row["document"], row["accepted_at"]
    about = {name: document[name] for name in _ADVICE if name in document}
    took = {"accepted_by": row["accepted_by"], "accepted_share": row["accepted_share"]}
    return {
        "asked": {
            "deployment": f"deployment-{row['deployment_key']}",
            "trim_version": row["trim_version"],
            **about,
        },
        "use": None if at is None else {"accepted_at": at.isoformat(), **took},
        "result": {name: value for name, value in document.items() if name not in about},
        "ended_at": row["created_at"],
    }


_ADVICE = ("vehicle", "vehicle_digest", "identification")


def _comparison(row: Row) -> Row:
    return {
        "asked": {"variable": row["variable"]},
        "result": row["document"],
        "arrays": row["grid"],
        "created_at": row["at"],
        "created_by": "",
        "ended_at": row["at"],
    }


def upgrade() -> None:
    connection = op.get_bind()
    STUDY.create(connection)
    _carry(connection, WHATIF, "whatif", _whatif)
    _carry(connection, IDENTIFICATION, "identification", _identification)
    _carry(connection, TRIM_ADVICE, "advice", _advice)
    _carry(connection, MAP_COMPARISON, "comparison", _comparison)


def _carry(
    connection: sa.Connection, table: sa.Table, kind: str, carried: Callable[[Row], Row]
) -> None:
    """Move the rows of a table into the one of all studies; their ids stay."""
    keys = connection.execute(sa.select(*table.primary_key)).all()
    for number, key in enumerate(keys, 1):
        named = zip(table.primary_key, key, strict=True)
        found = connection.execute(
            sa.select(table).where(*(column == one for column, one in named))
        )
        row = dict(found.mappings().one())
        defaults = {"state": "done", "message": "", "news": {}, "number": row.get("key", number)}
        common = {
            name: row[name] for name in ("robot_key", "created_at", "created_by") if name in row
        }
        values = {**defaults, **common, "kind": kind, **carried(row)}
        connection.execute(STUDY.insert().values(values))
    table.drop(connection)


def downgrade() -> None:
    """Make the tables of before again, empty."""
    connection = op.get_bind()
    STUDY.drop(connection)
    for table in (WHATIF, IDENTIFICATION, TRIM_ADVICE, MAP_COMPARISON):
        table.create(connection)
