"""Descriptions of fields: taken from docstrings, also those of base classes."""

from pydantic import Field

from fleet2d.configuration.components import Settings, components


class Lamp(Settings):
    """A lamp.

    It hangs.

    Attributes:
        power, most: Its power: what it takes
            on two lines [W].
        color: Its color.

    Raises:
        OSError: None of its fields.
    """

    power: float = 1.0
    most: float = 2.0
    color: str = Field(default="red", description="in pictures")


class Torch(Lamp):
    """A torch.

    Attributes:
        most: Its maximum.
    """

    battery: int = 3


def properties_of(cls: type[Settings]):
    return {
        name: schema.get("description")
        for name, schema in cls.model_json_schema()["properties"].items()
    }


def test_schema_has_them_but_for_fields_with_a_description_of_their_own():
    assert properties_of(Torch) == {
        "power": "Its power: what it takes on two lines [W].",
        "most": "Its maximum.",
        "color": "in pictures",
        "battery": None,
    }
    assert Lamp.model_json_schema()["description"] == "A lamp.\n\nIt hangs."


def test_settings_of_algorithms_are_described():
    for name, cls in components("algorithm").items():
        assert [name, []] == [name, [key for key, text in properties_of(cls).items() if not text]]
