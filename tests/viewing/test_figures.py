"""Pictures of moments and stretches, films: written completely, in the requested format."""

import numpy as np
import pytest
from tests.scenes import scenario

import fleet2d
from fleet2d.engine.access import evidence_of
from fleet2d.errors import InputError
from fleet2d.viewing.figures import draw_failure, draw_moment, draw_stretch
from fleet2d.viewing.film import LitHome, draw_frames, stage_of, write_film
from fleet2d.viewing.stage import Stage

MAGIC = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF", ".gif": b"GIF8", ".webp": b"RIFF"}


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".png", ".svg", ".pdf"])
def test_moment_is_drawn_in_each_format(run_dir, tmp_path, ending):
    target = tmp_path / f"moment{ending}"
    draw_moment(fleet2d.open_run(run_dir), 20_000, target)
    assert target.read_bytes().startswith(MAGIC[ending])


@pytest.mark.slow
def test_same_moment_gives_the_same_bytes_and_another_others(run_dir, tmp_path):
    run = fleet2d.open_run(run_dir)
    contents = []
    for number, step in enumerate((25_000, 25_000, 30_000)):
        target = tmp_path / f"{number}.png"
        draw_moment(run, step, target)
        contents.append(target.read_bytes())
    assert contents[0] == contents[1] != contents[2]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["life", "heat", "strip"])
def test_stretch_is_drawn_as_each_figure(run_dir, tmp_path, kind):
    target = tmp_path / f"{kind}.png"
    draw_stretch(fleet2d.open_run(run_dir), 3600, 20_000, target, kind)
    assert target.stat().st_size > 10_000


@pytest.mark.parametrize("step", [-1, 32_400])
def test_step_outside_the_run_is_refused(run_dir, tmp_path, step):
    with pytest.raises(InputError, match="its last is 32399"):
        draw_moment(fleet2d.open_run(run_dir), step, tmp_path / "x.png")


def test_bodies_stand_where_the_run_has_them(run_dir):
    from datetime import timedelta

    from matplotlib.figure import Figure

    run = fleet2d.open_run(run_dir)
    stage = Stage(run, 0, 32_400, figure=Figure())
    stage.show(25_321)
    path = run.path("astro", timedelta(seconds=1))
    *_, discs, _, name = stage.body_artists
    disc = discs.get_paths()[-1].get_extents()
    assert "Astro" == name.get_text()
    assert (path.x[25_321], path.y[25_321]) == pytest.approx((disc.p0 + disc.p1) / 2)


@pytest.mark.slow
def test_kept_pictures_of_the_lit_home_change_no_frame(run_dir, monkeypatch):
    def filmed():
        stage = stage_of(fleet2d.open_run(run_dir), 20_000, 25_000, 100, 240)
        return [pixels.copy() for _, pixels in draw_frames(stage, 20_000, np.arange(50))]

    def draw_anew(home, draw):
        home._lit.clear()
        lights.add(home._stage.light_key)
        restore(home, draw)

    lights = set()
    restore = LitHome.restore
    kept = filmed()
    monkeypatch.setattr(LitHome, "restore", draw_anew)
    assert all(np.array_equal(one, other) for one, other in zip(kept, filmed(), strict=True))
    assert len(lights) > 1


@pytest.mark.parametrize("ending", [".gif", ".webp"])
def test_film_of_pictures_is_written(run_dir, tmp_path, ending):
    target = tmp_path / f"film{ending}"
    frames = write_film(fleet2d.open_run(run_dir), target, 24_000, 25_000, speed=600, height=240)
    assert frames > 2
    assert target.read_bytes().startswith(MAGIC[ending])
    assert [target] == list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_pictures_of_a_film_look_as_they_were_drawn(run_dir, tmp_path):
    av = pytest.importorskip("av", reason="PyAV is not installed")
    run = fleet2d.open_run(run_dir)
    target = tmp_path / "film.mp4"
    write_film(run, target, 25_200, 25_500, speed=250, height=240)
    stage = stage_of(run, 25_200, 25_500, stride=10, height=240)
    drawn = {
        moment: pixels[..., :3].mean(axis=2)
        for moment, pixels in draw_frames(stage, 25_200, np.flatnonzero(stage.changes()))
    }
    with av.open(str(target)) as film:
        assert 1.2 == pytest.approx(film.duration / 1e6, abs=0.1)
        for picture in film.decode(video=0):
            moment = round(picture.time * 25)
            grey = picture.to_ndarray(format="rgb24").mean(axis=2)
            if moment in drawn:
                assert np.sqrt(((grey - drawn.pop(moment)) ** 2).mean()) < 3
    assert not drawn


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("film.avi", {}, r"\.mp4, \.gif or \.webp"),
        ("film.mp4", {"speed": 0}, "--speed"),
        ("film.mp4", {"height": 7}, "--height"),
    ],
)
def test_impossible_film_is_refused(run_dir, tmp_path, name, options, words):
    with pytest.raises(InputError, match=words):
        write_film(fleet2d.open_run(run_dir), tmp_path / name, 0, 100, **options)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--at", "noon"], "day 3 18:30"),
        (["--at", "day 1 03:00", "--layer", "dust"], "one picture at a time"),
        (["--from", "day 1 05:00", "--to", "day 1 04:00"], "is not before"),
        (["--fov", "1,1,0"], "for a floor plan"),
        (["--day", "2"], "give --log ROBOT"),
        (["--log", "astr"], "did you mean 'astro'"),
        (["--log", "astro", "--day", "9"], "no day 9: its days are"),
        (["--log", "astro", "--day", "1", "--from", "2 h"], "not both"),
        (["--log", "astro", "--layer", "dust"], "leave out the options of pictures"),
    ],
)
def test_show_refuses_what_is_no_picture(fleet2d, run_dir, words, message):
    code, _, err = fleet2d("show", run_dir, *words)
    assert 2 == code
    assert message in err


def test_the_log_of_a_robot_is_printed_or_written(fleet2d, run_dir, tmp_path):
    words = ("show", run_dir, "--log", "astro", "--from", "2 h", "--to", "4 h")
    code, out, _ = fleet2d(*words)
    assert 0 == code
    assert out.startswith("-- day 1, ")
    assert "  decision  " in out
    assert (0, "astro.log\n") == fleet2d(*words, "--out", "astro.log")[:2]
    assert out == (tmp_path / "astro.log").read_text()


@pytest.mark.slow
def test_the_picture_of_a_failure_says_what_failed_and_marks_it(tmp_path):
    content = scenario(
        "5 min",
        users={"ana": {"type": "meander"}},
        robots={"astro": {"type": "patrol", "dwell": "10 s"}},
        expect={
            "off": "never(distance(astro, ana) < 3 m and room(astro) in [kitchen, living_room])"
        },
    )
    simulation = fleet2d.Simulation(content)
    run = simulation.run()
    verdict = simulation.verdicts()["off"]
    evidence = evidence_of(simulation, "off")
    assert verdict.worst is not None
    draw_failure(run, verdict.worst.worst, tmp_path / "whole.svg", str(verdict), evidence)
    draw_failure(run, verdict.worst.worst, tmp_path / "plain.svg", str(verdict), None)
    whole, plain = ((tmp_path / f"{name}.svg").read_text() for name in ("whole", "plain"))

    assert {"kitchen", "living_room"} == evidence.places - {"ana"}
    assert (("astro", "ana"),) == evidence.distances
    distance, room = evidence.signals
    assert ('distance("astro", "ana")', "m", 3.0) == (distance.text, distance.unit, distance.limit)
    assert set(room.trace.value.tolist()) <= {0.0, 1.0}
    gap = distance.trace.at(verdict.worst.worst)
    assert f"{gap:.2f} m" in whole
    for text in ("off is violated", f"step {verdict.worst.worst}"):
        assert text in whole
        assert text in plain
    assert "seconds from the failure" in whole
    assert "seconds from the failure" not in plain
