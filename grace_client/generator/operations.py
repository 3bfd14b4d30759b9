"""A method for each operation of an OpenAPI document, sync and async, grouped by its tags."""

import keyword
import re
from collections.abc import Iterator
from dataclasses import dataclass

from grace_client.generator.models import Schema, class_name, type_of

HEAD = '''"""Every request that the station takes. Written by `make client`; changes are lost."""

# ruff: noqa: D205, D415
from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import Field

from grace_client.calls import AsyncCalls, Calls, Upload, path
from grace_client.exchange import Call
from grace_client.generated import models as m
from grace_client.job import AsyncJob, Job
'''
_SKIPPED_TAGS = {"live", "view"}
"""A WebSocket, and pages."""
_JSON = "application/json"


@dataclass(frozen=True, slots=True)
class Argument:
    """One argument of a method."""

    name: str
    kind: str
    default: str | None
    place: str
    """``path``, ``query``, ``header``, ``body``, ``file`` or ``form``."""
    told_as: str

    def __str__(self) -> str:
        """Return it as it stands in a signature."""
        return f"{self.name}: {self.kind}" + ("" if self.default is None else f" = {self.default}")


@dataclass(frozen=True, slots=True)
class Method:
    """One method of a client."""

    name: str
    text: str
    arguments: tuple[Argument, ...]
    verb: str
    path: str
    options: tuple[str, ...]
    answer: str
    """Type of what it returns; of a job, of what that leaves."""
    is_job: bool


def module_of(document: Schema) -> str:
    """Return the module: two classes for each tag, and what lists them."""
    groups: dict[str, list[Method]] = {}
    for path, item in document["paths"].items():
        for verb, operation in item.items():
            tag = operation["tags"][0]
            if tag not in _SKIPPED_TAGS:
                method = _method(document, path, verb, operation)
                groups.setdefault(re.sub(r"\W", "_", tag), []).append(method)
    classes = [
        _class(tag, methods, is_async=is_async)
        for tag, methods in groups.items()
        for is_async in (False, True)
    ]
    lists = [_groups(list(groups), is_async=is_async) for is_async in (False, True)]
    return "\n\n".join([HEAD, *classes, *lists])


def _method(document: Schema, path: str, verb: str, operation: Schema) -> Method:
    arguments = [*_parameters(operation), *_body(document, operation)]
    arguments.sort(key=lambda one: one.default is not None)
    status, answer = next(
        (code, one) for code, one in operation["responses"].items() if code.startswith("2")
    )
    schema = answer.get("content", {}).get(_JSON, {}).get("schema")
    kinds = set(answer.get("content", {}))
    is_job = status == "202" and (schema or {}).get("$ref", "").endswith("/JobView")
    if is_job:
        kind = type_of(operation.get("x-job-result", {"type": "object"}), "m.")
    elif schema:
        kind = type_of(schema, "m.")
    else:
        kind = "None" if status == "204" or not kinds else "bytes"
    options = ["takes_key=True"] if operation.get("x-idempotency-key") else []
    if "x-sends" in operation:
        options.append(f"sends={operation['x-sends']!r}")
    name = re.split(r"_api_", operation["operationId"])[0]
    text = operation.get("description") or operation.get("summary", name)
    return Method(name, text, tuple(arguments), verb.upper(), path, tuple(options), kind, is_job)


def _parameters(operation: Schema) -> Iterator[Argument]:
    for one in operation.get("parameters", ()):
        name = one["name"].lower().replace("-", "_")
        name = f"{name}_" if keyword.iskeyword(name) or name == "self" else name
        kind = type_of(one["schema"], "m.") if one["in"] != "path" else "str"
        is_needed = one.get("required", False)
        if not is_needed and not kind.endswith("None"):
            kind += " | None"
        yield Argument(name, kind, None if is_needed else "None", one["in"], one["name"])


def _body(document: Schema, operation: Schema) -> Iterator[Argument]:
    body = operation.get("requestBody")
    if body is None:
        return
    content = body["content"]
    if _JSON in content:
        kind = type_of(content[_JSON]["schema"], "m.")
        is_needed = body.get("required", False) and not kind.endswith("None")
        suffix = "" if is_needed or kind.endswith("None") else " | None"
        yield Argument("body", kind + suffix, None if is_needed else "None", "body", "body")
        return
    name = content["multipart/form-data"]["schema"]["$ref"].rpartition("/")[2]
    schema = document["components"]["schemas"][name]
    for field, one in schema["properties"].items():
        is_needed = field in schema.get("required", ())
        if "contentMediaType" in one or one.get("format") == "binary":
            yield Argument(field, "Upload", None, "file", field)
        elif one.get("type") == "array":
            yield Argument(field, "Sequence[Upload]", None, "files", field)
        else:
            kind = type_of(one, "m.") + ("" if is_needed else " | None")
            yield Argument(field, kind, None if is_needed else "None", "form", field)


def _class(tag: str, methods: list[Method], *, is_async: bool) -> str:
    kind, parent = ("Async", "AsyncCalls") if is_async else ("", "Calls")
    lines = [f"class {kind}{class_name(tag)}Calls({parent}):", f'    """Requests of {tag}."""', ""]
    for method in methods:
        lines += [_definition(method, is_async=is_async), ""]
    return "\n".join(lines).rstrip() + "\n"


def _definition(method: Method, *, is_async: bool) -> str:
    needed = [str(one) for one in method.arguments if one.default is None]
    more = [str(one) for one in method.arguments if one.default is not None]
    signature = ", ".join(["self", *needed, *(["*", *more] if more else [])])
    job = "AsyncJob" if is_async else "Job"
    answer = f"{job}[{method.answer}]" if method.is_job else method.answer
    text = (
        method.text.strip().replace("\\", "\\\\").replace('"""', "'''").replace("\n", "\n        ")
    )
    text = re.sub(r"\n +\n", "\n\n", text)
    verb = "async def" if is_async else "def"
    call = "begin" if method.is_job else "ask"
    wait = "await " if is_async else ""
    return (
        f"    {verb} {method.name}({signature}) -> {answer}:\n"
        f'        """{text}"""\n'
        f"        call = {_call(method)}\n"
        f"        return {wait}self._{call}(call, {method.answer})"
    )


def _call(method: Method) -> str:
    def placed(place: str) -> list[Argument]:
        return [one for one in method.arguments if one.place == place]

    values = "".join(f", {one.told_as}={one.name}" for one in placed("path"))
    parts = [repr(method.verb), f"path({method.path!r}{values})"]
    for place, word in (("query", "query"), ("form", "form"), ("header", "headers")):
        if placed(place):
            pairs = ", ".join(f"{one.told_as!r}: {one.name}" for one in placed(place))
            parts.append(f"{word}=self._given({{{pairs}}})")
    if placed("body"):
        parts.append("body=body")
    files = [f"({one.told_as!r}, {one.name})" for one in placed("file")]
    files += [f'*(("{one.told_as}", one) for one in {one.name})' for one in placed("files")]
    if files:
        parts.append(f"files=({', '.join(files)},)")
    return f"Call({', '.join([*parts, *method.options])})"


def _groups(tags: list[str], *, is_async: bool) -> str:
    kind, parent = ("Async", "AsyncCalls") if is_async else ("", "Calls")
    lines = [
        f"class {kind}Groups({parent}):",
        '    """All requests, by what they are about."""',
        "",
    ]
    for tag in tags:
        name = f"{kind}{class_name(tag)}Calls"
        lines += [
            "    @property",
            f"    def {tag}(self) -> {name}:",
            f'        """Requests of {tag}."""',
            f"        return {name}(self._runner)",
            "",
        ]
    return "\n".join(lines).rstrip() + "\n"
