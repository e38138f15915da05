"""Odd states of the page, in Chromium: each says what is, and what to do."""

import json
import shutil
from itertools import product
from urllib.request import Request, urlopen

import pytest

import fleet2d
from fleet2d.viewing.page_data import export_html
from fleet2d.viewing.page_server import PageServer

from .browser import page_at
from .test_browser import AXE, ask, go_to, mark_range, served, shown_clock, shown_step, until

START = {"start": "2026-01-05", "duration": "2 d", "seed": 1}
HOME = {"simulation": START, "floorplan": {"type": "bundled"}}
ANA = {"users": {"ana": {"type": "routine"}}}
PATROL = {"type": "patrol", "camera": {}}
TEN = {f"r{number}": PATROL for number in range(10)}
PAPER = {"extends": "bundled:paper"}
LATE = {"duration": "2 d", "start": "2026-01-05T14:37:00", "seed": 1}


STATES = {
    "nobody": ({**HOME, "robots": {"astro": PATROL}}, "#view=calendar", "Nobody lives here"),
    "empty": (HOME, "#", "Nobody is in this home, neither people nor robots"),
    "no robots": ({**HOME, **ANA}, "#view=calendar", "Bedroom"),
    "no events": ({**PAPER, "simulation": START, "artifacts": {"events": False}}, "#", "Ana"),
    "an hour": ({**PAPER, "simulation": {**START, "duration": "1 h"}}, "#", "1.0 h"),
    "beyond the end": (PAPER | {"simulation": START}, "#at=2031-01-01T00:00:00", "lasts from"),
    "unknown name": (PAPER | {"simulation": START}, "#select=zoe&layer=gold", "names 'zoe'"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", STATES)
def test_odd_run_or_link_says_what_is(browser, tmp_path, name):
    scenario, link, words = STATES[name]
    fleet2d.run(scenario, out=tmp_path / "run")
    with served(tmp_path / "run") as address, page_at(browser, address + link) as page:
        until(page, lambda: words in page.inner_text("body"))
        page.click(".overview")
        page.keyboard.press("y")
        page.wait_for_timeout(200)
        assert 0 == page.locator(".failure").count()


@pytest.mark.slow
def test_run_that_starts_at_any_minute_keeps_its_clock(browser, tmp_path):
    fleet2d.run({**PAPER, "simulation": LATE}, out=tmp_path / "run")
    with served(tmp_path / "run") as address, page_at(browser, f"{address}#view=calendar") as page:
        assert shown_clock(page).startswith("14:37:00Mon 5 Jan")
        go_to(page, "day 2 00:00")
        until(page, lambda: shown_step(page) == (9 * 60 + 23) * 60)
        go_to(page, "day 9 00:00")
        page.wait_for_selector("text=No time of this run, which lasts from Mon 5 Jan 14:37")


@pytest.mark.slow
def test_ten_robots_on_one_spot_are_ten(browser, tmp_path):
    simulation = {**START, "duration": "8 h", "ghosts": True}
    fleet2d.run({**HOME, "simulation": simulation, "robots": TEN}, out=tmp_path / "run")
    at = "#at=2026-01-05T07:00:00"
    with served(tmp_path / "run") as address, page_at(browser, address + at) as page:
        box = page.locator(".plan canvas.top").bounding_box()
        for row, column in product(range(40), range(40)):
            x = box["x"] + box["width"] * (column + 0.5) / 40
            y = box["y"] + box["height"] * (row + 0.5) / 40
            page.mouse.move(x, y)
            words = page.locator(".plan .hover").all_inner_texts()
            if any("here:" in text for text in words):
                break
        assert words == ["10 here: R0, R1, R2, R3, R4, R5, R6, R7, R8, R9"]


@pytest.mark.slow
def test_stopped_server_is_told_and_what_was_read_stays(browser, run_dir):
    server = PageServer([run_dir])
    stop = server.start()
    with page_at(browser, server.address) as page:
        stop()
        page.click("#tab-inspect")
        page.click(".label .name >> text=/^Astro$/")  # why it does so is asked of the server
        page.wait_for_selector("text=The server no longer answers: start fleet2d view again")
        assert page.locator(".label .name >> text=/^Ana$/").is_visible()


@pytest.mark.slow
def test_deleted_run_is_told(browser, run_dir, tmp_path):
    copy = shutil.copytree(run_dir, tmp_path / "copy")
    server = PageServer([copy])
    stop = server.start()
    shutil.rmtree(copy)
    with page_at(browser, server.address) as page:
        assert "copy" in page.inner_text(".failure [role=alert]")
    stop()


def test_old_link_shows_a_page_that_says_what_to_do(run_dir):
    server = PageServer([run_dir])
    stop = server.start()
    host, port = server.listens_at
    request = Request(f"http://{host}:{port}/old/", headers={"Accept": "text/html"})
    with pytest.raises(Exception, match="403") as refusal:
        urlopen(request)
    content = refusal.value.read().decode()  # type: ignore[attr-defined]
    stop()
    assert content.startswith("<!doctype html>")
    assert "open the address that fleet2d view printed" in content


@pytest.mark.slow
def test_palette_asks_goes_and_does(browser, run_dir):
    with served(run_dir) as address, page_at(browser, address) as page:
        page.keyboard.press("Control+k")
        page.keyboard.type("how often was ana in the bathroom")
        page.keyboard.press("Enter")
        page.wait_for_selector("#palette [role=option] canvas")
        count = int(page.get_attribute("#ask-answer", "data-count"))
        assert page.locator("#palette [role=option]").count() == min(count, 24)
        step = shown_step(page)
        page.keyboard.press("ArrowDown")
        page.keyboard.press("Enter")
        until(page, lambda: shown_step(page) > step)
        theme = page.get_attribute("html", "data-theme")
        ask(page, "light or dark")
        until(page, lambda: page.get_attribute("html", "data-theme") != theme)
        ask(page, "where is anna")
        page.click("#palette >> text=where is ana")
        until(
            page,
            lambda: (
                page.inner_text("#ask-answer").endswith(")")
                or "Ana is" in page.inner_text("#ask-answer")
            ),
        )


@pytest.mark.slow
def test_link_keeps_question_marked_range_and_pinned_lanes(browser, run_dir):
    with served(run_dir) as address, page_at(browser, address) as page:
        ask(page, "ana in bathroom")
        count = page.get_attribute("#ask-answer", "data-count")
        page.keyboard.press("Escape")
        page.locator(".label", has_text="astro").first.hover()
        page.click("[aria-label='Pin Astro']")
        mark_range(page, 0.1, 0.3)
        totals = page.inner_text(".totals strong")
        until(page, lambda: "marked=" in page.url and "pin=" in page.url and "ask=" in page.url)
        with page_at(browser, page.url) as other:
            until(other, lambda: other.get_attribute("#ask-answer", "data-count") == count)
            assert totals == other.inner_text(".totals strong")
            assert other.locator(".label.pinned").count() == 1


@pytest.mark.slow
@pytest.mark.parametrize(("key", "endings"), [("s", ("png",)), ("w", ("webm", "mp4"))])
def test_view_is_stored_by_one_key_in_a_file_without_a_server(
    browser, run_dir, tmp_path, key, endings
):
    export_html(fleet2d.open_run(run_dir), tmp_path / "run.html")
    link = f"{(tmp_path / 'run.html').as_uri()}#view=lanes&at=2026-01-05T07:00:00"
    with page_at(browser, link) as page:
        with page.expect_download(timeout=60_000) as download:
            page.keyboard.press(key)
        path = tmp_path / download.value.suggested_filename
        download.value.save_as(path)
        assert path.suffix[1:] in endings
        assert path.stat().st_size > 20_000
        assert shown_step(page) == 7 * 3600


@pytest.mark.slow
def test_reel_plays_every_card_and_a_key_ends_it(browser, run_dir):
    with served(run_dir) as address, page_at(browser, address) as page:
        titles = [
            card["title"]
            for card in json.loads(urlopen(f"{address}run/0/facts.json").read())["story"]
        ]
        assert titles
        page.keyboard.press("r")
        until(page, lambda: titles[0] in page.inner_text(".reel"))
        page.keyboard.press("Escape")
        page.wait_for_selector(".reel", state="detached")
        page.wait_for_selector("button.play[aria-pressed=false]")


@pytest.mark.slow
def test_popovers_are_inside_the_window(browser, run_dir):
    small = {"viewport": {"width": 900, "height": 480}}
    with served(run_dir) as address, page_at(browser, f"{address}#view=calendar", **small) as page:
        box = page.locator(".days").bounding_box()
        for x in (box["x"] + 100, box["x"] + box["width"] - 4):
            page.mouse.move(x, box["y"] + 30)
            page.wait_for_selector(".with-home")
            assert is_inside(page, ".with-home")
        page.click("details.help summary")
        assert is_inside(page, ".help dl")
        page.keyboard.press("Escape")
        page.keyboard.press("Control+k")
        assert is_inside(page, ".palette")


def is_inside(page, selector):
    box = page.locator(selector).bounding_box()
    right, bottom = box["x"] + box["width"], box["y"] + box["height"]
    return box["x"] >= 0 and box["y"] >= 0 and right <= 900 and bottom <= 480


@pytest.mark.slow
def test_zoomed_plan_has_a_button_to_the_whole(browser, run_dir):
    with served(run_dir) as address, page_at(browser, address) as page:
        assert 0 == page.locator("button.fit").count()
        box = page.locator(".plan canvas.top").bounding_box()
        page.mouse.move(box["x"] + 50, box["y"] + 50)
        page.mouse.wheel(0, -8000)
        page.click("button.fit")
        page.wait_for_selector("button.fit", state="detached")


@pytest.mark.slow
@pytest.mark.parametrize("view", ["calendar", "lanes"])
def test_print_shows_plan_and_timeline_and_nothing_to_press(browser, run_dir, view):
    link = f"#view={view}&at=2026-01-05T07:30:00"
    with served(run_dir) as address, page_at(browser, address + link) as page:
        page.emulate_media(media="print")
        for shown in (".plan canvas.top", ".calendar canvas" if view == "calendar" else ".lanes"):
            box = page.locator(shown).first.bounding_box()
            assert box["width"] > 300
            assert box["height"] > 100
        for hidden in (".controls", "[role=tablist]", ".ask", ".menu", ".help", ".goto"):
            assert not page.locator(hidden).first.is_visible()
        assert page.pdf().startswith(b"%PDF")


PIXELS = """() => [...document.querySelectorAll(".plan canvas")].map((canvas) => {
  const { width, height } = canvas;
  const data = canvas.getContext("2d").getImageData(0, 0, width, height).data;
  let hash = 0;
  for (const value of data) hash = (31 * hash + value) | 0;
  return [width, height, hash];
})"""


@pytest.mark.slow
def test_file_and_cell_of_a_notebook_look_as_the_served_page(browser, run_dir, tmp_path):
    run = fleet2d.open_run(run_dir)
    target = tmp_path / "run.html"
    export_html(run, target)
    size = {"width": 1100, "height": 800}
    link = "#view=lanes&at=2026-01-05T07:30:00"
    looks = []
    with served(run_dir) as address:
        for place in (address + link, target.as_uri() + link):
            with page_at(browser, place, viewport=size) as page:
                page.wait_for_timeout(500)
                looks.append(page.evaluate(PIXELS))
    with page_at(browser, "about:blank#", viewport=size, ready="body") as page:
        page.set_content('<iframe sandbox="allow-scripts" width="1100" height="800"></iframe>')
        page.add_style_tag(content="body { margin: 0 } iframe { border: 0 }")
        text = target.read_text(encoding="utf-8")
        page.eval_on_selector("iframe", "(frame, text) => { frame.srcdoc = text; }", text)
        frame = page.frames[-1]
        frame.wait_for_selector("html[data-ready=true]")
        go_to(frame, "day 1 07:30")
        frame.get_by_role("button", name="Lanes", exact=True).click()
        page.wait_for_timeout(500)
        looks.append(frame.evaluate(PIXELS))
    assert looks[0] == looks[1] == looks[2]


@pytest.mark.slow
def test_click_on_a_plan_inspects_that_plan(browser, run_dir, other_dir):
    with served(run_dir, other_dir) as address, page_at(browser, address) as page:
        for number, name in enumerate((run_dir.name, other_dir.name)):
            page.click("#tab-now")
            page.locator("tr[data-body=ana] button").nth(number).click()
            page.wait_for_selector(f"[data-inspected=ana] h2 >> text=Ana · {name}")


@pytest.mark.slow
def test_two_runs_have_a_table_of_what_differs(browser, run_dir, other_dir):
    with served(run_dir, other_dir) as address, page_at(browser, address) as page:
        page.wait_for_selector(".differences >> text=Ana elsewhere")
        rows = page.locator(".differences tbody tr")
        for number in range(rows.count()):
            one, other = rows.nth(number).locator("td").all_inner_texts()
            assert one != other
    with served(run_dir, run_dir) as address, page_at(browser, address) as page:
        page.wait_for_selector(".differences >> text=Nothing does")


def open_palette(page):
    page.keyboard.press("Control+k")
    page.keyboard.type("how long was ana in the bathroom")
    page.keyboard.press("Enter")
    page.wait_for_selector("#palette [role=option] canvas")


def open_menu(page):
    page.click(".menu summary")


def play_reel(page):
    page.keyboard.press("r")
    page.wait_for_selector(".reel")


def show_calendar(page):
    page.keyboard.press("y")
    page.wait_for_selector(".calendar")


def ask_wrongly(page):
    ask(page, "where is anna")
    go_to(page, "day 99")


NEW_STATES = (open_palette, open_menu, play_reel, show_calendar, ask_wrongly)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_in_new_states(browser, run_dir, other_dir, scheme):
    if not AXE.exists():
        pytest.skip("axe-core is not installed: npm ci in page/")
    script = AXE.read_text(encoding="utf-8")
    found = []
    for show in NEW_STATES:
        with served(run_dir) as address, page_at(browser, address, color_scheme=scheme) as page:
            page.evaluate(script)
            show(page)
            page.wait_for_timeout(200)
            found += [
                f"{show.__name__}: {entry['id']}: {entry['nodes'][0]['html'][:120]}"
                for entry in page.evaluate("axe.run()")["violations"]
            ]
    with (
        served(run_dir, other_dir) as address,
        page_at(browser, address, color_scheme=scheme) as page,
    ):
        page.evaluate(script)
        page.wait_for_selector(".differences tbody tr")
        found += [f"two: {entry['id']}" for entry in page.evaluate("axe.run()")["violations"]]
    assert [] == found
