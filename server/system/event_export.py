"""The event log as lines of JSON, so that others can hold its chain against a hash of their own."""

import json
from collections.abc import Generator

from db.query.station.event_chain import hashed_rows
from db.store import Store


def blocks(store: Store) -> Generator[bytes]:
    """Return the lines of the log, the oldest first; `hashed` is what was hashed, as text."""
    with store.read() as session:
        for row, hashed in hashed_rows(session):
            told = {
                "cursor": row.cursor,
                "at": row.at.isoformat(),
                "kind": row.kind,
                "by": row.actor,
                "text": row.text,
                "hashed": hashed,
                "hash": row.hash.hex(),
            }
            yield json.dumps(told).encode() + b"\n"
