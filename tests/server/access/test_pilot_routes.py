"""Every route of pilots says whether it sends robots something: then only who is in charge may.

A new one chooses by the type of its caller (``server/access/dependency.py``) and is listed here.
"""

from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute

from server.access import dependency
from server.station import ROUTERS

SENDS = {
    ("POST", "/api/checklists/{checklist}/overrule"),
    ("POST", "/api/missions/{mission}/start"),
    ("POST", "/api/missions/{mission}/stop"),
    ("POST", "/api/plans/{plan}/schedule"),
    ("POST", "/api/plans/{plan}/upload"),
    ("POST", "/api/schedule/{schedule_id}/cancel"),
    ("POST", "/api/transfers/{transfer}/withdraw"),
    ("POST", "/api/robots/{robot}/links/plug"),
    ("PUT", "/api/robots/{robot}/waypoints"),
    ("PUT", "/api/robots/{robot}/parameters/{name}"),
    ("POST", "/api/robots/{robot}/trim/accept"),
}
"""Plans, settings and orders: who is in charge alone."""
SENDS_BY_ITS_BODY = {
    ("PATCH", "/api/config/{kind}"),
    ("POST", "/api/robots/{robot}/commands"),
    ("POST", "/api/robots/{robot}/missions"),
    ("POST", "/api/surveys"),
}
"""Those that ask for it unless what is said moves no robot, or only surfaces it."""
DRAFTS = {
    ("POST", "/api/alarm-rules"),
    ("POST", "/api/alarm-rules/try"),
    ("DELETE", "/api/alarm-rules/{rule}"),
    ("DELETE", "/api/camera-pictures"),
    ("POST", "/api/camera-pictures"),
    ("DELETE", "/api/camera-pictures/{deployment}"),
    ("POST", "/api/camera-rig/accuracy"),
    ("POST", "/api/cameras/adjust"),
    ("DELETE", "/api/cameras/{camera}/boards"),
    ("POST", "/api/cameras/{camera}/boards"),
    ("POST", "/api/cameras/{camera}/latency"),
    ("POST", "/api/cameras/{camera}/lens"),
    ("POST", "/api/cameras/{camera}/calibrations/{calibration}/use"),
    ("PUT", "/api/tags"),
    ("PATCH", "/api/alarm-rules/{rule}"),
    ("DELETE", "/api/alarm-rules/{rule}/out-of-service"),
    ("POST", "/api/alarm-rules/{rule}/out-of-service"),
    ("POST", "/api/alarms/{alarm}/ack"),
    ("POST", "/api/alarms/{alarm}/assign"),
    ("POST", "/api/alarms/{alarm}/note"),
    ("POST", "/api/alarms/{alarm}/shelve"),
    ("POST", "/api/alarms/{alarm}/unshelve"),
    ("POST", "/api/base-maps"),
    ("DELETE", "/api/base-maps/{base_map}"),
    ("POST", "/api/channels"),
    ("PATCH", "/api/channels/{key}"),
    ("POST", "/api/checklists/{checklist}/complete"),
    ("POST", "/api/checklists/{checklist}/ticks"),
    ("DELETE", "/api/demo/faults/{robot}/{fault}"),
    ("PUT", "/api/demo/faults/{robot}/{fault}"),
    ("POST", "/api/deployments"),
    ("PATCH", "/api/deployments/{deployment}"),
    ("POST", "/api/deployments/{deployment}/begin"),
    ("POST", "/api/deployments/{deployment}/deliver"),
    ("POST", "/api/deployments/{deployment}/end"),
    ("POST", "/api/deployments/{deployment}/files"),
    ("POST", "/api/deployments/{deployment}/flags"),
    ("DELETE", "/api/deployments/{deployment}/flags/{flag}"),
    ("POST", "/api/deployments/{deployment}/quality"),
    ("POST", "/api/deployments/{deployment}/reopen"),
    ("POST", "/api/deployments/{deployment}/review"),
    ("POST", "/api/deployments/{deployment}/split"),
    ("POST", "/api/deployments/{deployment}/void"),
    ("POST", "/api/design-templates"),
    ("DELETE", "/api/design-templates/{template}"),
    ("PATCH", "/api/designs/{design}"),
    ("PUT", "/api/designs/{design}/document"),
    ("POST", "/api/designs/{design}/plan"),
    ("POST", "/api/designs/{design}/redo"),
    ("POST", "/api/designs/{design}/restore"),
    ("POST", "/api/designs/{design}/undo"),
    ("POST", "/api/designs/{design}/versions"),
    ("POST", "/api/identifications/{identification}/accept"),
    ("POST", "/api/identifications/{identification}/cancel"),
    ("POST", "/api/identifications/{identification}/resume"),
    ("POST", "/api/deployments/{deployment}/delivery"),
    ("POST", "/api/robots/{robot}/decisions/replay"),
    ("POST", "/api/robots/{robot}/films"),
    ("POST", "/api/imports"),
    ("POST", "/api/imports/uploads"),
    ("POST", "/api/imports/uploads/{upload}"),
    ("DELETE", "/api/imports/templates/{name}"),
    ("DELETE", "/api/jobs/{job}"),
    ("POST", "/api/leases/release"),
    ("POST", "/api/logbook/attachments"),
    ("POST", "/api/logbook/entries"),
    ("DELETE", "/api/logbook/entries/{entry}"),
    ("PATCH", "/api/logbook/entries/{entry}"),
    ("POST", "/api/logbook/pages"),
    ("POST", "/api/logbook/pages/{page}/take"),
    ("POST", "/api/logbook/shifts"),
    ("POST", "/api/logbook/shifts/end"),
    ("GET", "/api/backups"),
    ("GET", "/api/notices"),
    ("GET", "/api/notices/assignees/{alarm}"),
    ("DELETE", "/api/notices/contacts/{contact}"),
    ("PATCH", "/api/notices/contacts/{contact}"),
    ("POST", "/api/notices/contacts/{contact}/test"),
    ("GET", "/api/notices/people/{person}"),
    ("PUT", "/api/notices/people/{person}"),
    ("POST", "/api/notices/people/{person}/contacts"),
    ("GET", "/api/notices/station"),
    ("POST", "/api/plans/{plan}/cancel"),
    ("POST", "/api/plans/{plan}/check"),
    ("POST", "/api/plans/{plan}/choose"),
    ("POST", "/api/plans/{plan}/continue"),
    ("POST", "/api/plans/{plan}/rehearse"),
    ("POST", "/api/robots/{robot}/checklists"),
    ("DELETE", "/api/robots/{robot}/deployment-suggestion"),
    ("POST", "/api/robots/{robot}/designs"),
    ("POST", "/api/robots/{robot}/designs/read"),
    ("POST", "/api/robots/{robot}/detections"),
    ("POST", "/api/robots/{robot}/identifications"),
    ("POST", "/api/robots/{robot}/lease"),
    ("PUT", "/api/robots/{robot}/lease/script"),
    ("POST", "/api/robots/{robot}/logs/download"),
    ("POST", "/api/robots/{robot}/logs/read"),
    ("PUT", "/api/robots/{robot}/maps/choice/{variable}"),
    ("POST", "/api/robots/{robot}/maps/{variable}/comparison"),
    ("POST", "/api/robots/{robot}/maps/{variable}/learning"),
    ("PUT", "/api/robots/{robot}/parameters-description"),
    ("POST", "/api/robots/{robot}/parameters/read"),
    ("POST", "/api/robots/{robot}/plans"),
    ("POST", "/api/robots/{robot}/suggestion"),
    ("POST", "/api/robots/{robot}/trim/advice"),
    ("PATCH", "/api/robots/{robot}/view"),
    ("POST", "/api/robots/{robot}/waypoints/read"),
    ("POST", "/api/robots/{robot}/whatif"),
    ("PUT", "/api/robots/{robot}/whatif/shown"),
    ("POST", "/api/vehicles"),
    ("POST", "/api/vehicles/{key}/coefficients"),
}
"""What sends no robot anything: drafts, checks, notes, what is read, and what is kept ashore."""
AT_ONCE = {("POST", "/api/robots/{robot}/commands"), ("PUT", "/api/automation")}
"""What neither a lease nor a hold on automation stops by itself."""


def calls(dependant: Dependant) -> set[object]:
    found = {dependant.call}
    for one in dependant.dependencies:
        found |= calls(one)
    return found


def routes_that_ask(*names: str) -> set[tuple[str, str]]:
    asked = {getattr(dependency, name) for name in names}
    return {
        (method, route.path)
        for router in ROUTERS
        for route in router.routes
        if isinstance(route, APIRoute) and asked & calls(route.dependant)
        for method in route.methods
    }


def test_each_pilot_s_route_says_whether_it_sends_robots_something():
    assert routes_that_ask("_pilot_in_charge") == SENDS
    assert routes_that_ask("_in_charge_of") == SENDS_BY_ITS_BODY
    assert routes_that_ask("_pilot_at_once") == AT_ONCE
    drafts = routes_that_ask("_pilot") - SENDS_BY_ITS_BODY
    assert not drafts & SENDS
    assert drafts == DRAFTS, "a new route of pilots chooses: PilotInCharge, or it is listed here"
