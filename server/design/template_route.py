"""Templates from which designs begin."""

from typing import Annotated

from fastapi import APIRouter, Depends

from autonomy.design.document import Design
from db.query.mission.design_templates import TemplateRecord
from db.record import same
from server.access.dependency import Pilot, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.design.designs import Designs
from server.design.view import NewTemplate, TemplateParameter, TemplateView

router = APIRouter(prefix="/api/design-templates", tags=["designs"], route_class=IdempotentRoute)

DesignsDep = Annotated[Designs, Depends(service(Designs))]


@router.get("")
async def list_templates(caller: Viewer, designs: DesignsDep) -> list[TemplateView]:
    """Return the templates, the newest first."""
    del caller
    return [_view(one) for one in await designs.templates()]


@router.post("", status_code=201)
async def create_template(caller: Pilot, body: NewTemplate, designs: DesignsDep) -> TemplateView:
    """Add a template: a document, and which of its numbers are said anew each time."""
    return _view(await designs.add_template(body, by=caller.name))


@router.delete("/{template}")
async def delete_template(caller: Pilot, template: str, designs: DesignsDep) -> TemplateView:
    """Put a template away; designs that began from it stay."""
    del caller
    return _view(await designs.archive_template(template))


def _view(record: TemplateRecord) -> TemplateView:
    return same(
        TemplateView,
        record,
        document=Design.model_validate(record.document),
        parameters=[TemplateParameter.model_validate(one) for one in record.parameters],
        by=record.created_by,
        at=record.created_at,
    )
