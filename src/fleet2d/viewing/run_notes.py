"""Notes and bookmarks of a run, in a file beside its directory: no part of the run or its seal."""

import json
from pathlib import Path

from fleet2d.errors import InputError
from fleet2d.inputs import open_input
from fleet2d.runs.run import Run
from fleet2d.storage.files import path_in
from fleet2d.viewing.contract import NOTES, NoteFacts, read_body
from fleet2d.viewing.page_data import write_file

MAX_BYTES = 4_000_000
SUFFIX = ".notes.json"


def notes_path(run: Run) -> Path:
    """Return the file of the notes of a run: `month.notes.json` beside `month`.

    Raises:
        InputError: The run isn't stored; or a link, a device or a pipe is in the file's place.
    """
    if run.directory is None:
        raise InputError("the run is in memory: notes are stored beside the directory of a run")
    root = Path(run.directory).resolve()
    return path_in(root.parent, root.name + SUFFIX)


def read_notes(run: Run) -> list[NoteFacts]:
    """Return the notes of a run, in the order of their steps.

    Raises:
        InputError: Their file can't be read.
    """
    if run.directory is None:
        return []
    path = notes_path(run)
    try:
        with open_input(path) as file:
            return checked_notes(file.read(MAX_BYTES + 1))
    except FileNotFoundError:
        return []
    except (OSError, InputError) as error:
        raise InputError(f"{path} can't be read: {error}") from None


def write_notes(run: Run, body: bytes) -> list[NoteFacts]:
    """Store all notes of a run in place of the present ones, and return them.

    Raises:
        InputError: The body isn't notes, the run isn't stored, or the file can't be written.
    """
    notes = checked_notes(body)
    path = notes_path(run)
    write_file(path, json.dumps(notes, indent=1, ensure_ascii=False).encode())
    return notes


def checked_notes(body: bytes) -> list[NoteFacts]:
    """Return the notes in a file or a request.

    Raises:
        InputError: The body is not a list of notes, or there are too many.

    Example:
        >>> checked_notes(b'[{"step": 5, "text": "why?"}, {"step": 2, "text": ""}]')
        [{'step': 2, 'text': ''}, {'step': 5, 'text': 'why?'}]
    """
    refusal = "notes are a list of up to 1000 {step, text}, a text of up to 2000 characters"
    notes = read_body(body, NOTES, refusal, MAX_BYTES)
    return sorted(notes, key=lambda note: note["step"])
