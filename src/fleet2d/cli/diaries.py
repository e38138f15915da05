"""Diaries: the activities of a persona on some days, as text and as a picture."""

from pathlib import Path

from fleet2d.configuration.problems import refusal, suggest
from fleet2d.errors import InputError


def show_diary(name: str | None, out: Path | None, days: int, seed: int) -> list[str]:
    """Return a persona's diary as lines of text, the path of its picture last.

    Args:
        name: The name of a bundled persona, or a YAML file.
        out: The picture to write; None: a file in the working directory, named after the persona.
        days: The number of days, from a Monday on.
        seed: The seed of the days.

    Raises:
        InputError: There is no such persona, or the file is not a persona.
    """
    from pydantic import TypeAdapter, ValidationError

    from fleet2d.pictures.diary import diary_days, diary_lines, draw_diary
    from fleet2d.routines.persona import AnyPersona, bundled_names

    if name is None:
        raise InputError(
            f"--diary needs a persona: one of {', '.join(bundled_names())}, or a YAML file"
        )
    path = Path(name)
    if name not in bundled_names() and not path.is_file():
        raise InputError(
            f"there is no persona {name!r}{suggest(name, bundled_names())}; your own is the path of"
            " a YAML file"
        )
    try:
        persona = TypeAdapter(AnyPersona).validate_python(name)
    except ValidationError as error:
        raise refusal(name, error) from None
    diary = diary_days(persona, days, seed)
    target = out or Path(f"{path.stem}-diary.png")
    draw_diary(persona, path.stem, diary, target)
    return [*diary_lines(path.stem, persona, diary), str(target)]
