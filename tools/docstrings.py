"""An extension of Griffe: the examples in docstrings become code, and no Markdown."""

from typing import Any

import griffe


class Examples(griffe.Extension):
    """Puts examples into fences."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Rewrite the docstring of an object that was read."""
        if obj.docstring is not None:
            obj.docstring.value = fenced(obj.docstring.value)


def fenced(text: str) -> str:
    """Return a docstring with each example in a fence of code.

    >>> print(fenced(">>> 1 + 1"))
    ```pycon
    >>> 1 + 1
    ```
    """
    lines: list[str] = []
    is_code = False
    for line in [*text.splitlines(), ""]:
        begins = line.lstrip().startswith(">>>")
        if begins and not is_code:
            lines.append(f"{indent_of(line)}```pycon")
            is_code = True
        elif is_code and not line.strip():
            lines.append(f"{indent_of(lines[-1])}```")
            is_code = False
        lines.append(line)
    return "\n".join(lines).rstrip("\n")


def indent_of(line: str) -> str:
    """Return the space before a line."""
    return line[: len(line) - len(line.lstrip())]
