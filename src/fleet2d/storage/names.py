"""Names that people give to users, robots, algorithms and layers, in letters of any script.

They become parts of key paths, of names of tables and files, and words of expectations, so that
letters, digits, `_` and `-` are all that they have, in the form NFKC of Unicode: of two ways
to write the same letters there is one, and expectations read it as it is.
"""

import unicodedata

# The length of a name in UTF-8; names of files, of which it is a part, have at most 255 bytes.
MOST_BYTES = 100


def problem_of(name: str) -> str | None:
    """Return what is wrong with a name; None: nothing.

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
    """Tell whether a text has only letters, with marks that belong to them, digits, `_` and `-`."""
    return f"_{text.replace('-', '_')}".isidentifier()
