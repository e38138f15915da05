"""The table of bounds: whole, and the page that is made of it says the same."""

import ast

import pytest
from tests.scripts import ROOT, script


@pytest.fixture(scope="module")
def bounds():
    return script("benchmarks/bounds.py")


def test_every_bound_has_a_name_a_must_and_an_aim_that_is_harder(bounds):
    known = bounds.bounds()

    assert len({bound.name for bound in known}) == len(known) > 10
    for bound in known:
        assert bound.aim >= bound.must if bound.most else bound.aim <= bound.must
        assert bound.code is None or "figure =" in bound.code
        ast.parse(bound.code or "")


def test_verdict_says_what_is_kept(bounds):
    less, more = bounds.Bound("a", "", "s", 2, 1), bounds.Bound("b", "", "%", 75, 90, most=True)

    assert ["", "aim", "must", "MISSED"] == [less.verdict(x) for x in (None, 1, 2, 2.1)]
    assert ["aim", "must", "MISSED"] == [more.verdict(x) for x in (90, 80, 70)]
    assert ("–", "2 s", "1 s", "–") == less.row(None)
    assert "a | **2.1 s** | 2 s | 1 s | –" == bounds.Bound("", "a", "s", 2, 1).cells(2.1)


def test_page_has_every_bound(bounds):
    page = (ROOT / "docs/results/speed.md").read_text(encoding="utf-8")

    for bound in bounds.bounds():
        _, *rest = bound.row(None)
        assert f"| {bound.what} |" in page
        assert f" | {' | '.join(rest)} |" in page
        if bound.command:
            assert f"| {bound.cells(bound.figure)} |" in page


def test_code_of_a_bound_sets_its_figure(bounds, capsys):
    bounds.run_code("figure = 1 + 2 * least(lambda: None, 1) > 0")

    assert capsys.readouterr().out == "true\n"
