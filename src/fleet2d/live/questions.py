"""Questions about the tables of a run: one SELECT in SQL, which reads nothing else.

DuckDB answers without files, networks, extensions and settings. The syntax tree is checked first:
an unknown table, column, function or value is an error with the nearest name, since an answer
without rows would look like the truth.
"""

import json
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import permutations
from math import isfinite
from typing import TYPE_CHECKING, Any

from fleet2d.bounds import one_line
from fleet2d.configuration.problems import check_known, suggest
from fleet2d.errors import InputError, extra

if TYPE_CHECKING:
    import duckdb
    import pyarrow as pa

MAX_S = 20.0
"""Time that an answer may take [s]."""
MAX_QUERY = 10_000
"""Characters of a query."""
MAX_ROWS = 200
"""Rows of an answer that are shown."""
MAX_VALUE = 500
"""Characters of a value that are shown."""
MAX_ANSWER = 30_000
"""Characters of all rows that are shown."""

_CLOSED = {
    "enable_external_access": "false",
    "autoload_known_extensions": "false",
    "autoinstall_known_extensions": "false",
    "allow_community_extensions": "false",
    "temp_directory": "",
    "memory_limit": "1GB",
    "threads": "2",
    "lock_configuration": "true",
}

_FUNCTIONS = """
+ - * / // % ** ^ || ~~ !~~ ~~* !~~*
count count_star count_if sum avg min max median mode quantile_cont quantile_disc stddev stddev_samp
stddev_pop variance var_samp var_pop corr first last any_value arg_min arg_max min_by max_by
bool_and bool_or string_agg approx_count_distinct histogram
row_number rank dense_rank percent_rank cume_dist ntile lead lag first_value last_value nth_value
abs round floor ceil ceiling trunc sign sqrt pow power exp ln log10 sin cos tan atan atan2 degrees
radians greatest least isnan isfinite
lower upper length strlen trim ltrim rtrim left right substr substring contains starts_with prefix
ends_with suffix strpos split_part regexp_matches regexp_full_match regexp_extract like_escape
not_like_escape ilike_escape not_ilike_escape
date_part date_trunc date_diff datediff strftime epoch epoch_ms epoch_us time_bucket year month day
dayofweek isodow dayname monthname hour minute second make_timestamp to_days to_hours to_minutes
to_seconds to_milliseconds
"""
FUNCTIONS = tuple(_FUNCTIONS.split())
"""Functions of queries: none reads anything, or takes memory that DuckDB doesn't count."""

Node = dict[str, Any]


def answer(tables: "Mapping[str, pa.Table]", query: str, limit: int = 50) -> dict[str, Any]:
    """Return the rows that a query selects from tables.

    Args:
        tables: The tables, by name.
        query: A SELECT. A word without quotes that is compared with a column of texts, and isn't a
            column itself, is a text.
        limit: The number of rows to show, `MAX_ROWS` at most.

    Returns:
        The number of rows, the rows shown, and a note if some are left out.

    Raises:
        InputError: The query isn't one SELECT, names something that the tables lack, or takes too
            much time or memory.

    Example:
        >>> import pyarrow as pa
        >>> seen = pa.table({"room": ["hall", "hall", "kitchen"], "steps": [5, 7, 60]})
        >>> answer({"seen": seen}, "SELECT room, sum(steps) AS n FROM seen GROUP BY ALL ORDER BY n")
        {'rows': 2, 'shown': [{'room': 'hall', 'n': 12}, {'room': 'kitchen', 'n': 60}]}
        >>> answer({"seen": seen}, "SELECT * FROM seen WHERE room = 'kichen'")
        Traceback (most recent call last):
        fleet2d.errors.InputError: there is no 'kichen' in the column room: did you mean ...
    """
    with extra("mcp", "questions need DuckDB"):
        import duckdb

    if len(query) > MAX_QUERY:
        raise InputError(f"the query has {len(query)} characters, at most {MAX_QUERY} are read")
    with duckdb.connect(config=_CLOSED) as connection, _limited(connection):
        select = _checked(connection, query, tables)
        counted = connection.execute(f"SELECT count(*) FROM ({select})")  # noqa: S608 - checked
        total = counted.fetchall()[0][0]
        most = max(0, min(limit, MAX_ROWS))
        part = connection.execute(f"SELECT * FROM ({select}) LIMIT {most}")  # noqa: S608 - checked
        names = [column[0] for column in part.description or ()]
        rows = [dict(zip(names, map(_plain, row), strict=True)) for row in part.fetchall()]
    shown = rows[: _fitting(rows)]
    result = {"rows": total, "shown": shown}
    if len(shown) < total:
        result["left_out"] = (
            f"{total - len(shown)} of {total} rows: aggregate them, or go on with ORDER BY, LIMIT"
            " and OFFSET"
        )
    return result


@contextmanager
def _limited(connection: "duckdb.DuckDBPyConnection") -> Iterator[None]:
    """Interrupt queries that take too long, and turn failures of DuckDB into one line."""
    import duckdb

    done = threading.Event()

    def watch() -> None:
        if not done.wait(MAX_S):
            while not done.wait(0.1):  # again, as another statement may begin
                connection.interrupt()

    threading.Thread(target=watch, daemon=True).start()
    advice = "select fewer rows before they are joined or sorted"
    try:
        yield
    except duckdb.InterruptException:
        raise InputError(f"the answer takes more than {MAX_S:g} s: {advice}") from None
    except duckdb.OutOfMemoryException:
        limit = _CLOSED["memory_limit"]
        raise InputError(f"the answer takes more than {limit} of memory: {advice}") from None
    except (duckdb.Error, UnicodeError, RecursionError) as error:
        raise InputError(one_line(str(error).partition("\n\nLINE")[0], 300)) from None
    finally:
        done.set()


def _checked(
    connection: "duckdb.DuckDBPyConnection", query: str, tables: "Mapping[str, pa.Table]"
) -> str:
    """Return a query as one SELECT without comments, and register the tables that it reads."""
    found = connection.execute("SELECT json_serialize_sql(?)", [query]).fetchall()[0][0]
    tree = json.loads(found)
    if tree["error"]:
        reason = one_line(tree["error_message"], 300)
        raise InputError(f"expected one SELECT, as DuckDB reads it: {reason}")
    if len(tree["statements"]) != 1:
        raise InputError(f"expected one SELECT, got {len(tree['statements'])} statements")
    nodes = list(_nodes(tree))
    used = {name: tables[name] for name in _tables_of(nodes, tables)}
    for node in nodes:
        if node.get("class") in ("FUNCTION", "WINDOW"):
            check_known(node["function_name"], "function", FUNCTIONS, InputError)
    columns = {name.lower(): name for table in used.values() for name in table.column_names}
    given = _given_names(nodes)
    for column, value in _comparisons(nodes):
        name = _last_name(column)
        name = given.get(name, name)
        if name in columns:
            _check_value(columns[name], value, used, {*columns, *given})
    for node in nodes:
        if node.get("class") == "COLUMN_REF" and _last_name(node) not in given:
            check_known(_last_name(node), "column", columns, InputError)
    for name, table in used.items():
        connection.register(name, _in_local_time(table))
    select = connection.execute("SELECT json_deserialize_sql(?)", [json.dumps(tree)])
    return str(select.fetchall()[0][0])


def _in_local_time(table: "pa.Table") -> "pa.Table":
    """Return a table with times in a time zone as local times of the home."""
    for number, field in enumerate(table.schema):
        if getattr(field.type, "tz", None):
            import pyarrow.compute as pc  # few runs have a time zone

            table = table.set_column(number, field.name, pc.local_timestamp(table[field.name]))
    return table


def _nodes(tree: Any) -> Iterator[Node]:
    """Yield all objects of a syntax tree."""
    if isinstance(tree, dict):
        yield tree
        tree = list(tree.values())
    if isinstance(tree, list):
        for part in tree:
            yield from _nodes(part)


def _tables_of(nodes: list[Node], tables: Mapping[str, object]) -> Iterator[str]:
    """Yield the names of the tables that a query reads, besides those that it defines."""
    defined = {str(node["key"]).lower() for node in nodes if "key" in node}
    defined |= {str(node["cte_name"]).lower() for node in nodes if "cte_name" in node}
    known = {name.lower(): name for name in tables}
    for node in nodes:
        if node.get("type") == "SHOW_REF":
            raise InputError(f"expected a SELECT. There are the tables: {', '.join(tables)}")
        if node.get("type") == "BASE_TABLE":
            name = ".".join(node["qualified_name"]["path"])
            if name.lower() not in defined:
                check_known(name.lower(), "table", known, InputError)
                yield known[name.lower()]


def _given_names(nodes: list[Node]) -> dict[str, str]:
    """Return the aliases of columns in a query with their columns, or "" for other expressions."""
    given: dict[str, str] = {}
    for node in nodes:
        if "class" in node and node["alias"]:
            name = node["alias"].lower()
            column = _last_name(node) if node["class"] == "COLUMN_REF" else ""
            given[name] = column if given.get(name, column) == column else ""
    for node in nodes:
        for name in (*node.get("aliases", ()), *node.get("column_name_alias", ())):
            given[str(name).lower()] = ""
    return given


def _last_name(column: Node) -> str:
    return str(column["column_names"][-1]).lower()


def _comparisons(nodes: list[Node]) -> Iterator[tuple[Node, Node]]:
    """Yield each comparison of a column: the column, and the value."""
    for node in nodes:
        pairs: list[tuple[Node, Node]] = []
        if node.get("class") == "COMPARISON":
            pairs = [(node["left"], node["right"])]
        elif node.get("type") == "COMPARE_IN":
            first, *others = node["children"]
            pairs = [(first, other) for other in others]
        for pair in pairs:
            for column, value in permutations(pair):
                if column["class"] == "COLUMN_REF":
                    yield column, value


def _check_value(
    column: str, value: Node, tables: "Mapping[str, pa.Table]", names: set[str]
) -> None:
    """Refuse a text that a column of texts lacks; a word that is no column counts as a text."""
    known = _texts_of(column, tables)
    if known is None:
        return
    if value["class"] == "COLUMN_REF" and _last_name(value) not in names:
        (*_, word) = value.pop("column_names")
        literal = {"kind": "STRING", "text": word}
        value.update({"class": "CONSTANT", "type": "VALUE_CONSTANT", "literal": literal})
    if value["class"] == "CONSTANT" and value["literal"]["kind"] == "STRING":
        text = value["literal"]["text"]
        if text and text not in known:
            raise InputError(f"there is no {text!r} in the column {column}{suggest(text, known)}")


def _texts_of(column: str, tables: "Mapping[str, pa.Table]") -> list[str] | None:
    """Return the texts and categories of a column in some tables; None if it has other values."""
    import pyarrow as pa

    found: set[str] = set()
    is_text = False
    for table in tables.values():
        values = table[column] if column in table.column_names else pa.chunked_array([], "int8")
        if pa.types.is_dictionary(values.type):
            parts = [chunk.dictionary for chunk in values.chunks]
        elif pa.types.is_string(values.type):
            parts = [values.unique()]
        else:
            continue
        is_text = True
        for part in parts:
            found.update(text for text in part.to_pylist() if text is not None)
    return sorted(found) if is_text else None


def _plain(value: Any) -> Any:
    """Return a value as JSON data; of a long text only the beginning."""
    if isinstance(value, bool | int | None) or (isinstance(value, float) and isfinite(value)):
        return value
    text = str(value)
    return text if len(text) <= MAX_VALUE else f"{text[:MAX_VALUE]}…"


def _fitting(rows: list[dict[str, Any]]) -> int:
    """Return how many rows are shown within the characters of an answer."""
    characters = 0
    for count, row in enumerate(rows):
        characters += len(json.dumps(row))
        if characters > MAX_ANSWER:
            return count
    return len(rows)
