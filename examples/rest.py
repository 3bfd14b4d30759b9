"""What the scripts beside this file share: reading and posting by REST. Needs only httpx."""

import sys
import time
import uuid

import httpx


def get(station: httpx.Client, path: str, **query: object) -> dict:
    """Read a resource; wait for a station that restarts."""
    for _ in range(60):
        try:
            return station.get(path, params=query or None).raise_for_status().json()
        except httpx.TransportError:
            time.sleep(1.0)
    sys.exit(f"the station at {station.base_url} does not answer")


def post(station: httpx.Client, path: str, body: dict | None = None) -> dict:
    """Post once, whatever the network does: the key makes a repetition harmless."""
    key = {"Idempotency-Key": str(uuid.uuid4())}
    answer = station.post(path, json=body or {}, headers=key)
    if answer.is_error:
        problem = answer.json()
        reasons = [f"{one['loc']}: {one['msg']}" for one in problem.get("errors") or ()]
        sys.exit("\n".join([f"{path}: {problem.get('detail', answer.text)}", *reasons]))
    return answer.json()
