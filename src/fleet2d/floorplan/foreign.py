"""Files of other programs, recognized by their content, and what to convert them to."""

import re
import zlib
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

GZIP = b"\x1f\x8b"


@cache
def _known() -> dict[str, Any]:
    """Return the lists of the YAML file beside this one."""
    from fleet2d.configuration.documents import read_document  # with YAML, which few homes need

    return read_document(Path(__file__).with_suffix(".yaml")).data


def foreign_file(content: bytes) -> str | None:
    """Return what a file is and what to convert it to, or None if that is unknown.

    Args:
        content: Its beginning, at least 1 kB of it if it is longer.

    Example:
        >>> foreign_file(b"GIF89a")
        'is a GIF picture, which Fleet2D does not read: save it as PNG'
        >>> foreign_file(b"{}") is None
        True
    """
    if content.startswith(GZIP):
        inner = b""
        with suppress(zlib.error):
            inner = zlib.decompressobj(31).decompress(content, 65536)
        said = None if inner.startswith(GZIP) else foreign_file(inner)
        if said is not None:
            return f"is packed by gzip: unpacked it {said}"
    for beginning, kind, advice in _known()["beginnings"]:
        if content.startswith(beginning.encode("latin-1")):
            return _sentence(kind, advice)
    if content.startswith(b"RIFF") and content[8:12] == b"WEBP":
        return _sentence("a WebP picture", "save it as PNG")
    if content[4:8] == b"ftyp":
        return _sentence("a HEIC picture or a film", "save it as PNG")
    if content.startswith(b"PK\x03\x04"):
        names = b"\n".join(re.findall(rb"PK\x03\x04.{26}([ -~]{1,200})", content, re.DOTALL))
        members = _known()["members"]
        return _sentence(*next(known for part, *known in members if part.encode() in names))
    text = content.decode("utf-8-sig", "replace")
    text = re.sub(r"\A(\s|<\?[^>]*\?>|<!--.*?-->)*", "", text, flags=re.DOTALL)
    for pattern, kind, advice in _known()["texts"]:
        if re.match(pattern, text, re.IGNORECASE):
            return _sentence(kind, advice)
    return None


def foreign_document(content: dict[str, Any]) -> str | None:
    """Return what a JSON file is by its keys and what to convert it to, or None if unknown."""
    for keys, kind, advice in _known()["keys"]:
        if set(keys) <= content.keys():
            return _sentence(kind, advice)
    return None


def _sentence(kind: str, advice: str) -> str:
    return f"is {kind}, which Fleet2D does not read: {advice}"
