"""The page of a gate."""

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
import yaml
from tests.scenes import scenario

FOLDER = Path(__file__).parents[2] / "examples" / "release_gate"


def test_names_and_texts_cannot_inject_anything(fleet2d):
    evil = '<script src="https://example.org/x.js">alert(1)</script>'
    content = scenario("2 min", robots={"astro": {"type": "patrol", "dwell": "10 s"}})
    Path("home.yaml").write_text(yaml.safe_dump(content))
    Path("test_<img>.py").write_text(
        "from fleet2d.testing import trial\n\n\n"
        "@trial('home.yaml')\n"
        "def test_robot(trial):\n"
        f"    trial.expect('never(moving(astro))', '<b>still', covers=['{evil}'])\n"
    )
    Path("requirements.yaml").write_text(yaml.safe_dump({evil: evil}))
    code, _, err = fleet2d(
        "test", "test_<img>.py", "--requirements", "requirements.yaml", "--build", "<i>2.1",
        "--report", "gate.html",
    )  # fmt: skip

    assert (code, err) == (1, "")
    page = Path("gate.html").read_text()
    tags = []
    parser = HTMLParser()
    parser.handle_starttag = lambda tag, attrs: tags.append((tag, dict(attrs)))
    parser.feed(page)
    assert {"script", "b", "i"}.isdisjoint(tag for tag, _ in tags)
    assert all(str(a["src"]).startswith("data:image/png") for _, a in tags if "src" in a)
    assert not re.search(r'(?:src|href)="?http', page)
    assert "Content-Security-Policy" in page
    assert page.index("doesn&#x27;t pass") < page.index("<h2>")


@pytest.mark.slow
def test_a_week_of_a_qa_lead_ends_in_one_page_with_the_faults_that_matter(fleet2d):
    code, out, _ = fleet2d(
        "test", FOLDER / "tests", "--seeds", "20",
        "--build", FOLDER / "build-2.1.yaml", "--against", FOLDER / "build-2.0.yaml",
        "--requirements", FOLDER / "requirements.yaml", "--report", "gate.html",
    )  # fmt: skip

    assert code == 1
    assert "build-2.1 doesn't pass: 2 of 5 expectations are worse than with build-2.0" in out
    faults = {
        "finds_ana": "worse in 8 of 20 trials",  # it is slow
        "out_of_the_bathroom": "worse in 20 of 20 trials",
        "is_quiet": "better in 20 of 20 trials",  # no rounds at night any more
        "never_empty": "holds by less in 20 of 20 trials",
    }
    assert all(words in out for words in faults.values())
    assert re.search(r"keeps_off +held +20 of 20", out)  # with both builds: robots yield
    assert "fails with build-2.0, too: never_empty" in out
    assert "not covered: REQ-6" in out
    page = Path("gate.html").read_text()
    assert page.count("data:image/png;base64,") == 3
    assert all(name in page for name in faults)
