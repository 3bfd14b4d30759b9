"""What a station reads of tables of millions of rows: a stretch of time or the newest, never all.

Statements are taken from a real start and from every GET that a page can make, and SQLite is asked
how it would run each. PostgreSQL has the same keys in the same order.
"""

import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import Engine, event

from server.access.role import Role
from tests.server.conftest import GRACE, api_client, open_station
from tests.server.fake_link import World

BIG = (
    *("state_report", "sample", "reading", "raw_frame", "plan_report", "actuator_report"),
    *("smoothed_place", "sample_rollup", "reading_rollup", "state_rollup", "event"),
)
"""Tables that grow with what robots say, by a row a minute of a robot or faster."""
CHANNELS = ("depth_m", "temperature", "internal_pressure")
"""One of the states, one that is sampled, and one that is read."""
_NO_PAGE = ("/api/live", "/export")
"""A stream, and files of all that there is."""
_SIZES = re.compile(
    r"SELECT (count\(\*\)|sum\(\w+_rollup\.size\)) AS \w+\s+FROM \w+(\s+WHERE|\s*$)"
)
"""What ``server/storage`` counts behind the requests now and then, for no page."""
_STEP = re.compile(rf"(SCAN|SEARCH) ({'|'.join(BIG)})\b(.*)")
_BOUND = re.compile(r"\b(measured_at|at|stretch|rowid|cursor|key|sequence)[<>=]")


class Statements:
    """Notes every SELECT that is sent to a database."""

    def __init__(self) -> None:
        self.seen: dict[str, object] = {}

    def note(self, _connection, _cursor, statement, parameters, *_) -> None:
        if statement.lstrip().startswith(("SELECT", "WITH")):
            self.seen.setdefault(statement, parameters)


@contextmanager
def statements() -> Iterator[Statements]:
    noted = Statements()
    event.listen(Engine, "before_cursor_execute", noted.note)
    try:
        yield noted
    finally:
        event.remove(Engine, "before_cursor_execute", noted.note)


def unbounded(connection, statement, parameters) -> list[str]:
    """Return the steps of a statement that read all of a big table, or all that a robot has in it.

    A step is bounded by a range of its key, or because it goes along its key and stops early; of a
    statement that names no order PostgreSQL may look for the first row through all of the table.
    """
    plan = [row[3] for row in connection.execute(f"EXPLAIN QUERY PLAN {statement}", parameters)]
    is_ordered = re.search(r"ORDER BY.*LIMIT", statement, re.DOTALL) is not None
    stops = is_ordered and not any("TEMP B-TREE FOR ORDER" in step for step in plan)
    ends = re.match(r"SELECT (min|max)\([^()]*\)( AS \w+)?\s+FROM", statement) is not None
    return [
        f"{step} of {' '.join(statement.split())}"
        for step in plan
        if (found := _STEP.search(step)) and not (_BOUND.search(found[3]) or stops or ends)
    ]


def addresses(document, known: dict[str, str]) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield every GET of the document whose parameters are known, with what it must be asked."""
    for path, of_path in document["paths"].items():
        names = set(re.findall(r"{(\w+)}", path))
        if "get" not in of_path or not names <= known.keys() or path.endswith(_NO_PAGE):
            continue
        needed = {
            one["name"] for one in of_path["get"].get("parameters", []) if one["in"] == "query"
        }
        for channel in CHANNELS if "channel" in needed else ("",):
            asked = {"channel": channel, "at": known["at"]}
            query = {name: value for name, value in asked.items() if name in needed}
            yield path.format(**known), query


def whole_reads(database, noted: Statements) -> set[str]:
    with closing(sqlite3.connect(database)) as connection:
        return {
            fault
            for statement, parameters in noted.seen.items()
            if not _SIZES.match(statement)
            for fault in unbounded(connection, statement, parameters)
        }


@pytest.mark.timeout(600)
async def test_no_start_and_no_page_reads_a_big_table_as_a_whole(tmp_path):
    with statements() as noted:
        async with (
            open_station(tmp_path, World()) as station,
            api_client(station, Role.ADMIN) as client,
        ):
            at = (datetime.now(UTC) - timedelta(minutes=5)).isoformat()
            listed = (await client.get("/api/deployments")).json()["deployments"]
            known = {"robot": GRACE, "deployment": listed[0]["id"], "kind": "planner", "at": at}
            for path, query in addresses(client.app.openapi(), known):
                answer = await client.get(path, params=query)
                assert answer.status_code < 500, path
    assert len(noted.seen) > 100
    assert whole_reads(tmp_path / "station.sqlite3", noted) == set()
