"""Readings of sensors are labelled by the activity during which they come."""

from fleet2d.logs.layouts.intervals import label_by_activities
from fleet2d.logs.log import AWAY, Reading

SLEEP = Reading(0, 100, "bedroom", "sleep", 1)
TOILET = Reading(40, 50, "bathroom", "toilet", 2)
OUT = Reading(120, 150, AWAY, "leaving", 3)


def labels(*at):
    """The activities of instants of a sensor."""
    sensors = [Reading(time, time, "bed", "", 1) for time in at]
    readings = label_by_activities(sensors, [SLEEP, TOILET, OUT])
    return [reading.activity for reading in readings if reading.room == "bed"]


def test_who_gets_up_at_night_sleeps_on_afterwards():
    """In a real home 2,204 of 5,127 readings lost "sleeping", as a visit to the toilet had ended."""
    assert ["sleep", "toilet", "toilet", "sleep", "sleep", ""] == labels(0, 40, 50, 51, 100, 101)


def test_readings_out_of_order_have_the_labels_of_their_times():
    assert labels(20, 45, 60) == labels(60, 20, 45)


def test_an_activity_that_another_outlasts_ends_beneath_it():
    cooking, eating = (
        Reading(0, 60, "kitchen", "cook", 1),
        Reading(50, 90, "kitchen", "eat", 2),
    )
    sensor = Reading(80, 80, "kitchen", "", 1)

    assert ["eat"] == [each.activity for each in label_by_activities([sensor], [cooking, eating])]


def test_absences_are_readings_and_come_last_of_a_moment():
    door = Reading(120, 120, "hallway", "", 1)

    assert ["hallway", AWAY] == [each.room for each in label_by_activities([door], [OUT])]
