"""`fleet2d demo --tutorial` writes tutorials and guides as notebooks, and opens them."""

import json
import subprocess
import sys

import pytest

from fleet2d.viewing import tutorials

PAGE = """# Files

See [the other page](other.md#part) and [a site](https://example.org).

```yaml title=a.yaml
seed: 1
```

Then:

```sh
fleet2d run a.yaml
```

```python
print(1)
```

The end.
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tutorials, "find_spec", lambda _: None)  # no Jupyter
    return tmp_path


def cells(path):
    """The cells of a notebook."""
    return json.loads(path.read_text(encoding="utf-8"))["cells"]


def test_files_of_a_page_are_written_its_python_runs_and_all_else_is_text():
    found = tutorials.notebook_of(PAGE)["cells"]

    kinds = ["markdown", "code", "markdown", "code", "markdown"]
    assert kinds == [cell["cell_type"] for cell in found]
    assert "%%writefile a.yaml\nseed: 1" == found[1]["source"]
    assert "Then:\n\n```sh\nfleet2d run a.yaml\n```" == found[2]["source"]
    assert "print(1)" == found[3]["source"]
    assert found[0]["source"].endswith("[a site](https://example.org).")


def test_list_has_each_with_its_title(fleet2d):
    code, out, _ = fleet2d("demo", "--list")

    assert 0 == code
    rows = dict(line.split(maxsplit=1) for line in out.splitlines())
    assert list(rows) == list(tutorials.sources())
    assert ["algorithm", "model", "product-test", "study"] == list(rows)[:4]
    assert 11 < len(rows)
    assert "A study, in fifteen minutes" == rows["study"]
    assert "Floor plans" == rows["floorplans"]


def test_tutorial_is_that_of_the_documentation_with_its_pictures(here, fleet2d):
    code, out, _ = fleet2d("demo", "--tutorial", "study")

    assert 0 == code
    assert out.startswith("study/study.ipynb: open it")
    written, own = cells(here / "study" / "study.ipynb"), cells(tutorials.sources()["study"])
    of_code = [cell for cell in own if cell["cell_type"] == "code"]
    assert of_code == [cell for cell in written if cell["cell_type"] == "code"]
    assert "image/png" in json.dumps(of_code)


def test_guide_has_no_links_to_pages_that_are_not_there(here, fleet2d):
    assert 0 == fleet2d("demo", "--tutorial", "layers")[0]

    text = (here / "layers" / "layers.ipynb").read_text(encoding="utf-8")
    assert ".md)" not in text
    assert "images/" not in text
    assert "How long ago each place was seen" in text  # of a picture


def test_notebook_that_somebody_works_in_is_kept(here, fleet2d):
    (here / "study").mkdir()
    (here / "study" / "study.ipynb").write_text("mine", encoding="utf-8")

    assert 0 == fleet2d("demo", "--tutorial", "study")[0]

    assert "mine" == (here / "study" / "study.ipynb").read_text(encoding="utf-8")


def test_unknown_tutorial_is_told_with_the_nearest_name(here, fleet2d):
    code, _, err = fleet2d("demo", "--tutorial", "studdy")

    assert 2 == code
    assert "did you mean 'study'?" in err
    assert [] == list(here.iterdir())


@pytest.mark.parametrize(
    ("options", "exit_code", "calls"),
    [((), 0, 1), ((), 1, 1), (("--no-view",), 0, 0)],
    ids=["opened", "refused, as to root", "not wanted"],
)
def test_jupyter_opens_it_where_it_is_installed(
    here, fleet2d, monkeypatch, options, exit_code, calls
):
    called = []

    def run(command, check):
        called.append(command)
        return subprocess.CompletedProcess(command, exit_code)

    monkeypatch.setattr(tutorials, "find_spec", lambda name: name == "notebook" or None)
    monkeypatch.setattr(subprocess, "run", run)

    code, out, _ = fleet2d("demo", "--tutorial", "study", *options)

    assert 0 == code
    assert [[sys.executable, "-m", "notebook", "study/study.ipynb"]] * calls == called
    if calls and not exit_code:
        assert "" == out
    else:
        assert out.startswith("study/study.ipynb: open it")


def test_folder_that_cannot_be_written_is_told(here, fleet2d, monkeypatch):
    def full(path, content):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tutorials, "write_atomically", full)

    code, _, err = fleet2d("demo", "--tutorial", "study")

    assert 2 == code
    assert "study/study.ipynb can't be written: No space left on device" in err


def test_installed_without_a_clone_the_package_has_them(monkeypatch, tmp_path):
    package = tmp_path / "lib" / "python3" / "fleet2d"
    (package / "docs" / "tutorials").mkdir(parents=True)
    (package / "docs" / "tutorials" / "first.ipynb").touch()
    monkeypatch.setattr(tutorials, "PACKAGE", package)

    assert ["first"] == list(tutorials.sources())


@pytest.mark.parametrize(
    ("name", "told"), [("algorithm", "--out is the folder"), ("", "no tutorial")]
)
def test_what_a_tutorial_can_not_heed_is_told(name, told, here, fleet2d):
    options = ["--out", "lessons"] if name else []
    code, _, err = fleet2d("demo", "--tutorial", name, *options)

    assert (2, True) == (code, told in err)
    assert not list(here.iterdir())
