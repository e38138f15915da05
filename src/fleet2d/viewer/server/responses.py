"""Responses of the server."""

from starlette.responses import Response

from fleet2d.viewer.facts.contract import Problem
from fleet2d.viewer.facts.page_data import compact_json


def json_answer(content: bytes, status: int = 200) -> Response:
    """Return a response of JSON bytes."""
    return Response(content, status, media_type="application/json")


def problem(message: str, status: int = 422) -> Response:
    """Return a response with the reason why something can't be shown or done."""
    return json_answer(compact_json(Problem(message=message)), status)
