"""What the docs say in prose and tables, tried with the program: one test for each claim."""

import re
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import pytest
import yaml
from pydantic import TypeAdapter
from tests.pages import text_of as page
from tests.scenes import run, table

import fleet2d
from fleet2d import History, Plan, Present, Situation
from fleet2d.configuration.components import lookup
from fleet2d.configuration.units import AngleDeg, Duration, Length, Share, Speed, TurnRateDeg
from fleet2d.errors import InputError
from fleet2d.expectations.parse import parse_expectation
from fleet2d.interventions.intervention import verbs
from fleet2d.kernels import SUB, TURN
from fleet2d.studies.specification import StudyFile
from fleet2d.testing.claim import rate_test

ROOT = Path(__file__).parent.parent


def rows(text, head) -> Iterator[list[str]]:
    """Yield the cells of the rows of the table whose heading begins so."""
    part = text[text.index(head) :].split("\n\n", 1)[0]
    for row in part.splitlines()[2:]:
        yield [cell.strip() for cell in row.strip().strip("|").split("|")]


def names(cell):
    return re.findall(r"`([a-z_0-9]+)", cell)


@pytest.fixture(scope="module")
def day():
    return fleet2d.run("bundled:paper", "simulation.duration=1 d", seed=4)


# The scenario file


@pytest.mark.parametrize(
    ("quantity", "kind"),
    [
        ("duration", Duration),
        ("length", Length),
        ("speed", Speed),
        ("angle", AngleDeg),
        ("turn rate", TurnRateDeg),
        ("share", Share),
    ],
)
def test_units_of_a_quantity_are_read(quantity, kind):
    cells = next(c for c in rows(page("scenario"), "| quantity |") if c[0].startswith(quantity))
    literals = re.findall(r"`([^`]+)`", cells[2])
    assert literals
    for literal in literals:
        assert TypeAdapter(kind).validate_python(yaml.safe_load(literal)) is not None


def test_only_the_duration_and_the_floor_plan_are_required():
    least = {"simulation": {"duration": "1 min"}, "floorplan": "bundled"}
    assert 60 == fleet2d.load_scenario(least).simulation.steps
    for section in least:
        with pytest.raises(InputError, match="missing"):
            fleet2d.load_scenario({k: v for k, v in least.items() if k != section})


def test_durations_in_mappings_merge_and_as_text_replace():
    base = {"extends": "bundled:paper"}
    merged = fleet2d.load_scenario({**base, "simulation": {"duration": {"hours": 2}}})
    assert timedelta(days=30, hours=2) == merged.simulation.duration
    replaced = fleet2d.load_scenario({**base, "simulation": {"duration": "2 h"}})
    assert timedelta(hours=2) == replaced.simulation.duration


# Concepts


def test_the_lattice_and_headings_have_the_sizes_of_the_page():
    text = page("concepts")
    assert f"{SUB} units to a cell" in text
    assert f"{1000 * 0.05 / SUB:.2f} mm" in text
    assert f"{TURN}ths of a turn" in text


def test_a_run_has_as_many_full_steps_as_fit():
    assert (
        3
        == fleet2d.load_scenario(
            "bundled:paper", "simulation={duration: 25 s, step: 7 s}"
        ).simulation.steps
    )


# What a run stores


def test_columns_of_the_stored_tables_are_those_of_the_page(day):
    text = page("artifacts")
    for name in ("trajectories", "key_frames", "observations", "events"):
        part = text[text.index(f"**{name}**") :]
        columns = [column for cells in rows(part, "| column |") for column in names(cells[0])]
        stored = [c for c in day.tables[name].column_names if c not in ("step", "time")]
        assert set(stored) <= set(columns), name
        optional = {"heading", "posture", "camera", "activity", "true_activity", "time"}
        extra = {c for c in set(columns) - set(stored) if not c.startswith("true_")} - optional
        assert set() == extra, name


def test_columns_with_the_truth_are_there_if_a_camera_can_err():
    cells = next(c for c in rows(page("artifacts"), "| column | unit | |") if "entity" in c[0])
    assert cells
    erring = run({"extends": "bundled:paper"}, "simulation.duration=3 h",
                 "robots.astro.perception={attributes: {range_noise: 5 cm, activity: {}}}", seed=4)  # fmt: skip
    columns = set(erring.tables["observations"].column_names)
    part = page("artifacts")
    part = part[part.index("**observations**") :]
    said = {n for cells in rows(part, "| column |") for n in names(cells[0])}
    assert columns - {"step", "time"} <= said
    assert {"true_user", "true_x", "true_activity", "activity"} <= columns


def test_keys_of_the_manifest_are_those_of_the_page(day):
    part = page("artifacts")
    part = part[part.index("## The manifest") :]
    said = {name for cells in rows(part, "| key | |") for name in names(cells[0])}
    assert said - {"resumed", "seal"} <= set(day.manifest) | {"seal"}
    assert set(day.manifest) <= said


# Behaviors, algorithms, layers, reactions


@pytest.mark.parametrize(
    ("where", "begin", "subject"),
    [
        ("behaviors", "The argument of `decide` tells", Situation),
        ("behaviors", "calls add to it:", Plan),
        ("algorithms", "`history` has what", History),
        ("algorithms", "`state` has", Present),
    ],
)
def test_what_the_page_lists_exists(where, begin, subject):
    has = {*dir(subject), *getattr(subject, "__dataclass_fields__", {})}
    part = page(where).split(begin, 1)[1].split(". ", 1)[0].split(";", 1)[0]
    listed = [name for name in names(part) if name not in {"needs", "looks_back"}]
    assert len(listed) > 4
    assert [] == [name for name in listed if name not in has]


# Commands


def test_json_has_the_keys_of_the_page(fleet2d):
    code, out, _ = fleet2d(
        "run", "bundled:paper", "simulation.duration=10 min", "--json", "--out", "ten"
    )
    shown = re.search(r"```json\n(\{.*?\})\n```", page("cli"), re.DOTALL)
    printed, said = yaml.safe_load(out), yaml.safe_load(shown[1])
    assert 0 == code
    assert set(said) == set(printed)
    assert set(said["wall_s"]) == set(printed["wall_s"])


@pytest.mark.slow
@pytest.mark.parametrize("plan", ["synthetic:7", "family_home"])
def test_commands_that_take_a_floor_plan_take_bundled_and_synthetic_ones(fleet2d, plan):
    assert 0 == fleet2d("validate", plan)[0]
    assert 0 == fleet2d("convert", plan, "plan.json")[0]
    assert 0 == fleet2d("show", plan, "--out", "plan.svg")[0]


@pytest.mark.slow
def test_the_bundled_month_is_as_the_pages_say():
    """Its error of presence after the month, and the rounds that the robot makes."""
    month = run({"extends": "bundled:paper"})
    said = re.search(r"printed by `fleet2d run`: (0\.\d+) after the month", page("presence"))
    assert float(said[1]) == pytest.approx(month.metrics["ltp_error"]["ana"]["tv"], abs=0.0005)


def test_people_of_different_households_ignore_each_other():
    alone = {"ana": {"type": "routine", "persona": "retired"}}
    both = {**alone, "ben": {"type": "routine", "persona": "student"}}
    settings = {"simulation": {"duration": "1 d", "seed": 4}, "robots": {}}
    home = {"floorplan": {"type": "bundled", "furnish": True}}
    ways = [
        table(run({**settings, **home, "users": users}), "key_frames", entity="ana")
        for users in (alone, both)
    ]
    assert ways[0]["x"].tolist() == ways[1]["x"].tolist()


# Interventions, tests, studies, security


def test_messages_of_the_page_of_interventions_are_those_of_the_program(fleet2d):
    """Each wrong value is put into the page's own file; a message ends where the page has …"""
    text = page("interventions")
    scenario = re.search(r"```yaml title=evening.yaml\n(.*?)```", text, re.DOTALL)
    wrong = [
        [("guest: gina,", "guest: gna,")],
        [("{type: find}, ", "")],
        [("[found, astro]", "[docks, astro]"), ("{type: dock}, ", "")],
        [('at: "20:00"', "at: 2 d")],
    ]
    said = re.findall(r"^error: evening.yaml.*$", text, re.MULTILINE)
    for line, changes in zip(said, wrong, strict=True):
        content = scenario[1]
        for old, new in changes:
            assert old in content
            content = content.replace(old, new)
        Path("evening.yaml").write_text(content, encoding="utf-8")
        _, _, message = fleet2d("validate", "evening.yaml")
        assert message.startswith(line.removesuffix(" …"))


def test_interventions_of_the_page_exist():
    text = page("interventions")
    part = text[text.index("## Kinds of interventions") : text.index("## Errors before the run")]
    cells = [line.split("|")[1] for line in part.splitlines() if line.startswith("| `")]
    listed = {name for cell in cells for name in re.findall(r"`([a-z_]+)(?::|`)", cell)}
    arguments = {"find", "dock", "behavior", "rooms", "values"}
    assert set() == listed - set(verbs()) - arguments
    assert set(verbs()) - listed == {"decide", "drive", "switch_on"}  # by Python alone


def test_rates_that_seeds_can_tell_apart_are_as_the_page_says():
    text = page("product-tests")
    said = re.search(r"30 tell 90 % from (\d+) %, 100 from (\d+) %, 300 from (\d+) %", text)
    for seeds, percent in zip((30, 100, 300), said.groups(), strict=True):
        assert int(percent) == round(100 * rate_test(seeds, 0.9).alternative)
    assert f"{100 * rate_test(100, 0.9).alternative:.1f} %" in text
    assert f"{100 * rate_test(100, 0.95).alternative:.1f} %" in text


def test_keys_of_a_study_are_those_of_the_page():
    said = {n for cells in rows(page("studies"), "| key | |") for n in names(cells[0])}
    assert set(StudyFile.model_fields) == said


def test_what_the_paper_page_says_of_the_feedback_loop_is_in_its_table():
    """The error of `likelihood` where all rooms are looked into, and of `audit_only` with rounds."""
    text = page("paper")
    errors = {
        cells[0]: [float(cell.split()[0]) for cell in cells[1:]]
        for cells in rows(text, "| robot | sighting share |")
    }
    likelihood = {robot: line[3] for robot, line in errors.items()}
    least = likelihood.pop("hangout, 10 % of moves at random")
    assert "stays at 0.04 to 0.07" in text
    assert all(0.035 <= error < 0.075 for error in likelihood.values())
    assert least == pytest.approx(0.29, abs=0.01)
    clock = errors["hangout, 10 % rounds by the clock"]
    assert f"is as good ({clock[2]:.3f} and {clock[3]:.3f})" in text
    assert min(errors["hangout, 10 % of moves at random"]) == least


# Homes, expectations


def test_keys_of_floor_plans_are_those_of_the_page():
    for cells in rows(page("floorplans"), "| type | keys |"):
        (kind,) = names(cells[0])
        model = lookup("floorplan", kind)
        assert set(names(cells[1])) <= set(model.model_fields), kind


def test_the_bundled_home_is_as_large_as_the_page_says():
    said = re.search(r"a home of (\d+) m² and (\d+) rooms", page("floorplans"))
    plan = fleet2d.load_floorplan()
    assert (round(plan.area_m2), len(plan.rooms)) == (int(said[1]), int(said[2]))


def test_expectations_of_the_page_are_read():
    text = page("expectations")
    written = [
        re.findall(r"`([^`]+)`", cells[1])[0] for cells in rows(text, "| to expect that | write |")
    ]
    assert len(written) > 10
    assert all(parse_expectation(each) is not None for each in written)
