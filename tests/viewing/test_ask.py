"""Questions to the page, against the tables of the run evaluated step by step."""

from datetime import timedelta

import numpy as np
import pytest

import fleet2d

from .browser import page_at
from .test_browser import served

HOURS = 30
STEPS = HOURS * 3600
JOIN_S = 6
"""Sightings that are up to this far apart are one."""
OUT = {"type": "routine", "persona": "works_outside"}
ROBOT = {"type": "patrol", "camera": {}}
EYES = {"type": "patrol", "cameras": {"low": {}, "back": {"heading_deg": 180}}}

RUNS = {
    "prefixes": {
        "users": {"ann": OUT, "anna": OUT, "ann_lee": {"type": "meander"}},
        "robots": {"astro": ROBOT, "astro2": EYES},
    },
    "grammar": {
        "users": {"seen": OUT, "in": {"type": "meander"}, "night": OUT},
        "robots": {"by": ROBOT, "last": EYES},
    },
    "capitals": {
        "users": {"Bob": OUT, "bob": {"type": "meander"}, "x-1": OUT, "day": OUT},
        "robots": {"R2D2": EYES},
    },
}  # fmt: skip


class Steps:
    """The truth of a run at each step."""

    def __init__(self, run):
        self.run = run
        self.rooms = {room.index: room for room in run.plan.rooms}
        table = run.tables["observations"].to_pylist()
        self.seen = [(row["robot"], row["user"], row["step"]) for row in table]

    def at(self, name, *places):
        path = self.run.path(name, timedelta(seconds=1))
        indices = [i for i, room in self.rooms.items() if {room.name, room.type} & set(places)]
        if "home" in places:
            indices = list(self.rooms)
        is_there = np.isin(path.room[:STEPS], indices) & ~path.away[:STEPS]
        return is_there | (path.away[:STEPS] if "away" in places else False)

    def sees(self, robot, user):
        """Say when robots noticed somebody; gaps of each pair of up to 6 s are none."""
        result = np.zeros(STEPS, np.bool_)
        for pair in {(r, u) for r, u, _ in self.seen}:
            if (robot or pair[0], user or pair[1]) != pair:
                continue
            steps = sorted({step for r, u, step in self.seen if (r, u) == pair})
            for i, step in enumerate(steps):
                is_near = i > 0 and step - steps[i - 1] <= JOIN_S
                result[steps[i - 1] if is_near else step : step + 1] = True
        return result

    def doing(self, name, activity):
        rows = self.run.tables["events"].to_pylist()
        own = [r for r in rows if r["event"] == "activity" and r["entity"] == name]
        result = np.zeros(STEPS, np.bool_)
        for row, following in zip(own, [*own[1:], {"step": STEPS}], strict=True):
            if row["detail"] == activity:
                result[row["step"] : following["step"]] = True
        return result


def stretches(holds):
    edges = np.diff(np.concatenate([[0], holds.astype(np.int8), [0]]))
    begins, ends = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
    return list(zip(begins.tolist(), ends.tolist(), strict=True))


def longer(holds, seconds):
    result = np.zeros_like(holds)
    for begin, end in stretches(holds):
        result[begin:end] = end - begin > seconds
    return result


def within(holds, first, end):
    result = np.zeros_like(holds)
    result[first:end] = holds[first:end]
    return result


QUESTIONS = {
    "prefixes": {
        "ann in kitchen": lambda s: s.at("ann", "kitchen"),
        "Ann Lee in Living_Room": lambda s: s.at("ann_lee", "living_room"),
        "ann not in bedroom": lambda s: ~s.at("ann", "bedroom"),
        "anna away": lambda s: s.at("anna", "away"),
        "ann is in the bedroom_1": lambda s: s.at("ann", "bedroom_1"),
        "ann and anna in bedroom": lambda s: s.at("ann", "bedroom") & s.at("anna", "bedroom"),
        "ann or anna in kitchen": lambda s: s.at("ann", "kitchen") | s.at("anna", "kitchen"),
        "ann in kitchen or bathroom": lambda s: s.at("ann", "kitchen", "bathroom"),
        "ann and astro in bedroom": lambda s: s.at("ann", "bedroom") & s.at("astro", "bedroom"),
        "ann in bathroom > 3 min": lambda s: longer(s.at("ann", "bathroom"), 180),
        "seen ann": lambda s: s.sees(None, "ann"),
        "ann lee not seen": lambda s: ~s.sees(None, "ann_lee"),
        "seen ann by astro": lambda s: s.sees("astro", "ann"),
        "astro2 sees anna": lambda s: s.sees("astro2", "anna"),
        "seen by astro": lambda s: s.sees("astro", None),
        "seen ann by astro and astro2": lambda s: s.sees("astro", "ann") & s.sees("astro2", "ann"),
        "not seen ann": lambda s: ~s.sees(None, "ann"),
        "seen ann before 12 h": lambda s: within(s.sees(None, "ann"), 0, 12 * 3600),
        "ann in bedroom after 20 h before 26 h": lambda s: within(
            s.at("ann", "bedroom"), 20 * 3600, 26 * 3600
        ),
        "ann sleep": lambda s: s.doing("ann", "sleep"),
    },
    "grammar": {
        "seen in kitchen": lambda s: s.at("seen", "kitchen"),
        "in in kitchen": lambda s: s.at("in", "kitchen"),
        '"night" in bedroom': lambda s: s.at("night", "bedroom"),
        "seen seen": lambda s: s.sees(None, "seen"),
        "seen not seen": lambda s: ~s.sees(None, "seen"),
        "seen seen by by": lambda s: s.sees("by", "seen"),
        'seen by "last"': lambda s: s.sees("last", None),
        "seen and night in bedroom": lambda s: s.at("seen", "bedroom") & s.at("night", "bedroom"),
        '"last" in bedroom': lambda s: s.at("last", "bedroom"),
        "night sleep": lambda s: s.doing("night", "sleep"),
    },
    "capitals": {
        "Bob in kitchen": lambda s: s.at("Bob", "kitchen"),
        "bob in kitchen": lambda s: s.at("bob", "kitchen"),
        "X-1 IN KITCHEN": lambda s: s.at("x-1", "kitchen"),
        "Bob and bob home": lambda s: s.at("Bob", "home") & s.at("bob", "home"),
        "seen Bob": lambda s: s.sees(None, "Bob"),
        "seen x-1 by r2d2": lambda s: s.sees("R2D2", "x-1"),
        "R2D2 sees Bob": lambda s: s.sees("R2D2", "Bob"),
        "R2D2 not in bathroom > 2 min": lambda s: longer(~s.at("R2D2", "bathroom"), 120),
        "seen day": lambda s: s.sees(None, "day"),
    },
}


def asked(page, question):
    """Ask; return the box with the answer."""
    page.fill("#ask", question)
    page.press("#ask", "Enter")
    answer = page.locator("#ask-answer")
    for _ in range(100):
        if answer.get_attribute("data-question") == question:
            return answer
        page.wait_for_timeout(50)
    pytest.fail(f"no answer to {question!r}")


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNS)
def test_answers_of_the_page_are_those_of_the_tables(browser, tmp_path, name):
    simulation = {"start": "2026-01-05", "duration": f"{HOURS} h", "seed": 5}
    root = tmp_path / name
    home = {"simulation": simulation, "floorplan": {"type": "bundled"}}
    run = fleet2d.run({**home, **RUNS[name]}, out=root)
    truth = Steps(run)
    with served(root) as address, page_at(browser, address) as page:
        for question, holds in QUESTIONS[name].items():
            expected = stretches(holds(truth))
            answer = asked(page, question)
            spans = answer.get_attribute("data-spans")
            found = [tuple(map(int, span.split("-"))) for span in spans.split()]
            assert expected[:1000] == found, question
            words = f"{len(expected)} time" if expected else "never"
            assert answer.inner_text().startswith(words), question
