"""Where a robot should be, what it will do by itself, and how good predictions of it were."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query

from server.access.dependency import Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.prediction.outlook import Outlook
from server.prediction.view import JudgedPredictionsView, PredictionView

router = APIRouter(prefix="/api/robots/{robot}", tags=["robots"], route_class=IdempotentRoute)

OutlookDep = Annotated[Outlook, Depends(service(Outlook))]


@router.get("/prediction")
async def get_prediction(caller: Viewer, robot: str, outlook: OutlookDep) -> PredictionView:
    """Return where a robot should be since its last word, and what it will do by itself.

    All of it is predicted: the robot said none of it.
    """
    del caller
    return await outlook.of(robot)


@router.get("/predictions")
async def list_judged_predictions(
    caller: Viewer,
    robot: str,
    outlook: OutlookDep,
    before: Annotated[str | None, Query(description="Id to go on before.")] = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 20,
) -> JudgedPredictionsView:
    """Return predictions that a fix has judged, the newest first."""
    del caller
    return await outlook.judged(robot, before, limit)
