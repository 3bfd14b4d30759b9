"""Templates of checklists, and the checks that their automatic items can ask."""

from typing import Annotated

from fastapi import APIRouter, Depends
from pydantic import Field

from server.access.dependency import Admin, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.base.view import Body
from server.checklist.check import CHECKS
from server.checklist.template import KEY_PATTERN, ChecklistTemplate, template_of
from server.checklist.templates import Templates
from server.checklist.view import (
    ChecklistCheckView,
    ChecklistTemplateView,
    ChecklistVersionView,
    check_view,
    template_view,
)

router = APIRouter(prefix="/api", tags=["checklists"], route_class=IdempotentRoute)

TemplatesDep = Annotated[Templates, Depends(service(Templates))]


class NewChecklistTemplate(Body):
    """A template of the team's own."""

    key: Annotated[str, Field(pattern=KEY_PATTERN)]
    """Names the list for good."""
    template: ChecklistTemplate
    """What it says."""


class ChecklistTemplateChange(Body):
    """What a template says from now on."""

    template: ChecklistTemplate
    """The whole list as it is to be from now on."""
    version: int = Field(ge=0)
    """The version that was changed; 409 if there is a newer one."""


@router.get("/checklist-checks")
async def list_checks(caller: Viewer) -> list[ChecklistCheckView]:
    """Return what automatic items can ask, with the usual limit and its bounds."""
    del caller
    return [check_view(one) for one in CHECKS.values()]


@router.get("/checklist-templates")
async def list_templates(caller: Viewer, templates: TemplatesDep) -> list[ChecklistTemplateView]:
    """Return every template in use, the delivered ones first."""
    del caller
    return [template_view(one) for one in templates.entries]


@router.post("/checklist-templates", status_code=201)
async def create_template(
    caller: Admin, body: NewChecklistTemplate, templates: TemplatesDep
) -> ChecklistTemplateView:
    """Add a template; 422 names what is wrong with an item, such as a check that there is not."""
    return template_view(await templates.add(body.key, body.template, by=caller.name))


@router.put("/checklist-templates/{template}")
async def change_template(
    caller: Admin, template: str, body: ChecklistTemplateChange, templates: TemplatesDep
) -> ChecklistTemplateView:
    """Save a template as its next version; runs that are under way keep theirs."""
    changed = await templates.change(template, body.template, body.version, by=caller.name)
    return template_view(changed)


@router.delete("/checklist-templates/{template}")
async def reset_template(
    caller: Admin, template: str, templates: TemplatesDep
) -> list[ChecklistTemplateView]:
    """Let a template be as it was delivered again; one of the team's own is put away."""
    await templates.reset(template, by=caller.name)
    return [template_view(one) for one in templates.entries]


@router.get("/checklist-templates/{template}/versions")
async def list_versions(
    caller: Viewer, template: str, templates: TemplatesDep
) -> list[ChecklistVersionView]:
    """Return every version of a template that was saved, the newest first."""
    del caller
    templates.get(template)
    return [
        ChecklistVersionView(
            one.version,
            None if one.document is None else template_of(one.document),
            one.saved_at,
            one.saved_by,
        )
        for one in await templates.versions(template)
    ]
