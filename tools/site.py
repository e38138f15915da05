"""Writes the pages of the documentation's site, from which `.ci/docs` builds it.

python -m tools.site FOLDER         # default: build/docs

The reference comes from components, commands and docstrings, tutorials from their notebooks, and
the month of the first page from a run. Files beside the documentation that it links are copied.
"""

import base64
import json
import os
import re
import shutil
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import typer
from tools import gallery

import fleet2d
from fleet2d.bounds import BOUNDS
from fleet2d.cli.__main__ import GROUPS, app
from fleet2d.floorplan.furniture import FURNITURE
from fleet2d.floorplan.native import native_schema
from fleet2d.floorplan.rooms.room import ALSO_CALLED
from fleet2d.scenario.schema import describe_components, schema
from fleet2d.viewing.page_data import export_html
from fleet2d.viewing.tutorials import notebook, sources

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
# Where the site has files that stand beside the documentation.
COPIES = {
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "README.md": "first-steps.md",
    "examples": "reference/examples.md",
}
LINK = re.compile(r"\]\(([^)#\s]+)(#[^)\s]*)?\)")
FENCE_TITLE = re.compile(r"^```(\w+) title=(\S+)$", re.MULTILINE)
# What the pages of the reference are about, in their order.
KINDS = {
    "scenario": "Sections of a scenario",
    "floorplan": "Floor plans",
    "behavior": "Behaviors of people and robots",
    "algorithm": "Algorithms",
    "metric": "Metrics",
    "object": "Objects",
    "drive": "Drives",
    "presence_estimator": "Estimators of presence",
    "presence_model": "Models of presence",
    "sight": "Methods of sight",
    "perception_error": "Errors of perception",
    "evidence_source": "Sources of evidence",
    "intervention": "Interventions",
    "interrupt": "Interrupts of plans",
    "right_of_way": "Right of way",
    "answers": "Answers of people",
    "answer_part": "Parts of answers",
    "attitude": "Attitudes of people",
    "initiative": "Initiative of people",
    "timing_policy": "Policies of timing",
    "part": "Parts of components",
    "shared": "Shared keys",
}
CATALOGUES = {
    "furniture": "Furniture",
    "room-types": "Types of rooms",
    "bounds": "Bounds on input",
}
ABOUT_SCHEMAS = (
    "JSON Schemas: [of a scenario](scenario.schema.json), [of a floor plan](floorplan.schema.json)."
)
# The modules whose public names have pages, beside those of the package itself.
MODULES = ("fleet2d.testing", "fleet2d.interventions", "fleet2d.expectations", "fleet2d.live")


def main() -> None:
    """Write all pages and what they show into a folder, anew."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "build" / "docs")
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "live").mkdir(parents=True)
    export_html(fleet2d.run("bundled:family", seed=4), folder / "month.html")
    for piece in days():
        export_html(gallery.open_piece(piece), folder / "live" / f"{piece.name}.html")
    for uri, content in {**written_pages(), **generated_pages()}.items():
        path = folder / uri
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())


def written_pages() -> dict[str, str | bytes]:
    """Return the pages that people wrote, and the files beside them."""
    pages: dict[str, str | bytes] = {}
    guides = sources().values()
    for path in sorted(DOCS.rglob("*")):
        uri = path.relative_to(DOCS).as_posix()
        if path.suffix == ".md":
            page = page_of(f"docs/{uri}", uri)
            pages |= with_notebook(path, uri, page) if path in guides else {uri: page}
        elif path.suffix == ".ipynb":
            pages |= tutorial_pages(path)
        elif path.is_file():
            pages[uri] = path.read_bytes()
    pages["index.md"] = with_choice(str(pages["index.md"]))
    pages["gallery.md"] = with_days(str(pages["gallery.md"]))
    for source in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md"):
        pages[COPIES[source]] = page_of(source, COPIES[source])
    for uri, more in (("cli", commands_part()), ("components", components_part())):
        pages[f"reference/{uri}.md"] = f"{pages[f'reference/{uri}.md']!s}\n{more}"
    return pages


def generated_pages() -> dict[str, str]:
    """Return the pages that are made from the package and the examples."""
    examples = {f"{file.relative_to(ROOT)}": file.read_text("utf-8") for file in example_files()}
    return {
        "reference/components/furniture.md": furniture_page(),
        "reference/components/room-types.md": rooms_page(),
        "reference/components/bounds.md": bounds_page(),
        "reference/examples.md": examples_page(),
        "reference/scenario.schema.json": json.dumps(schema(), indent=2),
        "reference/floorplan.schema.json": json.dumps(native_schema(), indent=2),
        **dict(component_pages()),
        **dict(python_pages()),
        **examples,
    }


def days() -> list[gallery.Piece]:
    """Return the scenarios of the gallery, whose days the site has live."""
    return [piece for piece in gallery.PIECES if piece.at is not None]


def with_choice(page: str) -> str:
    """Return the first page with a choice of what its frame shows, which is the month at first."""
    options = [f'<option value="live/{piece.name}.html">{piece.title}</option>' for piece in days()]
    change = "this.parentNode.nextElementSibling.src = this.value"
    choice = f"""<p>Watch <select onchange="{change}">
<option value="month.html">A month of the family</option>
{"".join(options)}
</select></p>
"""
    return page.replace("<iframe", f"{choice}<iframe")


def with_days(page: str) -> str:
    """Return the gallery with links to its days."""
    for piece in days():
        picture = f"](images/gallery/{piece.name}.webp)\n"
        page = page.replace(picture, f"{picture}\n[Watch this day](live/{piece.name}.html)\n")
    return page


def page_of(source: str, uri: str) -> str:
    """Return the text of a file of the repository as a page of the site."""
    text = (ROOT / source).read_text(encoding="utf-8")
    return relinked(FENCE_TITLE.sub(r'```\1 title="\2"', text), source, uri)


def relinked(text: str, source: str, uri: str) -> str:
    """Return a text of a file with the links that it has as a page."""

    def link(match: re.Match[str]) -> str:
        address, anchor = match[1], match[2] or ""
        if address.startswith(("http:", "https:", "mailto:")):
            return match[0]
        target = os.path.normpath(Path(source).parent / address)
        return f"]({os.path.relpath(place_of(target), Path(uri).parent)}{anchor})"

    return LINK.sub(link, text)


def place_of(target: str) -> str:
    """Return where the site has a file of the repository."""
    if target.startswith("docs/"):
        return target.removeprefix("docs/").replace(".ipynb", ".md")
    if target in COPIES:
        return COPIES[target]
    path = ROOT / target
    return COPIES["examples"] if path.is_dir() else target


def components_by_kind() -> dict[str, list[Any]]:
    """Return all components by their kind, in the order of the pages."""
    found: dict[str, list[Any]] = {kind: [] for kind in KINDS}
    for component in describe_components():
        found[component.kind].append(component)
    return found


def components_part() -> str:
    """Return the table of all components, and of what is no component."""
    rows = [
        f"| [{KINDS[kind]}](components/{kind}.md) | {names_of(components)} |"
        for kind, components in components_by_kind().items()
    ]
    rows += [f"| [{title}](components/{page}.md) | |" for page, title in CATALOGUES.items()]
    return "\n".join(["| kind | types |", "| --- | --- |", *rows, "", ABOUT_SCHEMAS, ""])


def names_of(components: list[Any]) -> str:
    """Return the names of components as text."""
    return ", ".join(f"`{component.type}`" for component in components)


def component_pages() -> Iterator[tuple[str, str]]:
    """Yield a page of each kind of component, with all keys, units and defaults."""
    for kind, components in components_by_kind().items():
        parts = "\n".join(component_part(component) for component in components)
        yield f"reference/components/{kind}.md", f"# {KINDS[kind]}\n\n{parts}"


def component_part(component: Any) -> str:
    """Return what a page says of a component."""
    lines = [f"## {component.type}", "", plain(component.summary), ""]
    if component.fields:
        lines += ["| key | default | meaning |", "| --- | --- | --- |"]
        lines += [field_row(field) for field in component.fields]
        lines.append("")
    if component.shares:
        shared = ", ".join(f"[{name}](shared.md)" for name in component.shares)
        lines += [f"And the keys of {shared}.", ""]
    return "\n".join(lines)


def field_row(field: Any) -> str:
    """Return a row of the table of keys."""
    default = "required" if field.default is None else f"`{field.default or repr('')}`"
    cells = (f"`{field.name}`: {field.type}", default, field.description)
    return f"| {' | '.join(plain(cell) for cell in cells)} |"


def plain(text: str) -> str:
    """Return a text for a cell: a bar parts no cells, and brackets outside of code are no links."""
    parts = text.replace("|", r"\|").split("`")
    parts[::2] = [part.replace("[", r"\[") for part in parts[::2]]
    return "`".join(parts)


def commands_part() -> str:
    """Return what all commands say of themselves."""
    group: Any = typer.main.get_command(app)
    context = typer.Context(group, info_name="fleet2d")
    parts: list[str] = []
    for heading, names in GROUPS.items():
        parts += [f"## {heading}", ""]
        for name in names:
            parts += command_lines(group.get_command(context, name), context, f"fleet2d {name}")
    return "\n".join(parts)


def command_lines(command: Any, context: Any, words: str) -> list[str]:
    """Return what the page says of a command, and of its own commands."""
    if command is None:
        return []
    inner = typer.Context(command, info_name=words.split()[-1], parent=context)
    if hasattr(command, "commands"):
        return [
            line
            for name, own in command.commands.items()
            for line in command_lines(own, inner, f"{words} {name}")
        ]
    return [f"### {words}", "", "```text", command.get_help(inner), "```", ""]


def furniture_page() -> str:
    """Return the page of the catalogue of furniture."""
    rows = [
        f"| `{piece.type}` | {extent(piece.width)} | {extent(piece.depth)} | {piece.blocks}"
        f" | {', '.join(use.posture for use in piece.uses) or '–'} |"
        for piece in FURNITURE.values()
    ]
    head = ["| type | width [m] | depth [m] | blocks | use |", "| --- | --- | --- | --- | --- |"]
    return "\n".join(["# Furniture", "", *head, *rows, ""])


def extent(least_and_most: tuple[float, float]) -> str:
    """Return a range of sizes as text."""
    return "–".join(f"{value:.2f}" for value in dict.fromkeys(least_and_most))


def rooms_page() -> str:
    """Return the page of the types of rooms."""
    rows = [f"| `{kind}` | {', '.join(names)} |" for kind, names in ALSO_CALLED.items()]
    text = "If a room has several labels, its type is the one that comes first here."
    return "\n".join(
        ["# Types of rooms", "", text, "", "| type | also called |", "| --- | --- |", *rows, ""]
    )


def bounds_page() -> str:
    """Return the page of the bounds on what is read."""
    rows = [f"| `{b.variable}` | {b.default:,} | {b.noun} |" for b in BOUNDS]
    text = "A file that exceeds a bound is refused; an environment variable raises it."
    head = ["| variable | bound | of |", "| --- | ---: | --- |"]
    return "\n".join(["# Bounds on input", "", text, "", *head, *rows, ""])


def example_files() -> Iterable[Path]:
    """Return the examples that the repository has."""
    kinds = {".yaml", ".py", ".json", ".toml", ".txt", ".cpp", ".html"}
    files = sorted((ROOT / "examples").rglob("*"))
    return [file for file in files if file.suffix in kinds and "__pycache__" not in file.parts]


def examples_page() -> str:
    """Return the page that lists the examples, each with its first line."""
    rows = []
    for file in example_files():
        name = file.relative_to(ROOT / "examples")
        first = file.read_text(encoding="utf-8").partition("\n")[0].strip('#"/ ')
        about = first if file.suffix in {".yaml", ".py", ".cpp"} else ""
        rows.append(f"| [{name}](../examples/{name}) | {about.replace('|', ' ')} |")
    return "\n".join(["# Examples", "", "| file | shows |", "| --- | --- |", *rows, ""])


def python_pages() -> Iterator[tuple[str, str]]:
    """Yield the pages of the Python interface, from docstrings."""
    names = {name: f"{module}.{name}" for name, module in fleet2d._MODULES.items()}
    functions = {name: path for name, path in names.items() if name[0].islower()}
    classes = {name: path for name, path in names.items() if name not in functions}
    subjects = {"functions": functions, "classes": classes}
    lines = ["# Functions and classes", ""]
    for subject, paths in subjects.items():
        lines += [f"- [`fleet2d`: {subject}]({subject}.md): {', '.join(f'`{n}`' for n in paths)}"]
        directives = "\n\n".join(f"::: {path}" for path in paths.values())
        yield f"reference/python/{subject}.md", f"# fleet2d: {subject}\n\n{directives}\n"
    for module in MODULES:
        short = module.removeprefix("fleet2d.")
        lines += [f"- [`{module}`]({short}.md)"]
        yield f"reference/python/{short}.md", f"# {module}\n\n::: {module}\n"
    yield "reference/python/index.md", "\n".join([*lines, ""])


def tutorial_pages(path: Path) -> dict[str, str | bytes]:
    """Return the page of a notebook with the outputs that it stores, its pictures, and the file."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    files: dict[str, str | bytes] = {}
    lines = []
    for number, cell in enumerate(cells):
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            lines += [source, ""]
            continue
        lines += ["```python", source, "```", ""]
        for output in cell["outputs"]:
            data = output.get("data", {"text/plain": output.get("text", "")})
            if "image/png" in data:
                picture = f"{path.stem}_{number}.png"
                files[f"tutorials/{picture}"] = base64.b64decode("".join(data["image/png"]))
                lines += [f"![{''.join(data.get('text/plain', 'the figure'))}]({picture})", ""]
            else:
                lines += ["```text", "".join(data["text/plain"]).rstrip(), "```", ""]
    uri = f"tutorials/{path.stem}.md"
    page = relinked("\n".join(lines), f"docs/tutorials/{path.name}", uri)
    return {**files, **with_notebook(path, uri, page)}


def with_notebook(source: Path, uri: str, page: str) -> dict[str, str | bytes]:
    """Return a page that links its notebook below the heading, and the notebook."""
    heading, _, text = page.partition("\n")
    name = source.stem
    link = f"As a notebook: [download it]({name}.ipynb), or `fleet2d demo --tutorial {name}`."
    file = f"{uri.removesuffix('.md')}.ipynb"
    return {uri: f"{heading}\n\n{link}\n{text}", file: json.dumps(notebook(source), indent=1)}


if __name__ == "__main__":
    main()
