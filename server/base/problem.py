"""Errors as problem details (RFC 9457), the one shape of every refusal."""

import logging
from collections.abc import Awaitable, Callable, Mapping, Sequence
from http import HTTPStatus
from typing import Any, get_args, get_origin

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, ValidationError
from starlette.exceptions import HTTPException

from db.fault import StoreClosedError, StoreUnavailableError, UnknownIdError

MEDIA_TYPE = "application/problem+json"
REQUEST_ID_HEADER = "X-Request-ID"
REQUEST_ID = "request_id"
"""Where the id of a request stands in its state."""
ERROR_FAMILIES = ("4XX", "5XX")
"""Statuses under which the document tells what every error looks like."""
_UNKNOWN = "extra_forbidden"
logger = logging.getLogger(__name__)


class FieldError(BaseModel):
    """What is wrong with one field."""

    loc: list[str | int]
    """Path of the field from the top of the body or the query."""
    msg: str


class ProblemDetails(BaseModel):
    """Body of every answer that is an error."""

    type: str = "about:blank"
    title: str
    status: int
    detail: str
    errors: list[FieldError] | None = None


class Problem(Exception):  # noqa: N818 - the standard's own word
    """Raise it anywhere under a route to answer with problem details.

    Args:
        status: HTTP status.
        detail: One sentence that says what to do.
        errors: Fields that are wrong, for 422, or violations, for 409.
        headers: Headers of the answer.
    """

    def __init__(
        self,
        status: int,
        detail: str,
        *,
        errors: Sequence[FieldError] | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.detail = detail
        self.errors = None if errors is None else list(errors)
        self.headers = headers


class BodyProblem(HTTPException):
    """A problem that is found while a route's body is read, where only this kind gets through."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem.status, problem.detail)
        self.problem = problem


def not_found(detail: str) -> Problem:
    """Return a 404: what was asked for does not exist."""
    return Problem(HTTPStatus.NOT_FOUND, detail)


def conflict(detail: str, errors: Sequence[FieldError] | None = None) -> Problem:
    """Return a 409: the thing is not in a state that allows this."""
    return Problem(HTTPStatus.CONFLICT, detail, errors=errors)


def unprocessable(detail: str, errors: Sequence[FieldError]) -> Problem:
    """Return a 422: fields are wrong."""
    return Problem(HTTPStatus.UNPROCESSABLE_ENTITY, detail, errors=errors)


def invalid(error: ValidationError, model: type[BaseModel] | None = None) -> Problem:
    """Return the 422 of a model's own validation; of a given model, with the fields there are."""
    errors = _field_errors(error.errors())
    if model is not None:
        for one, detail in zip(errors, error.errors(), strict=True):
            names = _fields_at(model, one.loc[:-1]) if detail["type"] == _UNKNOWN else ()
            if names:
                one.msg += f"; there are {', '.join(names)}"
    return unprocessable(_count(len(errors)), errors)


def _fields_at(model: type[BaseModel], path: Sequence[str | int]) -> Sequence[str]:
    """Return the names of the fields of a model, or of one within it; none if it is a list."""
    parts = iter(path)
    for part in parts:
        field = model.model_fields.get(str(part))
        inner = None if field is None else field.annotation
        if get_origin(inner) is dict:
            inner = get_args(inner)[1]
            if next(parts, None) is None:
                return ()
        if not (isinstance(inner, type) and issubclass(inner, BaseModel)):
            return ()
        model = inner
    return tuple(model.model_fields)


def below(problem: Problem, *prefix: str | int) -> Problem:
    """Return a refusal whose paths begin at the top of the request, under ``prefix``."""
    if problem.errors is None:
        return problem
    errors = [FieldError(loc=[*prefix, *error.loc], msg=error.msg) for error in problem.errors]
    return Problem(problem.status, problem.detail, errors=errors, headers=problem.headers)


def is_refusal(error: BaseException) -> bool:
    """Tell whether an error is answered by a 4xx: the station said no, rather than failed."""
    match error:
        case Problem():
            return error.status < HTTPStatus.INTERNAL_SERVER_ERROR
        case HTTPException():
            return error.status_code < HTTPStatus.INTERNAL_SERVER_ERROR
        case _:
            return isinstance(error, RequestValidationError | UnknownIdError)


def problem_response(
    status: int,
    detail: str,
    errors: Sequence[FieldError] | None = None,
    headers: Mapping[str, str] | None = None,
) -> Response:
    """Return the answer itself, for code that stands outside of the routes."""
    body = ProblemDetails(
        title=HTTPStatus(status).phrase,
        status=status,
        detail=detail,
        errors=None if errors is None else list(errors),
    )
    return JSONResponse(
        body.model_dump(mode="json", exclude_none=True),
        status_code=status,
        media_type=MEDIA_TYPE,
        headers=None if headers is None else dict(headers),
    )


def install_problem_handlers(app: FastAPI) -> None:
    """Make every error of the application a problem."""
    handlers: dict[type[Exception], Callable[[Request, Any], Awaitable[Response]]] = {
        Problem: _on_problem,
        RequestValidationError: _on_invalid_request,
        HTTPException: _on_http_exception,
        UnknownIdError: _on_unknown_id,
        StoreUnavailableError: _on_store_unavailable,
        StoreClosedError: _on_store_unavailable,
        Exception: _on_failure,
    }
    for error, handler in handlers.items():
        app.add_exception_handler(error, handler)


async def _on_problem(request: Request, error: Problem) -> Response:
    del request
    return problem_response(error.status, error.detail, error.errors, error.headers)


async def _on_invalid_request(request: Request, error: RequestValidationError) -> Response:
    del request
    details = error.errors()
    return problem_response(422, _count(len(details)), _field_errors(details))


async def _on_http_exception(request: Request, error: HTTPException) -> Response:
    if isinstance(error, BodyProblem):
        return await _on_problem(request, error.problem)
    detail = error.detail
    if error.status_code == HTTPStatus.NOT_FOUND and detail == HTTPStatus.NOT_FOUND.phrase:
        detail = f"There is nothing at {request.url.path}."
    if error.status_code == HTTPStatus.METHOD_NOT_ALLOWED:
        detail = f"{request.url.path} does not take {request.method}."
    return problem_response(error.status_code, detail, headers=error.headers)


async def _on_unknown_id(request: Request, error: UnknownIdError) -> Response:
    del request
    return problem_response(404, str(error))


async def _on_store_unavailable(
    request: Request, error: StoreUnavailableError | StoreClosedError
) -> Response:
    del request
    detail = f"{error} Try again when it works."
    return problem_response(503, detail, headers={"Retry-After": "5"})


async def _on_failure(request: Request, error: Exception) -> Response:
    route = request.scope.get("route")
    path = getattr(route, "path", request.url.path)  # without what a secret path would tell
    # This answer leaves outside of every middleware.
    request_id: str = getattr(request.state, REQUEST_ID, "")
    known = {"request_id": request_id}
    logger.error("%s %s failed", request.method, path, exc_info=error, extra=known)
    detail = "The station failed at this; its log says why."
    return problem_response(500, detail, headers={REQUEST_ID_HEADER: request_id})


def _field_errors(details: Sequence[Any]) -> list[FieldError]:
    errors: list[FieldError] = []
    for detail in details:
        path = [part for part in detail["loc"] if part != "body"]
        is_unknown = detail["type"] == _UNKNOWN
        message = "there is no such field" if is_unknown else str(detail["msg"])
        message = message.removeprefix("Value error, ")
        errors.append(FieldError(loc=path, msg=message))
    return errors


def _count(number: int) -> str:
    return "1 field is wrong." if number == 1 else f"{number} fields are wrong."
