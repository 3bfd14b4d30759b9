"""Work under way: one shape of answer, 202, that says where to ask how far it is."""

from dataclasses import dataclass
from typing import Annotated, Final

from fastapi import Depends, Request, Response

from server.base.view import View

LOCATION: Final = "Location"
_COLLECTIONS: Final = {
    "job": "jobs",
    "plan": "plans",
    "transfer": "transfers",
    "command": "commands",
    "mission": "missions",
}


@dataclass(frozen=True, slots=True)
class StartedView(View):
    """A plan, transfer, command or mission that is under way.

    The header ``Location`` says where to ask for it; with ``wait_s`` the answer there comes with
    its next change.
    """

    id: str


def location_of(identity: str) -> str:
    """Return where to ask for what is under way, by its id, such as ``/api/plans/plan-7``.

    Raises:
        KeyError: If nothing of this kind is ever under way.
    """
    kind = identity.partition("-")[0]  # an order that could not be written is "command-unwritten-1"
    return f"/api/{_COLLECTIONS[kind]}/{identity}"


BEGUN: Final = "begun"
"""Where the id of what a request began stands in its state."""


class StartedAnswer:
    """Answers a request that began something with a state of its own."""

    def __init__(self, request: Request, response: Response) -> None:
        self._request = request
        self._response = response

    def __call__(self, identity: str) -> StartedView:
        """Return the answer, and say where to ask from now on."""
        self._response.headers[LOCATION] = location_of(identity)
        setattr(self._request.state, BEGUN, identity)
        return StartedView(identity)


class CalculatedAnswer(StartedAnswer):
    """Answers a request that began long calculations, which count as work of its script."""


Started = Annotated[StartedAnswer, Depends()]
CalculationStarted = Annotated[CalculatedAnswer, Depends()]
