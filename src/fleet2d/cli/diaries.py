"""Diaries: what somebody of a persona does on some days, as text and as a picture."""

from pathlib import Path

from fleet2d.errors import InputError
from fleet2d.problems import suggest


def show_diary(what: str | None, out: Path | None, days: int, seed: int) -> list[str]:
    """Return a persona's diary as lines of text, the path of its picture last.

    Args:
        what: A bundled persona's name, or a YAML file of one.
        out: The picture to write; None: named after the persona, in the working directory.
        days: How many days, from a Monday on.
        seed: Of the days.

    Raises:
        InputError: There is no such persona, or it is not one.
    """
    from pydantic import TypeAdapter, ValidationError

    from fleet2d.routines.persona import AnyPersona, bundled_names
    from fleet2d.view.diary import diary_days, draw_diary, written_diary

    if what is None:
        raise InputError(
            f"--diary wants a persona: one of {', '.join(bundled_names())}, or a YAML file"
        )
    path = Path(what)
    if what not in bundled_names() and not path.is_file():
        raise InputError(
            f"there is no persona {what!r}{suggest(what, bundled_names())}; your own is the path of"
            " a YAML file"
        )
    try:
        persona = TypeAdapter(AnyPersona).validate_python(what)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise InputError(f"{what}: {where + ': ' if where else ''}{first['msg']}") from None
    lived = diary_days(persona, days, seed)
    target = out or Path(f"{path.stem}-diary.png")
    draw_diary(persona, path.stem, lived, target)
    return [*written_diary(path.stem, persona, lived), str(target)]
