"""Composition: extending files, overrides, and what a changed type leaves behind."""

import pytest

from fleet2d.configuration.components import kind_at
from fleet2d.errors import ScenarioError
from fleet2d.scenario import compose as compose_module
from fleet2d.scenario.compose import compose
from fleet2d.scenario.model import Scenario

pytestmark = pytest.mark.usefixtures("stand_ins")

BASE = {
    "simulation": {"duration": {"days": 30}, "seed": 4},
    "floorplan": {"type": "houseexpo", "path": "plan.json", "cell": 0.1, "border": 2},
    "users": {"ana": {"type": "tour", "radius": 0.3, "stops": ["hall"]}, "ben": "drift"},
    "robots": {"astro": {"behaviors": ["drift", {"type": "tour", "dwell": 9}]}},
    "algorithms": {"count": {"margin": 0.9}},
}


@pytest.mark.parametrize(
    ("overrides", "section", "expected"),
    [
        (["simulation.duration.days=60"], "simulation", {"duration": {"days": 60}, "seed": 4}),
        (["simulation.seed=5", "simulation.seed=6"], "simulation",
         {"duration": {"days": 30}, "seed": 6}),
        (["simulation.seed=null"], "simulation", {"duration": {"days": 30}, "seed": None}),
        (["floorplan.type=empty"], "floorplan", {"type": "empty", "cell": 0.1}),
        (["floorplan=empty"], "floorplan", {"type": "empty", "cell": 0.1}),
        (["floorplan.type=empty", "floorplan.path=x"], "floorplan",
         {"type": "empty", "cell": 0.1, "path": "x"}),
        (["floorplan.width=3", "floorplan.type=empty"], "floorplan",
         {"type": "empty", "cell": 0.1, "width": 3}),
        (["users.ana=null"], "users", {"ben": "drift"}),
        (["users=null"], "users", None),
        (["users.ana.type=drift", "users.ben=tour"], "users",
         {"ana": {"type": "drift", "radius": 0.3}, "ben": "tour"}),
        (["users.ana.behaviors=[drift]"], "users",
         {"ana": {"radius": 0.3, "behaviors": ["drift"]}, "ben": "drift"}),
        (["users.cy={type: drift, sigma: 2}"], "users",
         {**BASE["users"], "cy": {"type": "drift", "sigma": 2}}),
        (["users.ben.sigma=1"], "users", {**BASE["users"], "ben": {"type": "drift", "sigma": 1}}),
        (["robots.astro.type=drift"], "robots", {"astro": {"type": "drift"}}),
        (["robots.astro.behaviors.1.dwell=5 min"], "robots",
         {"astro": {"behaviors": ["drift", {"type": "tour", "dwell": "5 min"}]}}),
        (["robots.astro.behaviors.1.type=drift"], "robots",
         {"astro": {"behaviors": ["drift", {"type": "drift"}]}}),
        (["robots.astro.behaviors.0.sigma=1"], "robots",
         {"astro": {"behaviors": [{"type": "drift", "sigma": 1}, {"type": "tour", "dwell": 9}]}}),
        (["algorithms.count.type=smooth"], "algorithms", {"count": {"type": "smooth"}}),
        (["algorithms.count.type=count"], "algorithms",
         {"count": {"type": "count", "margin": 0.9}}),
        (["users.ana.color=#d62728"], "users",
         {**BASE["users"], "ana": {**BASE["users"]["ana"], "color": "#d62728"}}),
    ],
)  # fmt: skip
def test_overrides_change_a_scenario(overrides, section, expected):
    assert expected == compose(BASE, overrides).data.get(section)


def test_composition_leaves_its_source_as_it_was():
    before = repr(BASE)
    compose(BASE, ["floorplan.type=empty", "users.ana=null", "robots.astro.behaviors.0=tour"])

    assert before == repr(BASE)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("seed", "override 'seed': expected key.path=value, but there is no '='"),
        ("=4", "override '=4': a part of its key is empty"),
        ("a..b=4", "override 'a..b=4': a part of its key is empty"),
        ("a=", "override 'a=': no value; write a=null to delete an entry"),
        ("a=[1", "override 'a=[1': not valid YAML"),
        ("users.anna=null", "override 'users.anna=null': users.anna: null deletes an entry, and "
         "there is none of this name: did you mean 'ana'? There are: ana, ben"),
        ("robots.astro.behaviors.2.dwell=1", "there is no robots.astro.behaviors.2: the list has "
                                             "2 entries, and the first is 0"),
        ("robots.asto.speed=0.3", "override 'robots.asto.speed=0.3': there is no robots.asto: did "
         "you mean 'astro'? There are: astro; to add one give robots.asto.type, too"),
        ("users.anna.camera.range=[0, 3]", "there is no users.anna: did you mean 'ana'?"),
        ("algorithms.cuont.margin=1", "did you mean 'count'? There are: count;"),
        ("metrics.tally.of=x", "there is no metrics.tally. There are: none; to add one"),
    ],
)  # fmt: skip
def test_override_that_makes_no_sense_is_refused(override, message):
    with pytest.raises(ScenarioError) as caught:
        compose(BASE, [override])
    assert message in str(caught.value)


def write(folder, **files):
    for name, content in files.items():
        file = folder / f"{name}.yaml"
        file.parent.mkdir(exist_ok=True)
        file.write_text(content)
    return folder


def test_files_extend_files(tmp_path):
    write(tmp_path, base="simulation: {seed: 1, step: 1 s}\nusers: {ana: drift, ben: drift}")
    write(tmp_path, night="simulation: {start: 2026-01-05T22:00:00}")
    write(
        tmp_path / "sub",
        home="extends: [../base.yaml, ../night.yaml]\nsimulation: {seed: 2}\nusers: {ana: null}",
    )
    data = compose(tmp_path / "sub" / "home.yaml").data

    assert ["seed", "step", "start"] == list(data["simulation"])
    assert 2 == data["simulation"]["seed"]
    assert {"ben": "drift"} == data["users"]


def test_extended_file_can_change_a_type(tmp_path):
    write(tmp_path, base="floorplan: {type: houseexpo, path: plan.json, cell: 0.1}")
    write(tmp_path, home="extends: base.yaml\nfloorplan: {type: empty, width: 3}")

    assert {"type": "empty", "cell": 0.1, "width": 3} == compose(tmp_path / "home.yaml").data[
        "floorplan"
    ]


def test_class_that_stays_the_same_is_not_imported(tmp_path, monkeypatch):
    write(tmp_path, base="floorplan: {type: 'mine:House', width: 3}")
    write(tmp_path, home="extends: base.yaml\nfloorplan: {type: 'mine:House', cell: 0.1}")
    looked_up = []
    monkeypatch.setattr(compose_module, "lookup", lambda _, name: looked_up.append(name))

    assert {"type": "mine:House", "width": 3, "cell": 0.1} == compose(tmp_path / "home.yaml").data[
        "floorplan"
    ]
    assert [] == looked_up


def test_text_keeps_the_folder_of_the_file_it_came_from(tmp_path, monkeypatch):
    write(tmp_path / "a", base="floorplan: {type: houseexpo, path: plan.json}\nname: x")
    write(tmp_path / "b", home="extends: ../a/base.yaml\nname: y")
    monkeypatch.chdir(tmp_path)
    data = compose("b/home.yaml", ["floorplan.note=z"]).data

    assert (tmp_path / "a").resolve() == data["floorplan"]["path"].folder.resolve()
    assert (tmp_path / "b").resolve() == data["name"].folder.resolve()
    assert tmp_path == data["floorplan"]["note"].folder


def test_places_follow_what_was_merged(tmp_path, monkeypatch):
    write(tmp_path, base="simulation:\n  seed: 1\n  step: 1 s\nusers: {ana: drift}")
    write(tmp_path, home="extends: base.yaml\nsimulation:\n  seed: 2")
    monkeypatch.chdir(tmp_path)
    document = compose("home.yaml", ["users.ana.radius=1"], {("simulation", "speedup"): 3})

    assert "home.yaml:3" == document.place(("simulation", "seed"))
    assert "base.yaml:3" == document.place(("simulation", "step"))
    assert "override 'users.ana.radius=1'" == document.place(("users", "ana", "radius"))
    changed = "base.yaml:4, changed by override 'users.ana.radius=1'"
    assert changed == document.place(("users", "ana")) == document.place(("users", "ana", "x"))
    assert "argument speedup=3" == document.place(("simulation", "speedup"))


def test_entry_left_empty_by_mistake_is_not_dropped_silently(tmp_path):
    write(tmp_path, home="metrics:\n  tally:\n")

    with pytest.raises(ScenarioError, match=r"home.yaml:2: metrics.tally: null deletes an entry"):
        compose(tmp_path / "home.yaml")


def test_cycle_is_named(tmp_path, monkeypatch):
    write(tmp_path, a="extends: b.yaml", b="extends: c.yaml", c="name: x\nextends: [a.yaml]")
    monkeypatch.chdir(tmp_path)

    with pytest.raises(ScenarioError) as caught:
        compose("a.yaml")
    assert str(caught.value) == (
        "a.yaml:1: extends: b.yaml:1: extends: c.yaml:2: extends: "
        "a.yaml extends itself: a.yaml → b.yaml → c.yaml → a.yaml"
    )


@pytest.mark.parametrize(
    ("extends", "message"),
    [
        ("gone.yaml", "home.yaml:1: extends: there is no file"),
        ("3", "home.yaml:1: extends: expected the path of a YAML file, got 3"),
        ("bundled:bse", "home.yaml:1: extends: no scenario 'bse' is bundled: did you mean 'base'?"),
    ],
)
def test_extending_what_is_not_there_is_refused(tmp_path, monkeypatch, extends, message):
    monkeypatch.setattr(compose_module, "BUNDLED", write(tmp_path / "bundled", base="name: x"))
    monkeypatch.chdir(write(tmp_path, home=f"extends: {extends}"))

    with pytest.raises(ScenarioError) as caught:
        compose("home.yaml")
    assert message in str(caught.value)


def test_the_former_name_of_the_papers_scenario_leads_to_its_name_of_today():
    with pytest.raises(
        ScenarioError, match=r"^no scenario 'base' is bundled: write bundled:paper$"
    ):
        compose("bundled:base")
    assert compose("bundled:paper").data


@pytest.mark.parametrize("source", [None, "bundled:family", {"extends": "bundled:family"}])
def test_bundled_scenario_is_found_by_name(tmp_path, monkeypatch, source):
    monkeypatch.setattr(compose_module, "BUNDLED", write(tmp_path, family="artifacts: {a: 1}"))

    assert {"artifacts": {"a": 1}} == compose(source).data


def test_name_is_not_inherited(tmp_path):
    write(tmp_path, base="name: base\nusers: {ana: drift}", home="extends: base.yaml")
    write(tmp_path, own="extends: base.yaml\nname: mine")

    assert "name" not in compose(tmp_path / "home.yaml").data
    assert "mine" == compose(tmp_path / "own.yaml").data["name"]
    assert "base" == compose(tmp_path / "base.yaml", ["users.ana.sigma=1"]).data["name"]


def test_setting_inside_an_entry_that_is_not_there_is_refused():
    with pytest.raises(ScenarioError, match=r"there is no robots.asto: did you mean 'astro'"):
        compose(BASE, (), {("robots", "asto", "speed"): 0.3})


@pytest.mark.parametrize(
    ("overrides", "entry"),
    [
        (["robots.bolt=drift"], "drift"),
        (["robots.bolt={radius: 0.1}"], {"radius": 0.1}),
        (["robots.bolt={radius: 0.1}", "robots.bolt.speed=1"], {"radius": 0.1, "speed": 1}),
        (["robots.bolt.speed=1", "robots.bolt.type=drift"], {"type": "drift", "speed": 1}),
        (["robots.bolt.behaviors=[drift]"], {"behaviors": ["drift"]}),
        (["robots={bolt: {}}", "robots.bolt.speed=1"], {"speed": 1}),
    ],
)
def test_override_adds_an_entry_that_it_declares(overrides, entry):
    assert entry == compose(BASE, overrides).data["robots"]["bolt"]


@pytest.mark.parametrize(
    ("path", "kind"),
    [
        ("floorplan", "floorplan"),
        ("users.ana", "behavior"),
        ("robots.astro.behaviors.0", "behavior"),
        ("robots.astro.behaviors", None),
        ("algorithms.ltp", "algorithm"),
        ("metrics.error", "metric"),
        ("sight.method", "sight"),
        ("robots.astro.perceives", "evidence_source"),
        ("robots.astro.cameras.top.perception.errors.outliers", "perception_error"),
        ("users.ana.answers", "answers"),
        ("simulation", None),
    ],
)
def test_kind_of_a_component_is_that_of_its_place(path, kind):
    assert kind == kind_at(Scenario, path.split("."))
