"""Dictionary of tables and views: up to date, and complete."""

import re
from pathlib import Path

import pytest

from dashboards.for_docs.tables import dictionary

KEPT = Path(__file__).parents[3] / "docs" / "tables.md"
SQL = Path(__file__).parents[3] / "schemas" / "sql"


@pytest.fixture(scope="module")
def text() -> str:
    return dictionary()


def test_the_kept_dictionary_is_up_to_date(text):
    assert KEPT.read_text(encoding="utf-8") == text, "run `make docs`"


def test_every_comment_of_the_tables_is_in_it(text):
    """Oracle: the comments read from the SQL by a regular expression, without a database."""
    script = (SQL / "tables.sql").read_text(encoding="utf-8")
    comments = re.findall(r"COMMENT ON COLUMN (\w+)\.(\w+) IS '((?:[^']|'')*)';", script)
    assert len(comments) > 150
    for table, column, comment in comments:
        chapter = text.partition(f"### `{table}`\n")[2].partition("### ")[0]
        meaning = comment.replace("''", "'").replace("|", "\\|").replace("*", "\\*")
        assert re.search(rf"^\| `{column}` \| [^|]+ \| {re.escape(meaning)} \|$", chapter, re.M)


def test_every_view_has_a_chapter(text):
    names = {path.name.removesuffix(".sql") for path in (SQL / "views").iterdir()}
    chapters = {name.partition("(")[0] for name in re.findall(r"^### `(.+)`$", text, re.M)}
    missing = {name for name in names if name.removeprefix("main.") not in chapters}
    assert missing == set()
