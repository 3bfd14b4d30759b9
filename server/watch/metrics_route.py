"""``/metrics``: the station's figures, for Prometheus."""

from fastapi import APIRouter, Response

from server.access.dependency import ViewerOrThisMachine
from server.base.dependency import FoundationDep
from server.base.metric.metrics import MEDIA_TYPE

router = APIRouter(tags=["station"])


@router.get(
    "/metrics",
    response_class=Response,
    responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}},
)
async def get_metrics(caller: ViewerOrThisMachine, foundation: FoundationDep) -> Response:
    """Return how the station is, in the text format of Prometheus.

    A bearer token of a viewer of all robots is enough. With `GRACE_METRICS_ON_LOOPBACK` whoever
    asks from this machine needs none.
    """
    del caller
    return Response(await foundation.metrics.text(foundation.store), media_type=MEDIA_TYPE)
