"""Changes to inputs: to their structure, to their text, to their bytes."""

import copy

from hypothesis import strategies as st

ODD = [
    None, True, False, 0, -1, 1, 0.5, -0.0, 1e-300, 1e300, float("inf"), float("nan"), 2**31, 2**63,
    -(2**63), 10**40, int("9" * 400), "", " ", "x", "0", "nan", "1e999", "24:00", "-1 s", "9" * 400,
    "30 s", "../x", "/dev/zero", "a:b", "mine:Class", "\0", "\u202e", "é" * 50, "x" * 5000, "{0}", "%s",
    "2026-02-31", "0001-01-01", "9999-12-31T23:59:59", "Europe/Berlin", [], {}, [[]], [{}], [None],
    {"type": "x"}, {"": 1}, {"x": {}}, [1, 2], [0, 0, 0], ["x"] * 50, [[0, 0], [1, 1], [0, 0]],
]  # fmt: skip
"""Values that break what doesn't expect them."""

WORDS = [
    b"\0", b"\n", b"\r\n", b"\t", b" ", b"'", b'"', b"[", b"]", b"{", b"}", b":", b",", b"-", b"&a ",
    b"*a", b"<<: ", b"!!float ", b"!!binary ", b"? ", b"---\n", b"9" * 300, b"1e999", b"-1", b"NaN",
    b"\xff\xfe", b"\xef\xbb\xbf", b"\xc3", b"0001-01-01 00:00:00", b"\x7f\xff\xff\xff",
    b"\xff\xff\xff\xff", b"\0\0\0\0", b"%", b"#",
]  # fmt: skip
"""Pieces that mean something to one reader or another."""


def places(content, where=()):
    """All key paths of a nested content but its root."""
    entries = []
    if isinstance(content, dict):
        entries = list(content.items())
    elif isinstance(content, list):
        entries = list(enumerate(content))[:40]
    found = []
    for key, value in entries:
        found += [(*where, key), *places(value, (*where, key))]
    return found


@st.composite
def structures(draw, seed):
    """A content with some of its parts replaced, removed, repeated, wrapped or put elsewhere."""
    content = copy.deepcopy(seed)
    for _ in range(draw(st.integers(1, 4))):
        everywhere = places(content)
        if not everywhere:
            return content
        *above, key = draw(st.sampled_from(everywhere))
        here = content
        for step in above:
            here = here[step]
        value = here[key]
        match draw(st.sampled_from("vvvvdnwrmk")):
            case "v":
                here[key] = copy.deepcopy(draw(st.sampled_from(ODD)))
            case "d":
                del here[key]
            case "n" if type(value) in (int, float) and abs(value) < 1e300:
                here[key] = draw(
                    st.sampled_from([-value, value * 1e6, value / 1e6, value + 1, str(value)])
                )
            case "w":
                here[key] = draw(st.sampled_from([[value], {"x": value}, [value] * 30]))
            case "r" if isinstance(here, list):
                here.insert(draw(st.integers(0, len(here))), copy.deepcopy(value))
            case "m":
                here[key] = copy.deepcopy(_at(content, draw(st.sampled_from(everywhere))))
            case _ if isinstance(here, dict):
                here[draw(st.sampled_from([f"{key}s", "x", "type", "", "x" * 300]))] = value
    return content


def _at(content, where):
    try:
        for step in where:
            content = content[step]
    except (LookupError, TypeError):
        return None  # it was removed
    return content


@st.composite
def pieces(draw, seed):
    """Bytes with some flipped, cut, repeated, or with pieces put in."""
    content = bytearray(seed)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(0, len(content) - 1)))
        size = draw(st.sampled_from([1, 1, 2, 4, 8, 30, len(content) // 2]))
        match draw(st.sampled_from("fcrii")):
            case "f" if content:
                content[at] ^= 1 << draw(st.integers(0, 7))
            case "c":
                del content[at : at + size]
            case "r":
                content[at:at] = content[at : at + size] * draw(st.sampled_from([1, 2, 50]))
            case _:
                content[at:at] = draw(st.sampled_from(WORDS))
    return bytes(content)


@st.composite
def lines(draw, seed):
    """A text of lines of words with some changed, removed, swapped or repeated."""
    rows = [line.split(" ") for line in seed.split("\n")]
    for _ in range(draw(st.integers(1, 4))):
        row = draw(st.integers(0, len(rows) - 1))
        word = draw(st.integers(0, len(rows[row]) - 1))
        match draw(st.sampled_from("vvddsrl")):
            case "v":
                rows[row][word] = str(draw(st.sampled_from(ODD)))
            case "d":
                del rows[row][word : word + draw(st.integers(1, 3))]
                rows[row] = rows[row] or [""]
            case "s":
                other = draw(st.integers(0, len(rows) - 1))
                rows[row], rows[other] = rows[other], rows[row]
            case "r":
                rows[row:row] = [list(rows[row]) for _ in range(draw(st.sampled_from([1, 2, 100])))]
            case _:
                rows[row] = [draw(st.sampled_from(rows))[0], *rows[row]]
    text = "\n".join(" ".join(row) for row in rows).encode("utf-8", "replace")
    return draw(st.one_of(st.just(text), st.just(text), pieces(text)))
