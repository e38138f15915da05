"""Names that people give to users, robots, algorithms and layers, in letters of any script.

They become parts of key paths, of names of tables and files, and words of expectations. So they
consist of letters, digits, `_` and `-` in Unicode's NFKC form, in which the same letters are always
encoded alike.
"""

import unicodedata

# The length in UTF-8: a name is part of file names, which have at most 255 bytes.
MOST_BYTES = 100


def problem_of(name: str) -> str | None:
    """Return the problem of a name; None if it is valid.

    >>> [problem_of(name) for name in ("ana", "müller", "مريم", "花子", "bolt-2")]
    [None, None, None, None, None]
    >>> problem_of("2nd")
    "must be letters, digits, '_' and '-', a letter first"
    """
    if not name[:1].isalpha() or not is_word(name):
        return "must be letters, digits, '_' and '-', a letter first"
    if len(name.encode()) > MOST_BYTES:
        return f"must have {MOST_BYTES} bytes at most, in UTF-8"
    normal = unicodedata.normalize("NFKC", name)
    return None if name == normal else f"must be written {normal}, in the form NFKC of Unicode"


def is_word(text: str) -> bool:
    """Return whether a text has only letters with their marks, digits, `_` and `-`."""
    return f"_{text.replace('-', '_')}".isidentifier()
