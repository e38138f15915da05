"""Components: frozen configuration beside free run state, and finding classes by name."""

import copy
import pickle
import subprocess
import sys
from importlib.metadata import EntryPoint, EntryPoints
from typing import Annotated, ClassVar

import pytest
from pydantic import Field, PydanticUserError, TypeAdapter, ValidationError
from tests.own_errors import Missed

from fleet2d.configuration.built_in import COMPONENTS
from fleet2d.configuration.components import (
    Component,
    OneOf,
    Settings,
    ShortForm,
    components,
    kind_at,
    lookup,
    split_short_form,
)
from fleet2d.configuration.importing import import_class
from fleet2d.configuration.units import Duration, Length, Text
from fleet2d.errors import ScenarioError


class Gadget(Component):
    """Base of a kind for these tests."""

    kind: ClassVar[str] = "gadget"
    cell: Length = 0.05


class Lamp(Gadget):
    """A lamp."""

    watts: int = Field(default=5, gt=0)
    warm_up: Duration = "1 min"


class Fan(Gadget):
    """A fan."""

    blades: tuple[int, ...]


class Shelf(Settings):
    """Holds gadgets."""

    top: OneOf[Gadget]
    others: tuple[OneOf[Gadget], ...] = ()


@pytest.fixture(autouse=True)
def gadgets(monkeypatch):
    names = {"lamp": Lamp, "light": Lamp, "fan": Fan}
    paths = {name: f"{__name__}:{cls.__name__}" for name, cls in names.items()}
    monkeypatch.setitem(COMPONENTS, "gadget", paths)
    for name in ("fan", "lamp"):
        monkeypatch.setattr(names[name], "type_name", name)
    yield
    sys.modules.pop("own", None)
    sys.modules.pop("helpers", None)


def errors(model, data):
    with pytest.raises(ValidationError) as caught:
        TypeAdapter(model).validate_python(data)
    return {".".join(map(str, e["loc"])): e["msg"] for e in caught.value.errors()}


def test_configuration_is_frozen():
    with pytest.raises(AttributeError) as caught:
        Lamp().watts = 7
    assert str(caught.value) == (
        "watts is configuration of Lamp and can't be changed in a run; store what changes in "
        "another attribute"
    )


def test_class_variables_cannot_be_shadowed():
    with pytest.raises(AttributeError):
        Lamp().type_name = "torch"


@pytest.mark.parametrize(
    ("field", "message"),
    [
        ("user = 'mia'", "`user = 'mia'`. All model fields require a type annotation"),
        ("rest = None", "`rest = None`. All model fields require a type annotation"),
        ("watts = 7", "Field 'watts' defined on a base class was overridden"),
        ("to: object.__class__.__call__ = 3", "Unable to generate pydantic-core schema"),
    ],
)
def test_field_that_is_no_configuration_is_an_error_of_its_class(field, message):
    with pytest.raises(PydanticUserError) as caught:
        exec(f"class Guard(Lamp):\n    {field}", {"Lamp": Lamp})
    assert message in str(caught.value)


def test_run_state_is_free_copied_and_not_dumped():
    lamp = Lamp()
    lamp.seen = [1]
    twin = copy.deepcopy(lamp)
    twin.seen.append(2)

    assert [1] == lamp.seen
    assert [1, 2] == twin.seen
    assert lamp == twin
    assert {"cell": 0.05, "watts": 5, "warm_up": "1 min"} == lamp.model_dump(mode="json")


def test_unknown_key_names_the_nearest_and_all():
    assert errors(Lamp, {"wats": 3}) == {
        "wats": "unknown key 'wats': did you mean 'watts'? Allowed here: cell, warm_up, watts"
    }


def test_lookup_by_name_and_alias():
    assert Lamp is lookup("gadget", "lamp") is lookup("gadget", "light")
    assert {"fan": Fan, "lamp": Lamp} == components("gadget")


def test_lookup_of_an_unknown_name_lists_what_exists():
    with pytest.raises(ScenarioError, match=r"'lmap': did you mean 'lamp'\? There are: fan, lamp"):
        lookup("gadget", "lmap")


@pytest.mark.parametrize("kind", COMPONENTS)
def test_every_class_of_the_table_is_of_its_kind_and_knows_its_name(kind):
    types = components(kind)

    assert all(cls.kind == kind for cls in types.values())
    assert all(lookup(kind, name) is types[cls.type_name] for name, cls in types.items())
    assert {lookup(kind, name).type_name for name in COMPONENTS[kind]} <= set(types)


def test_class_of_a_plugin_that_nobody_looked_up_is_dumped_by_its_name(monkeypatch):
    path = f"{__name__}:Lamp"
    entry = EntryPoint("torch", path, "fleet2d.gadget")
    monkeypatch.setattr(Lamp, "type_name", path)
    monkeypatch.setattr(
        "fleet2d.configuration.components._plugins", lambda kind: EntryPoints([entry])
    )

    assert "torch" == Shelf(top=Lamp()).model_dump()["top"]["type"]


def test_builtin_component_is_found_without_an_import():
    code = "from fleet2d.configuration.components import lookup; print(lookup('behavior', 'patrol').type_name)"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )

    assert "patrol" == result.stdout.strip()


OWN = """
from typing import ClassVar
from fleet2d.configuration.components import Component
from {dots}helpers import SIZE

class Own(Component):
    kind: ClassVar[str] = "gadget"
    size: int = SIZE
"""


@pytest.fixture
def folders(tmp_path):
    """Two scenario folders with equally named modules that differ."""
    for number in (1, 2):
        folder = tmp_path / str(number)
        (folder / "parts").mkdir(parents=True)
        (folder / "helpers.py").write_text(f"SIZE = {number}")
        (folder / "parts" / "helpers.py").write_text(f"SIZE = {number * 10}")
        (folder / "own.py").write_text(OWN.format(dots=""))
        (folder / "parts" / "own.py").write_text(OWN.format(dots="."))
    return tmp_path / "1", tmp_path / "2"


@pytest.mark.parametrize(("name", "factor"), [("own:Own", 1), ("parts.own:Own", 10)])
def test_equal_module_names_of_two_folders_stay_apart(folders, name, factor):
    first, second = (lookup("gadget", Text(name, folder)) for folder in folders)

    assert (factor, 2 * factor) == (first().size, second().size)
    assert first is lookup("gadget", Text(name, folders[0]))
    assert "helpers" not in sys.modules


def test_own_component_is_found_again_by_the_name_it_dumps(folders):
    cls = lookup("gadget", Text("parts.own:Own", folders[1]))

    assert f"{folders[1]}/parts.own:Own" == cls.type_name
    assert cls is lookup("gadget", cls.type_name)


def test_own_component_copies_and_pickles(folders):
    own = lookup("gadget", Text("own:Own", folders[1]))()

    assert own == copy.deepcopy(own) == pickle.loads(pickle.dumps(own))


def test_module_that_is_imported_already_is_not_loaded_twice(folders, monkeypatch):
    monkeypatch.syspath_prepend(folders[0])
    import own

    assert own.Own is lookup("gadget", Text("own:Own", folders[0]))
    assert own.Own is not lookup("gadget", Text("own:Own", folders[1]))
    assert own.Own is lookup("gadget", Text("own.py:Own", folders[0]))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nowhere:Own", "no module named 'nowhere' in"),
        ("own:Missing", "own.py has no class 'Missing'. It has: Own"),
        ("own:Onw", "own.py has no class 'Onw': did you mean 'Own'? It has: Own"),
        ("parts.own:Onw", "parts/own.py has no class 'Onw'"),
        ("helpers:Own", "helpers.py has no class 'Own'. It defines no class"),
        ("onw:Own", "or installed: did you mean 'own'?"),
        ("parts.onw:Own", "did you mean 'parts.own'?"),
        ("code.py:InteractiveInterpreter", "there is no code.py in"),
        ("parts/code:InteractiveInterpreter", "there is no code.py in"),
        ("onw.py:Own", ": did you mean 'own'?"),
        ("broken:Own", "can't import 'broken:Own': broken.py:1: ZeroDivisionError: division by"),
        ("unparsable:Own", "can't import 'unparsable:Own': unparsable.py:1: SyntaxError: "),
        ("needs:Own", "needs.py:2: ModuleNotFoundError: No module named 'nowhere'"),
        ("wrong:Own", "wrong.py:1: ImportError: cannot import name 'X' from 'helpers'"),
        (
            "untyped:Own",
            "untyped.py:2: PydanticUserError: A non-annotated attribute was detected: `user = 'mia'`",
        ),
        ("later:Own", "'later:Own' has a field whose type can't be found"),
        ("own.py:Own:x", "write module:Class"),
        ("pathlib:Path", "'pathlib:Path' is not a gadget"),
        ("fleet2d.configuration.components:Component", "is not a gadget"),
        ("fleet2d.floorplan.source:FloorPlanSource", "is not a gadget"),
        (":", "can't import ':'"),
    ],
)
def test_own_component_that_cannot_be_had_is_explained(folders, name, message):
    (folders[0] / "broken.py").write_text("1 / 0")
    (folders[0] / "unparsable.py").write_text("class Own(")
    (folders[0] / "needs.py").write_text("import sys\nimport nowhere")
    (folders[0] / "wrong.py").write_text("from .helpers import X")
    head = "from fleet2d.configuration.components import Component\nclass Own(Component):\n    "
    (folders[0] / "untyped.py").write_text(f"{head}user = 'mia'")
    (folders[0] / "later.py").write_text(
        f"from __future__ import annotations\n{head}kind: ClassVar[str] = 'gadget'\n    user: Nowhere".replace(
            "class Own", "from typing import ClassVar\nclass Own"
        )
    )

    with pytest.raises(ScenarioError) as caught:
        lookup("gadget", Text(name, folders[0]))
    assert message in str(caught.value)
    assert "fleet2d_scenario" not in str(caught.value)
    assert str(folders[0]) not in sys.path


def test_component_that_lacks_a_method_is_refused():
    with pytest.raises(ScenarioError, match="is an incomplete floorplan: it lacks load"):
        lookup("floorplan", "fleet2d.floorplan.source:FloorPlanSource")


def test_one_of_reads_a_mapping_a_name_and_an_instance():
    fan = Fan(blades=(1,))
    shelf = Shelf.model_validate({"top": {"type": "light", "watts": 3}, "others": ["lamp", fan]})

    assert Lamp(watts=3) == shelf.top
    assert (Lamp(), fan) == shelf.others


def test_one_of_dumps_what_validates_to_an_equal_model():
    shelf = Shelf(top=Fan(blades=(1, 2)), others=(Lamp(warm_up="90 s"),))
    dumped = shelf.model_dump(mode="json")

    assert {"type": "fan", "cell": 0.05, "blades": [1, 2]} == dumped["top"]
    assert "90 s" == dumped["others"][0]["warm_up"]
    assert shelf == Shelf.model_validate(dumped)


def test_one_of_places_nested_errors():
    assert errors(
        Shelf,
        {
            "top": {"type": "fan", "blades": [1, "x"], "speed": 3},
            "others": ["lmap", {"watts": 0}, {"type": "lamp", "watts": 0}, 3, Shelf],
        },
    ) == {
        "top.blades.1": "Input should be a valid integer, unable to parse string as an integer",
        "top.speed": "unknown key 'speed'. Allowed here: blades, cell",
        "others.0.type": "there is no gadget 'lmap': did you mean 'lamp'? There are: fan, lamp; "
        "your own is written 'package.module:Class'",
        "others.1.type": "'type' is needed to tell which gadget this is: fan, lamp",
        "others.2.watts": "Input should be greater than 0",
        "others.3": "expected a mapping with 'type', or the name of a type, got 3",
        "others.4": f"expected a mapping with 'type', or the name of a type, got {Shelf}",
    }


def test_one_of_refuses_an_instance_of_another_kind():
    class Stranger(Component):
        kind: ClassVar[str] = "stranger"

    assert errors(Shelf, {"top": Stranger()}) == {"top": "expected a gadget, got a Stranger"}


__all__ = ["gadgets"]  # a fixture


class Body(Settings):
    """What an entity looks like to the short form."""

    radius: Length = 0.2
    behaviors: tuple[OneOf[Gadget], ...] = ()


SHORT = Annotated[Body, ShortForm()]


class House(Settings):
    """Has gadgets in every form of a field."""

    shelves: dict[str, Shelf]
    bodies: dict[str, SHORT]
    spare: OneOf[Gadget] | None = None


@pytest.mark.parametrize(
    ("path", "kind"),
    [
        ("spare", "gadget"),
        ("spare.cell", None),
        ("shelves.a", None),
        ("shelves.a.top", "gadget"),
        ("shelves.a.others", None),
        ("shelves.a.others.0", "gadget"),
        ("shelves.a.unknown", None),
        ("bodies.b", "gadget"),
        ("bodies.b.behaviors.1", "gadget"),
        ("bodies.b.radius", None),
        ("nothing.at.all", None),
    ],
)
def test_kind_at_a_path_is_that_of_the_field(path, kind):
    assert kind == kind_at(House, path.split("."))


@pytest.mark.parametrize(
    ("written", "split"),
    [
        ({"type": "lamp", "radius": 1, "watts": 2},
         {"radius": 1, "behaviors": [{"type": "lamp", "watts": 2}]}),
        ("lamp", {"behaviors": ["lamp"]}),
        ({"radius": 1}, {"radius": 1}),
        ({"behaviors": ["lamp"]}, {"behaviors": ["lamp"]}),
        (3, 3),
    ],
)  # fmt: skip
def test_split_short_form(written, split):
    assert split == split_short_form(written, ["radius"])


def test_short_form_errors_name_keys_as_written():
    assert errors(SHORT, {"type": "lamp", "radius": "x", "watts": 0, "radiu": 1}) == {
        "radius": "expected a length, got 'x': write a number in m, or like '0.2 m', '20 cm', '5 mm'",
        "watts": "Input should be greater than 0",
        "radiu": "unknown key 'radiu': did you mean 'radius'? "
        "Allowed here: cell, radius, warm_up, watts",
    }
    assert ["type"] == list(errors(SHORT, {"type": "lmap"}))


def test_short_form_beside_behaviors_is_refused():
    assert errors(SHORT, {"type": "lamp", "behaviors": []}) == {
        "behaviors": "give 'type' (one behavior) or 'behaviors', not both"
    }


def test_file_beside_the_scenario_takes_no_plugin_s_place(tmp_path, monkeypatch):
    beside = tmp_path / "tests" / "own_errors.py"
    beside.parent.mkdir()
    beside.write_text("raise SystemExit('code beside the scenario runs')", encoding="utf-8")
    monkeypatch.chdir(tmp_path)

    assert Missed is import_class("tests.own_errors:Missed", is_plugin=True)


def test_plugin_whose_package_is_gone_is_no_component(monkeypatch):
    entry = EntryPoint("fox", "no_such_package.foxes:Fox", "fleet2d.gadget")
    monkeypatch.setattr(
        "fleet2d.configuration.components._plugins", lambda kind: EntryPoints([entry])
    )

    assert ["fan", "lamp"] == list(components("gadget"))
    with pytest.raises(ScenarioError, match="there is no gadget 'fox'"):
        lookup("gadget", "fox")


def test_type_in_a_module_of_another_name_loads_that_module_alone():
    code = (
        "import sys\n"
        "from fleet2d.configuration.components import lookup\n"
        "lookup('metric', 'stays')\n"
        "print(*sorted(m for m in sys.modules if m.startswith('fleet2d.metrics.')))"
    )

    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert "fleet2d.metrics.bodies fleet2d.metrics.metric\n" == done.stdout
