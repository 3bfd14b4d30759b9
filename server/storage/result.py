"""What jobs over what is kept leave."""

from typing_extensions import TypedDict

from db.query.storage.prunable import PRUNABLE
from server.storage.preview import Preview
from server.storage.pruning import PassResult


class StoragePassResult(TypedDict):
    """What a pass did: rows by kind of data."""

    message: str
    thinned: dict[str, int]
    moved: dict[str, int]
    deleted: dict[str, int]
    files: int
    longest_ms: float
    """The longest transaction that others had to wait for."""


class GoingRows(TypedDict):
    """Rows of a kind, of a robot and deployment, that would go."""

    kind: str
    title: str
    robot: str
    """"" where rows of all robots lie together."""
    deployment: str
    """"" of what is outside of any."""
    rows: int
    bytes: int


class StayingRows(TypedDict):
    """A deployment that is old enough and stays all the same."""

    robot: str
    deployment: str
    because: str


class StoragePreviewResult(TypedDict):
    """What would go by some rules, and what would stay."""

    message: str
    rows: int
    bytes: int
    going: list[GoingRows]
    staying: list[StayingRows]


def pass_result(done: PassResult) -> StoragePassResult:
    """Return what a pass did."""
    return {
        "message": done.sentence(),
        "thinned": dict(done.thinned),
        "moved": dict(done.moved),
        "deleted": dict(done.deleted),
        "files": done.files,
        "longest_ms": round(1e3 * done.longest_s, 1),
    }


def preview_result(found: Preview) -> StoragePreviewResult:
    """Return what would go."""
    return {
        "message": f"{found.rows} rows would go." if found.rows else "Nothing would go.",
        "rows": found.rows,
        "bytes": found.bytes,
        "going": [
            {
                "kind": one.kind,
                "title": PRUNABLE[one.kind].title,
                "robot": one.robot,
                "deployment": one.deployment,
                "rows": one.rows,
                "bytes": one.bytes,
            }
            for one in sorted(found.going, key=lambda one: -one.bytes)
        ],
        "staying": [
            {"robot": one.robot, "deployment": one.deployment, "because": one.because}
            for one in found.staying
        ],
    }
