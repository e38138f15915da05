"""The page, driven in Chromium: what it shows is what the run's tables say."""

import json
import math
import re
import shutil
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from tests.thorough import THOROUGH

import fleet2d
from fleet2d.viewing.live import LiveRun
from fleet2d.viewing.page_data import PageData, embedded_run, export_html, html_of
from fleet2d.viewing.page_server import PageServer

from .browser import page_at

ROOT = Path(__file__).parents[2]
AXE = ROOT / "page" / "node_modules" / "axe-core" / "axe.min.js"


@pytest.fixture(scope="module")
def address(run_dir):
    with served(run_dir) as started:
        yield started


@pytest.fixture
def page(browser, address):
    with page_at(browser, address) as opened:
        yield opened


@contextmanager
def served(*sources):
    """Serve runs; yield the address of their page."""
    server = PageServer(sources)
    stop = server.start()
    yield server.address
    stop()


def moment(page):
    """Return the step that the page shows."""
    return int(page.get_attribute(".lanes", "aria-valuenow"))


def until(page, holds):
    """Wait for a condition; the page's policy lets no test run code in it to wait."""
    for _ in range(100):
        if holds():
            return
        page.wait_for_timeout(100)
    pytest.fail("the page did not come to it within 10 s")


def go_to(page, moment):
    page.fill("#goto", moment)
    page.press("#goto", "Enter")


def ask(page, question):
    page.fill("#ask", question)
    page.press("#ask", "Enter")


def drag(page, first, last):
    """Drag over the lanes, between parts of their width."""
    box = page.locator(".lanes").bounding_box()
    page.mouse.move(box["x"] + box["width"] * first, box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * last, box["y"] + 60, steps=5)
    page.mouse.up()


def mark_range(page, first, last):
    """Mark a range of time, between parts of the lanes' width."""
    page.keyboard.down("Shift")
    drag(page, first, last)
    page.keyboard.up("Shift")


def add_new_picture(page, pictures):
    """Wait until the plan looks like none of the pictures, and add it to them."""
    plan = page.locator(".plan canvas.top")
    until(page, lambda: plan.screenshot() not in pictures)
    pictures.add(plan.screenshot())


def place_in(page, plan, room):
    """Return a pixel of a plan over a room, as the plan itself says."""
    box = page.locator(".plan canvas.top").nth(plan).bounding_box()
    for row in range(3, 20):
        for column in range(3, 20):
            x, y = box["x"] + box["width"] * column / 20, box["y"] + box["height"] * row / 20
            page.mouse.move(x, y)
            words = page.locator(".plan .hover").all_inner_texts()
            if words and words[0].startswith(room):
                return x, y
    pytest.fail(f"{room} is nowhere on the plan")


@pytest.fixture(scope="module")
def month(tmp_path_factory):
    """A stored run of three days."""
    folder = tmp_path_factory.mktemp("days") / "run"
    fleet2d.run("bundled:paper", "simulation.duration=3 d", out=folder)
    return folder


def shown_step(page):
    return int(page.get_attribute(".overview", "aria-valuenow"))


def test_run_opens_in_motion_in_a_morning(browser, month):
    with served(month) as address, page_at(browser, f"{address}#") as page:
        page.wait_for_selector("button.play[aria-pressed=true]")
        first = shown_step(page)
        assert 6 <= first % 86_400 / 3600 < 12
        until(page, lambda: shown_step(page) > first)
        assert 1 == page.locator(".calendar").count()


def test_who_wants_less_motion_finds_the_run_paused(browser, month):
    with (
        served(month) as address,
        page_at(browser, f"{address}#", reduced_motion="reduce") as page,
    ):
        page.wait_for_selector("button.play[aria-pressed=false]")
        first = shown_step(page)
        page.wait_for_timeout(500)
        assert first == shown_step(page)


def test_click_in_the_calendar_goes_to_that_day_and_hour(browser, month):
    run = fleet2d.open_run(month)
    activities = [e for e in run.tables["events"].to_pylist() if e["event"] == "activity"]
    away = run.path("ana", every=timedelta(seconds=1)).away
    written = (ROOT / "page" / "src" / "data" / "words.ts").read_text("utf-8")
    doing = dict(re.findall(r"^  (\w+): \"(.+)\",$", written, re.M))
    with (
        served(month) as address,
        page_at(browser, f"{address}#view=calendar&at=2026-01-05T00:00:00") as page,
    ):
        box = page.locator(".days").bounding_box()
        rows = (box["height"] - 22 - 4) // 3
        row = max(10, min(24, rows))
        wide = box["width"] - 96 - 118
        for day, hour in ((0, 7.5), (1, 12.25), (2, 20.75)):
            x, y = 96 + wide * hour / 24, 22 + (day + 0.4) * row
            page.mouse.move(box["x"] + x, box["y"] + y)
            words = page.inner_text(".calendar .hover")
            page.mouse.click(box["x"] + x, box["y"] + y)
            step = round((24 * day + hour) * 3600)
            until(page, lambda: abs(shown_step(page) - step) < 86_400 / wide)  # noqa: B023
            activity = [e["detail"] for e in activities if e["step"] <= step][-1]
            does = "out of home" if away[step] else doing.get(activity, activity)
            assert words.startswith(f"Ana: {does} · {run.clock.time(step):%a %-d %b}")


def shown_clock(page):
    """Return the time and the date above the plan."""
    return page.inner_text("output.clock").replace("\n", "")


def shows_moment(page, step):
    page.wait_for_selector(f".lanes[aria-valuenow='{step}']")


def shows_step(page, step):
    page.wait_for_selector(f"table.now[data-step='{step}']", timeout=5000)


def test_what_is_shown_at_random_moments_is_what_the_tables_say(page, run_dir):
    run = fleet2d.open_run(run_dir)
    paths = {name: run.path(name, timedelta(seconds=1)) for name in ("ana", "astro")}
    seen = run.tables["observations"]["step"].to_pylist()
    count = 100 if THOROUGH else 12
    random = np.random.default_rng(5).choice(run.manifest["steps"], count).tolist()
    for step in [*random, seen[len(seen) // 2]]:
        go_to(page, f"step {step}")
        shows_step(page, step)
        for name, path in paths.items():
            row = page.locator(f"tr[data-body={name}]")
            assert path.x[step] == pytest.approx(float(row.get_attribute("data-x")), abs=1e-9)
            assert path.y[step] == pytest.approx(float(row.get_attribute("data-y")), abs=1e-9)
            room = "away" if path.away[step] else run.plan.rooms[path.room[step]].name
            assert room == row.get_attribute("data-room")
    page.wait_for_selector("tr[data-body=astro] >> text=sees ana", timeout=5000)


def shares_are(page, believed):
    """Say whether every bar shows what is believed of its room."""
    bars = page.locator("table.bars tr[data-room]")  # read at once: they may be replaced between
    pairs = bars.evaluate_all("rows => rows.map(row => [row.dataset.room, row.dataset.believed])")
    shown = {room: float(share) for room, share in pairs}
    expected = {room: believed.get(room, 0.0) for room in shown}
    return shown == pytest.approx(expected, abs=1e-9) and bool(shown or not believed)


def with_away(rows):
    """Return shares of rooms and of away that sum to one; those of rooms are stored given home."""
    shares = {row["room"]: row["share"] for row in rows}
    away = shares.get("away", 0.0)
    return {room: s if room == "away" else s * (1 - away) for room, s in shares.items()}


BELIEFS = {
    "ltp": {"type": "long_term_presence", "period": "6 h"},
    "rtp": {"type": "real_time_presence", "period": "30 min"},
    "later": {"type": "belief_table", "period": "2 h", "every": "30 min"},
}


@pytest.mark.slow
def test_beliefs_and_truths_sum_to_100_percent_and_say_their_time(browser, tmp_path):
    ben = {"type": "routine", "persona": "works_outside"}
    root = tmp_path / "run"
    run = fleet2d.run(
        "bundled:paper", "simulation.duration=1 d", users={"ben": ben}, algorithms=BELIEFS, out=root
    )
    draw = np.random.default_rng(1)
    with served(root) as address, page_at(browser, f"{address}#panel=beliefs") as page:
        for algorithm in BELIEFS:
            rows = run.tables[algorithm].to_pylist()
            column = "at" if algorithm == "later" else "step"
            moments = sorted({row[column] for row in rows})
            for user in ("ana", "ben", "anyone"):
                for moment in moments:
                    shares = with_away(
                        [r for r in rows if r[column] == moment and r["user"] == user]
                    )
                    assert 1 == pytest.approx(sum(shares.values()))
                page.select_option("#panel select", f"{algorithm}/{user}")
                for step in draw.integers(moments[0], 86_400, 4).tolist():
                    go_to(page, f"step {step}")
                    shows_moment(page, step)
                    last = max(moment for moment in moments if moment <= step)
                    of = [r for r in rows if r[column] == last and r["user"] == user]
                    until(page, lambda: shares_are(page, with_away(of)))  # noqa: B023
                    assert f"as of {run.clock.time(last):%a %-d %b %H:%M:%S}" in page.inner_text(
                        "#panel"
                    )
                    numbers = page.locator("table.bars td.number").all_inner_texts()
                    parts = [int(number.removesuffix(" %")) for number in numbers]
                    assert [100, 100] == [sum(parts[::2]), sum(parts[1::2])]


def test_dragging_over_the_timeline_scrubs(page):
    drag(page, 0.25, 0.75)
    until(page, lambda: 0.75 * 9 * 3600 == pytest.approx(moment(page), rel=0.01))


def test_playing_passes_time_at_the_chosen_speed(page):
    page.select_option("select[aria-label=Speed]", "600")
    page.click("button.play")
    until(page, lambda: moment(page) > 300)
    page.click("button.play[aria-pressed=true]")
    page.wait_for_selector("button.play[aria-pressed=false]")
    stopped = moment(page)
    page.wait_for_timeout(300)
    assert stopped == moment(page)


def test_panels_keep_up_with_the_timeline_while_an_hour_passes_in_a_second(page):
    page.select_option("select[aria-label=Speed]", "3600")
    page.click("button.play")
    shown = """[document.querySelector('.lanes').ariaValueNow,
                document.querySelector('table.now').dataset.step]"""
    pairs = []

    def has_seen_six_moments():
        pairs.append(tuple(page.evaluate(shown)))
        return len(set(pairs)) > 5

    until(page, has_seen_six_moments)
    assert all(timeline == panel for timeline, panel in pairs)


def test_keyboard_alone_moves_zooms_plays_and_opens_panels(page):
    page.keyboard.press("Home")
    for key in ("ArrowRight", ".", ".", ","):
        page.keyboard.press(key)
    shows_moment(page, 324 + 1)
    page.keyboard.press("n")
    until(page, lambda: moment(page) > 325)
    page.keyboard.press("+")
    page.keyboard.press("+")
    page.keyboard.press("4")
    page.wait_for_selector("#tab-events[aria-selected=true]")
    page.keyboard.press("Space")
    page.wait_for_selector("button.play[aria-pressed=true]")
    page.keyboard.press("Space")
    page.wait_for_selector("button.play[aria-pressed=false]")
    page.keyboard.press("End")
    shows_moment(page, 9 * 3600 - 1)
    theme = page.get_attribute("html", "data-theme")
    page.keyboard.press("t")
    until(page, lambda: theme != page.get_attribute("html", "data-theme"))


def test_tab_reaches_every_control_and_focus_can_be_seen(page):
    names = set()
    for _ in range(40):
        page.keyboard.press("Tab")
        names.add(page.evaluate("document.activeElement.className + document.activeElement.id"))
    assert {"play", "goto", "lanes", "panel", "tab-now"} <= names


def test_events_are_filtered_searched_and_jumped_to(page, run_dir):
    events = fleet2d.open_run(run_dir).tables["events"]
    activities = [row for row in events.to_pylist() if row["event"] == "activity"]
    page.click("#tab-events")
    page.select_option("#panel select", "activity")
    page.wait_for_selector(f"p[data-count='{len(activities)}']")
    words = activities[0]["detail"]
    page.fill("#search", words)
    count = sum(words in row["detail"] for row in activities)
    page.wait_for_selector(f"p[data-count='{count}']")
    page.locator("#panel ol.events button").first.click()
    shows_moment(page, activities[0]["step"])


AT_HOME = [
    {"at": "07:30", "place": ["living_room", "any"]},
    {"at": "22:00", "place": "bedroom", "activity": "sleep"},
]
AWAY_AT_NIGHT = [AT_HOME[0], {"at": "20:00", "away": True, "activity": "work"}]
DAYS = [
    {"on": "tuesday", "items": AWAY_AT_NIGHT},
    {"on": ["monday", "wednesday"], "items": AT_HOME},
]


class Tasks:
    """What people come to the page for; an action is a click, a drag, a key, or a line sent."""

    def __init__(self, page):
        self.page, self.actions = page, 0

    def ask(self, question, answer=""):
        self.actions += 1
        ask(self.page, question)
        self.page.wait_for_selector("#ask-answer[data-count]")
        until(self.page, lambda: answer in self.page.inner_text("#ask-answer"))

    def press(self, key):
        self.actions += 1
        self.page.evaluate("document.activeElement.blur()")
        self.page.keyboard.press(key)

    def click(self, selector):
        self.actions += 1
        self.page.click(selector)

    def last_sight_of_somebody_before_a_time(self):
        self.ask("last seen ana before day 2 18:00")

    def first_night_away(self):
        self.ask("first night ana away")
        evening, night = 86_400 + 20 * 3600, 86_400 + 23 * 3600
        until(self.page, lambda: evening <= moment(self.page) <= night)

    def where_somebody_was(self):
        self.ask("astro at day 2 12:00", answer="Astro is in")

    def who_was_in_a_room(self):
        self.ask("living_room at day 2 12:00", answer="Ana")

    def beliefs_over_time(self):
        self.press("3")
        self.page.wait_for_selector(".label >> text=ltp of ana")

    def column_of_a_table(self):
        self.press("5")
        self.actions += 1
        self.page.select_option("[aria-label='Column to plot']", "key_frames.x")
        self.page.wait_for_selector("[aria-label='x of key_frames over the run'] canvas")

    def reason_of_a_decision(self):
        self.click(".label .name >> text=/^Astro$/")
        self.page.wait_for_selector("[data-inspected=astro] dt >> text=behavior")

    def follow_a_body(self):
        self.click(".label .name >> text=/^Ana$/")
        self.press("c")
        self.page.wait_for_selector("text=Follow no longer")

    def next_failure(self):
        self.press("v")
        self.page.wait_for_selector(".lanes:not([aria-valuenow='0'])")

    def totals_of_a_range(self):
        self.actions += 1
        mark_range(self.page, 0.1, 0.3)
        self.page.wait_for_selector(".totals dt >> text=ana")

    def another_future(self):
        self.click("text=Continue from here")
        self.page.wait_for_selector(".live[data-paused=true]", timeout=20_000)


@pytest.mark.slow
def test_each_task_takes_one_or_two_actions(browser):
    run = fleet2d.run(
        "bundled:paper",
        "simulation.duration=2 d",
        "expect.unseen=never(seen(ana, by=astro))",
        users={"ana": {"type": "schedule", "days": DAYS}},
        seed=4,
    )
    two = {Tasks.column_of_a_table, Tasks.follow_a_body}
    one = {task for name, task in vars(Tasks).items() if "_" in name.strip("_")} - two
    with served(PageData(run)) as address, page_at(browser, address) as page:
        tasks = Tasks(page)
        for task in sorted(one | two, key=lambda task: task is Tasks.another_future):
            tasks.actions = 0
            task(tasks)
            assert tasks.actions <= 1 + (task in two), task


def test_address_holds_the_moment_and_the_view(browser, page):
    go_to(page, "day 1 05:00")
    page.click("#tab-layers")
    page.uncheck("input[name=ways]")
    page.keyboard.press("+")
    until(page, lambda: "panel=layers" in page.url and "from=" in page.url)
    with page_at(browser, page.url) as second_page:
        shows_moment(second_page, 5 * 3600)
        second_page.wait_for_selector("#tab-layers[aria-selected=true]")
        assert not second_page.is_checked("input[name=ways]")
        until(page, lambda: second_page.url.split("#")[1] == page.url.split("#")[1])


@pytest.mark.slow
def test_note_at_a_moment_is_kept_and_found_again(browser, run_dir, tmp_path):
    root = shutil.copytree(run_dir, tmp_path / "day")
    with served(root) as address:
        with page_at(browser, address) as page:
            go_to(page, "step 7200")
            page.keyboard.press("b")
            page.wait_for_selector("#note:focus")
            page.keyboard.type("waits here")
            page.keyboard.press("Enter")
            page.wait_for_selector("ol[data-count='1'] >> text=waits here")
            page.keyboard.press("Home")
        with page_at(browser, f"{address}#panel=notes") as page:
            page.wait_for_selector(".label >> text=notes")
            page.click("text=waits here")
            shows_moment(page, 7200)
            page.click("[aria-label='Remove waits here']")
            page.wait_for_selector("ol[data-count='0']", state="attached")


@pytest.mark.slow
def test_link_to_a_moment_is_copied(browser, address):
    permissions = ["clipboard-read", "clipboard-write"]
    with page_at(browser, address, permissions=permissions) as page:
        page.fill("#goto", "day 1 05:00")
        page.press("#goto", "Enter")
        page.click("text=Copy link")
        page.wait_for_selector("text=Copied")
        link = page.evaluate("navigator.clipboard.readText()")
    assert "at=2026-01-05T05%3A00%3A00" in link
    with page_at(browser, link) as page:
        shows_moment(page, 5 * 3600)


@pytest.mark.slow
@pytest.mark.parametrize("zone", ["Pacific/Auckland", "America/Los_Angeles", "Asia/Kathmandu"])
def test_times_are_the_home_s_in_every_time_zone(browser, address, zone):
    with page_at(browser, f"{address}#panel=metrics", timezone_id=zone) as page:
        go_to(page, "Mon 5 Jan 08:30")
        shows_moment(page, 8 * 3600 + 1800)
        assert "Mon 5 Jan 08:30:00" in page.get_attribute(".lanes", "aria-valuetext")
        until(page, lambda: "at=2026-01-05T08%3A30%3A00" in page.url)


def test_lanes_fold_are_pinned_hidden_and_filtered(page):
    labels = page.locator(".label .name")
    expected = {"Users (1)", "Robots (1)", "Ana", "Ana does", "Astro sees Ana"}
    until(page, lambda: expected <= set(labels.all_inner_texts()))
    page.click("[aria-label='Lanes of Ana']")
    until(page, lambda: "Ana does" not in labels.all_inner_texts())
    page.locator(".label", has_text="astro").first.hover()
    page.click("[aria-label='Pin Astro']")
    until(page, lambda: "Astro" == labels.first.inner_text())
    labels.first.hover()
    page.click("[aria-label='Hide Astro']")
    until(page, lambda: "Astro" not in labels.all_inner_texts())
    page.click("text=show 1 hidden")
    page.keyboard.press("Escape")
    page.locator("body").click(position={"x": 300, "y": 10})
    page.keyboard.press("l")
    page.keyboard.type("does")
    until(page, lambda: ["Astro", "Users (1)", "Ana does"] == labels.all_inner_texts())


def seconds_in(words):
    """Return the sum of all durations in a text."""
    units = {"h": 3600, "min": 60, "s": 1}
    return sum(int(n) * units[u] for n, u in re.findall(r"(?<!_)\b(\d+) (h|min|s)\b", words))


def test_marked_range_has_totals_that_fill_it(page):
    mark_range(page, 1 / 3, 2 / 3)
    dwelt = page.locator(".totals div:has(dt:text-is('Ana')) dd")
    until(page, lambda: 3 * 3600 == pytest.approx(seconds_in(dwelt.inner_text()), abs=120))
    page.keyboard.press("Escape")
    page.locator(".totals").wait_for(state="detached")


def test_zoom_is_undone_and_keys_are_shown(page):
    page.keyboard.press("+")
    until(page, lambda: "from=" in page.url)
    page.keyboard.press("z")
    until(page, lambda: "from=" not in page.url)
    page.keyboard.press("?")
    page.wait_for_selector("details.help dl")


def test_body_is_followed_and_pointed_at(page):
    page.click("tr[data-body=ana] button")
    page.click("text=Follow ana")
    name = page.locator(".plan .hover >> text=ana")

    def pointed_at_is_ana():
        box = page.locator(".plan canvas.top").bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + (box["height"] - 18) / 2
        page.mouse.move(x - 1, y)
        page.mouse.move(x, y)
        return bool(name.is_visible())

    until(page, pointed_at_is_ana)
    page.keyboard.press("c")
    page.wait_for_selector("text=Follow ana")


def test_layers_and_switches_change_the_plan(page):
    page.click("#tab-layers")
    pictures = {page.locator(".plan canvas.top").screenshot()}
    for switch in ("[name=names]", "[name=furniture]", "[name=sight]", "[name=layer] >> nth=1"):
        page.click(f"input{switch}")
        add_new_picture(page, pictures)


def test_layer_of_another_moment_says_so(page, run_dir):
    stored = fleet2d.open_run(run_dir).tables["layer.dust"]["step"].to_pylist()
    assert {9 * 3600 - 1} == set(stored)
    page.click("#tab-layers")
    page.click("input[name=layer] >> nth=1")
    page.wait_for_selector("#panel >> text=as of Mon 5 Jan 08:59:59, which is later")
    page.keyboard.press("End")
    page.locator("#panel >> text=as of").wait_for(state="detached")


@pytest.mark.slow
def test_everything_that_is_shown_belongs_to_the_step_of_the_moment(browser, tmp_path):
    root = tmp_path / "minutes"
    run = fleet2d.run("bundled:paper", "simulation={duration: 8 h, step: 1 min}", seed=4, out=root)
    paths = {name: run.path(name, timedelta(minutes=1)) for name in ("ana", "astro")}
    with served(root) as address, page_at(browser, f"{address}#select=astro") as page:
        for seconds in (4 * 3600 + 37, 6 * 3600 + 59, 7 * 3600 + 12):
            step = seconds // 60
            moment = f"{run.clock.time(step):%a %-d %b %H:%M:%S}"
            go_to(page, f"{seconds} s")
            shows_moment(page, step)
            page.click("#tab-now")
            date, time = moment[:-9], moment[-8:]
            until(page, lambda: shown_clock(page).startswith(f"{time}{date}"))  # noqa: B023
            assert moment == page.get_attribute(".lanes", "aria-valuetext")
            for name, path in paths.items():
                row = page.locator(f"tr[data-body={name}]")
                assert path.x[step] == pytest.approx(float(row.get_attribute("data-x")), abs=1e-9)
            page.click("#tab-inspect")
            place = f"{paths['astro'].x[step]:.2f} m, {paths['astro'].y[step]:.2f} m"
            page.wait_for_selector(f"[data-inspected=astro] >> text={place}")


def test_decision_behind_what_a_robot_does_is_shown(page, run_dir):
    page.click("tr[data-body=astro] button")
    events = fleet2d.open_run(run_dir).tables["events"].to_pylist()
    explores = next(row for row in events if row["event"] == "explores")
    go_to(page, f"step {explores['step'] + 60}")
    inspected = page.locator("[data-inspected=astro]")
    inspected.locator("div:has(dt:text-is('behavior')) >> text=hangout").wait_for()
    room = explores["detail"].replace("_", " ")
    inspected.locator(f"div:has(dt:text-is('why')) >> text=explores {room}").wait_for()
    inspected.locator("div:has(dt:text-is('decides')) >> text=in 59 min").wait_for()
    page.wait_for_selector(".label >> text=astro: behavior")


@pytest.mark.slow
def test_lights_and_slow_floors_are_shown(browser):
    area = [[11.0, 1.0], [14.0, 1.0], [14.0, 4.0], [11.0, 4.0]]
    run = fleet2d.run(
        "bundled:paper",
        "simulation.duration=1 h",
        seed=4,
        floorplan={"slows": [{"area": area, "speed": 0.5}]},
        script=[{"at": "30 min", "lights": "living_room", "turn": "off"}],
    )
    view = "#select=living_room_1&panel=inspect"
    with served(PageData(run)) as address, page_at(browser, address + view) as page:
        light = page.locator("div:has(> dt:text-is('light')) dd")
        until(page, lambda: light.inner_text() == "on")
        pictures = {page.locator(".plan canvas.top").screenshot()}
        page.keyboard.press("End")
        until(page, lambda: light.inner_text() == "off")
        page.wait_for_selector(".label >> text=Living room light")
        add_new_picture(page, pictures)
        page.click("#tab-layers")
        for name in ("slows", "lights"):
            page.uncheck(f"input[name={name}]")
            add_new_picture(page, pictures)


@pytest.mark.slow
def test_violation_is_the_first_thing_on_the_page_and_a_click_goes_there(browser):
    run = fleet2d.run(
        "bundled:paper",
        "simulation.duration=2 h",
        "expect.unseen=never(seen(ana, by=astro))",
        "expect.apart=always(distance(ana, astro) > 0 m)",
        seed=4,
    )
    run.notes.append("a remark")
    first = run.tables["violations"]["step"].to_pylist()[0]
    with served(PageData(run)) as address, page_at(browser, address) as page:
        badge = page.locator("header button.verdict")
        moment = f"{run.clock.time(first):%a %d %b %H:%M:%S}"
        assert f"✗ 1 of 2 expectations violated: unseen at {moment}" == badge.inner_text()
        badge.click()
        shows_moment(page, first)
        alarm = badge.evaluate("element => getComputedStyle(element).color")
        note = page.locator(".notes summary")
        assert "1 note" == note.inner_text()
        assert alarm != note.evaluate("element => getComputedStyle(element).color")


@pytest.mark.slow
def test_one_key_stores_a_film_of_the_minute_around_a_failure(browser, tmp_path):
    av = pytest.importorskip("av", reason="PyAV is not installed")
    run = fleet2d.run(
        "bundled:paper",
        "simulation.duration=10 min",
        "expect.unseen=never(seen(ana, by=astro))",
        seed=4,
    )
    (mark,) = [m for m in PageData(run).facts["marks"] if m["kind"] == "violated"][:1]
    with served(PageData(run)) as address, page_at(browser, address) as page:
        page.keyboard.press("v")
        shows_moment(page, mark["step"])
        with page.expect_download() as download:
            page.keyboard.press("m")
        download.value.save_as(tmp_path / "film.mp4")
    with av.open(str(tmp_path / "film.mp4")) as film:
        assert 15.0 == pytest.approx(film.duration / 1e6, abs=1.0)


@pytest.mark.slow
def test_two_runs_are_compared_in_step(browser, run_dir, other_dir):
    with served(run_dir, other_dir) as address, page_at(browser, address) as page:
        until(page, lambda: page.locator(".plan canvas.top").count() == 2)
        page.wait_for_selector(".labels button >> text=rooms differ")
        go_to(page, "day 1 08:00")
        until(page, lambda: 2 == page.locator(f"table.now[data-step='{8 * 3600}']").count())
        page.click("#tab-metrics")
        page.locator("table.results tr.differs").first.wait_for()
        for name in ("ana · first", "ana · second"):
            page.locator(".u-legend", has_text=name).first.wait_for()
        page.click("#tab-beliefs")
        for name in ("first", "second"):
            page.wait_for_selector(f".label .name >> text=/^ltp of ana · {name}/")


def test_exported_file_plays_without_a_server(browser, run_dir, tmp_path):
    target = tmp_path / "part.html"
    run = fleet2d.open_run(run_dir)
    export_html(run, target, 3600, 3 * 3600)
    with page_at(browser, target.as_uri(), offline=True) as page:
        page.keyboard.press("End")
        shows_step(page, 3 * 3600 - 1)
        path = run.path("ana", timedelta(seconds=1))
        x = float(page.get_attribute("tr[data-body=ana]", "data-x"))
        assert path.x[3 * 3600 - 1] == pytest.approx(x, abs=1e-9)
        page.keyboard.press("Home")
        shows_step(page, 3600)


@pytest.mark.slow
def test_plan_of_4000_vertices_is_shown(browser, tmp_path):
    turns = [2 * math.pi * i / 4000 for i in range(4000)]
    far = [5 + 0.2 * (i * 7919 % 5) / 5 + math.sin(3 * turn) for i, turn in enumerate(turns)]
    corners = [[8 + r * math.cos(a), 8 + r * math.sin(a)] for r, a in zip(far, turns, strict=True)]
    plan = tmp_path / "round.json"
    content = {"format": "fleet2d-floorplan", "version": 1, "free": [{"outline": corners}]}
    plan.write_text(json.dumps(content))
    run = fleet2d.run(
        {
            "simulation": {"start": "2026-01-05", "duration": "10 min", "seed": 1},
            "floorplan": {"type": "native", "path": str(plan)},
            "robots": {"astro": {"camera": {}, "behaviors": [{"type": "patrol"}]}},
        }
    )
    with served(PageData(run)) as address, page_at(browser, address) as page:
        page.keyboard.press("End")
        shows_step(page, 599)
        pictures = {page.locator(".plan canvas.top").screenshot()}
        page.click("#tab-layers")
        page.click("input[name=sight]")
        add_new_picture(page, pictures)


def test_damaged_run_is_explained_on_the_page(browser, tmp_path):
    (tmp_path / "manifest.json").write_text('{"format": 99}')
    with served(tmp_path) as address, page_at(browser, address) as page:
        assert "later Fleet2D" in page.inner_text(".failure")


@pytest.mark.slow
def test_live_run_is_stepped_paused_and_steered(browser):
    simulation = fleet2d.Simulation(
        "bundled:paper",
        "simulation.duration=6 h",
        "objects.bath_door={type: door, doorway: bathroom_1}",
        seed=4,
    )
    live = LiveRun(simulation, paused=True)
    live.start()
    server = PageServer([], live=live)
    stop = server.start()
    with page_at(browser, f"{server.address}#select=bath_door&panel=inspect") as page:
        page.wait_for_selector(".live[data-paused=true]")
        page.click(".live >> text=+60")
        page.wait_for_selector(".live[data-step='60']")
        page.click("text=Shut bath_door")
        page.click(".live >> text=Step")
        page.wait_for_selector("text=Open bath_door")
        page.click("#tab-now")
        page.click("tr[data-body=ana] button")
        page.click("text=Put ana")
        page.mouse.click(*place_in(page, 0, "Living room"))
        page.click(".live >> text=Step")
        page.wait_for_selector("[data-inspected=ana] >> text=Living room")
        page.select_option("select[aria-label='Speed of the simulation']", "0")
        page.click("button.play")
        page.wait_for_selector("html[data-ended='1']", timeout=60_000)
        shows_moment(page, 6 * 3600 - 1)
        page.keyboard.press("Home")
        page.click("button.play")  # it plays like a stored run
        until(page, lambda: moment(page) > 0)
    stop()
    live.end()
    assert live.run is not None
    assert "complete" == live.run.status
    assert {"put", "shut"} == {entry["do"] for entry in live.run.manifest["interventions"]}
    events = live.run.tables["events"].to_pylist()
    assert ("bath_door", "shut") in [(row["entity"], row["event"]) for row in events]


@pytest.mark.slow
def test_moment_of_a_stored_run_is_continued_otherwise_beside_it(browser, run_dir, tmp_path):
    parent = shutil.copytree(run_dir, tmp_path / "day")
    with served(parent) as address:
        at = 4 * 3600
        with page_at(browser, address) as page:
            go_to(page, f"step {at}")
            page.click("text=Continue from here")
            page.wait_for_selector(f".live[data-paused=true][data-step='{at}']")
            tables = [page.locator(f"table.now[data-step='{at}']").nth(i) for i in range(2)]
            places = [t.locator("tr[data-body=astro]").get_attribute("data-x") for t in tables]
            assert places[0] == places[1]
            page.locator("tr[data-body=astro] button").first.click()
            offer = "Astro: hangout.tau …"
            page.select_option("select[aria-label='What to change']", label=offer)
            page.fill("input[aria-label='Value of hangout.tau']", "10 min")
            page.get_by_role("button", name="Change", exact=True).click()
            page.click("text=Call astro")
            page.mouse.click(*place_in(page, 1, "Living room"))
            page.click("button.play")
            page.wait_for_selector("html[data-ended='1']", timeout=60_000)
            assert "astro: hangout with tau 10 min" in page.inner_text(".chips")
            page.click("#tab-now")
            assert "Astro elsewhere" in page.inner_text(".differences")
            shows_step(page, 9 * 3600 - 1)
            rooms = [
                page.locator(f"table.now[data-step='{9 * 3600 - 1}']")
                .nth(i)
                .locator("tr[data-body=astro]")
                .get_attribute("data-room")
                for i in range(2)
            ]
            assert "living_room_1" == rooms[1] != rooms[0]
    branch = tmp_path / "day-branch-1"
    done = fleet2d.open_run(branch).manifest["interventions"]
    assert [("configure", at), ("send", at)] == [(act["do"], act["step"]) for act in done]
    assert fleet2d.reproduce(branch).same


def test_page_works_in_the_frame_of_a_notebook(browser, run_dir):
    """Jupyter and marimo show the page in a frame that may run scripts, and nothing else."""
    document = html_of([embedded_run(PageData(fleet2d.open_run(run_dir)), 0, 9 * 3600)])
    page = browser.new_page()
    page.set_content('<iframe sandbox="allow-scripts" width="1000" height="800"></iframe>')
    page.eval_on_selector("iframe", "(frame, text) => { frame.srcdoc = text; }", document)
    frame = page.frame_locator("iframe")
    for number, press in enumerate(("Enter", "Go"), start=4):
        frame.locator("#goto").fill(f"day 1 0{number}:00")
        if press == "Go":
            frame.get_by_role("button", name="Go", exact=True).click()
        else:
            frame.locator("#goto").press(press)
        frame.locator(f"table.now[data-step='{number * 3600}']").wait_for(timeout=20_000)
    page.close()


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing(browser, address, scheme):
    if not AXE.exists():
        pytest.skip("axe-core is not installed: npm ci in page/")
    found = []
    with page_at(browser, f"{address}#select=ana", color_scheme=scheme) as page:
        page.evaluate(AXE.read_text(encoding="utf-8"))
        for panel in ("now", "inspect", "beliefs", "events", "metrics", "layers", "notes"):
            page.click(f"#tab-{panel}")
            page.wait_for_timeout(200)
            found += [
                f"{panel}: {entry['id']}: {entry['nodes'][0]['html'][:120]}"
                for entry in page.evaluate("axe.run()")["violations"]
            ]
    assert [] == found


@pytest.mark.parametrize("width", [390, 768])
def test_narrow_screen_needs_no_sideways_scrolling(browser, address, width):
    with page_at(browser, address, viewport={"width": width, "height": 844}) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_small_frame_of_a_notebook_shows_plan_and_timeline(browser, address):
    with page_at(browser, address, viewport={"width": 640, "height": 500}) as page:
        for part in (".plan canvas.top", ".lanes"):
            box = page.locator(part).bounding_box()
            assert box["height"] > 100
            assert box["y"] + 100 < 500
