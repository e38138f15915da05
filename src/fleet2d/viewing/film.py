"""Films of a stretch of a run: MP4, GIF or WebP, with text on each frame."""

import re
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.collections import Collection
from matplotlib.figure import Figure
from matplotlib.text import Text
from numpy.typing import NDArray

from fleet2d.errors import InputError, extra, os_errors_as
from fleet2d.kernels import I64, U8
from fleet2d.runs.run import Run
from fleet2d.storage.files import partial_file
from fleet2d.viewing.pictures.floorplan import drawing_style, figure_size
from fleet2d.viewing.stage import Stage

_NUMBERS = re.compile(r"\d+|\D+")
EDGE = 2  # pixels around a text for its antialiased rim


class Stamp(NamedTuple):
    """The picture of a text, and its corner [pixels].

    Attributes:
        color: float32 (rows, columns, 3), what it adds to a picture, 0 to 255.
        rest: float32 (rows, columns, 1), the share of the picture that remains, 0 to 1.
        left: Its left edge.
        top: Its upper edge.
    """

    color: NDArray[np.float32]
    rest: NDArray[np.float32]
    left: int
    top: int


class TextStamps:
    """Pastes texts on pictures of one size; drawing a text takes a hundred times as long."""

    def __init__(self, width: int, height: int, dpi: float) -> None:
        """Prepare for pictures of a size [pixels]."""
        self._renderer: Any = RendererAgg(width, height, dpi)
        self._height = height
        self._stamps: dict[tuple[str, object, float], Stamp | None] = {}
        self._advances: dict[tuple[str, float], float] = {}

    def paste(self, text: Text, pixels: U8) -> None:
        """Paste a text on a picture, at its position.

        Args:
            text: The text; nothing is pasted if it is invisible.
            pixels: uint8 (rows, columns, 4), changed in place.
        """
        if not text.get_visible() or not text.get_text():
            return
        x, y = self._place(text)
        content = text.get_text()
        # A clock shows many different times, but few different hours and minutes.
        is_left = text.get_horizontalalignment() == "left"
        parts = _NUMBERS.findall(content) if is_left else [content]
        for part in parts:
            text.set_text(part)
            self._paste_part(text, x, y, pixels)
            x += self._advance(text) if len(parts) > 1 else 0
        text.set_text(content)

    def _paste_part(self, text: Text, x: float, y: float, pixels: U8) -> None:
        key = (text.get_text(), text.get_color(), float(text.get_fontsize()))
        if key not in self._stamps:
            self._stamps[key] = self._stamp(text)
        stamp = self._stamps[key]
        if stamp is None:
            return
        rows, columns = stamp.rest.shape[:2]
        top = round(self._height - y) + stamp.top
        left = round(x) + stamp.left
        low = max(0, top)
        high = min(pixels.shape[0], top + rows)
        begin = max(0, left)
        end = min(pixels.shape[1], left + columns)
        if low >= high or begin >= end:
            return
        part = np.s_[low - top : high - top, begin - left : end - left]
        target = pixels[low:high, begin:end, :3]
        target[...] = target * stamp.rest[part] + stamp.color[part]

    @staticmethod
    def _place(text: Text) -> tuple[float, float]:
        x, y = text.get_transform().transform(text.get_position()).tolist()
        return x, y

    def _advance(self, text: Text) -> float:
        """Return the distance from the start of a text to the start of the next [pixels]."""
        content = text.get_text()
        font = text.get_fontproperties()
        key = (content, float(text.get_fontsize()))
        if key not in self._advances:
            # Measured between bars: blanks at the end of a text have no width.
            measure = self._renderer.get_text_width_height_descent
            with_text, *_ = measure(f"|{content}|", font, False)
            without, *_ = measure("||", font, False)
            self._advances[key] = with_text - without
        return self._advances[key]

    def _stamp(self, text: Text) -> Stamp | None:
        """Draw a text alone; return its picture, None if it is empty."""
        x, y = self._place(text)
        self._renderer.clear()
        text.draw(self._renderer)
        box = text.get_window_extent(self._renderer)
        left = max(0, int(box.x0) - EDGE)
        right = int(box.x1) + EDGE
        top = max(0, int(self._height - box.y1) - EDGE)
        bottom = int(self._height - box.y0) + EDGE
        pixels = np.asarray(self._renderer.buffer_rgba())[top:bottom, left:right]
        if not pixels.any():
            return None
        picture = (pixels / 255).astype(np.float32)
        opacity = picture[..., 3:]
        color = 255 * picture[..., :3] * opacity + np.float32(0.5)
        return Stamp(color, 1 - opacity, left - round(x), top - round(self._height - y))


SUFFIXES = (".mp4", ".gif", ".webp")
MAX_FRAMES_PER_S = 25
HEIGHT_PX = 720
HEIGHT_IN = 7.2
# Constant quality: one that adapts to motion takes twice the time, and spends its bytes on pictures
# in which nothing moves.
X264 = {"preset": "ultrafast", "qp": "18"}
ROWS_BETWEEN = 16  # equal rows between two parts of a picture that have changed
# The limit for GIF and WebP, whose pictures are all in memory.
MAX_PICTURES = 3_000
# The number of pictures of the lit home to keep: drawing one takes as long as drawing ten bodies.
MAX_LIT = 24
# The number of pictures that may wait to be encoded, as their changed parts.
MAX_WAITING = 16


def write_film(
    run: Run,
    path: Path,
    first: int,
    end: int,
    *,
    speed: float = 60.0,
    height: int = HEIGHT_PX,
    frames_per_s: int = MAX_FRAMES_PER_S,
) -> int:
    """Write a stretch of a run as a film; return the number of distinct frames.

    Args:
        run: The run.
        path: The file: .mp4, .gif or .webp. An existing file is replaced.
        first: First step.
        end: The step before which to end.
        speed: Simulated time over the time of the film.
        height: The height of the film [pixels].
        frames_per_s: The largest number of frames per second of film.

    Raises:
        InputError: The file name has another suffix, a number is out of range, or the file can't be
            written.
        ArtifactError: The run stored no key frames or no floor plan.
    """
    _check(path, speed, height)
    # Steps between two frames.
    stride = max(1, round(speed * 1e6 / run.manifest["step_us"] / frames_per_s))
    rate = Fraction(speed).limit_denominator(1000) * 1_000_000
    rate /= run.manifest["step_us"] * stride
    kind = path.suffix.lower()[1:]
    total = -(-(end - first) // stride)
    with drawing_style():
        stage = stage_of(run, first, end, stride, height)
        moments = np.flatnonzero(stage.changes())
        frames = draw_frames(stage, first, moments)
        with os_errors_as(InputError, f"{path} can't be written"), partial_file(path) as partial:
            if kind == "mp4":
                _write_mp4(partial, frames, total, rate)
            else:
                _write_pictures(partial, kind, frames, total, rate)
    return len(moments)


def _check(path: Path, speed: float, height: int) -> None:
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(
            f"{path}: a film is written as .mp4, .gif or .webp, not as"
            f" {path.suffix or 'no ending'!r}"
        )
    if not 0.1 <= speed <= 1e6:
        raise InputError(f"--speed {speed:g}: choose from 0.1 to 1,000,000 times real time")
    if not 120 <= height <= 2160:
        raise InputError(f"--height {height}: choose from 120 to 2160 pixels")


def stage_of(run: Run, first: int, end: int, stride: int, height: int = HEIGHT_PX) -> Stage:
    """Return the stage of a film; see `write_film`.

    Args:
        run: The run.
        first: First step.
        end: The step before which to end.
        stride: Steps between two frames.
        height: The height of a frame [pixels].
    """
    plan_width, plan_height = figure_size(run.plan)
    rows = height - height % 2  # encoders require even sizes
    aspect = min(max(plan_width / plan_height, 1.0), 1.9)
    columns = min(2 * round(rows * aspect / 2), 3840)
    dpi = rows / HEIGHT_IN  # text grows with the film
    figure = Figure(figsize=(columns / dpi, rows / dpi), dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    return Stage(run, first, end, figure=figure, stride=stride)


class LitHome:
    """The home without bodies, and its pictures in the lights that were drawn last."""

    def __init__(self, stage: Stage) -> None:
        """Take the home as it is drawn now, without light."""
        canvas: Any = stage.figure.canvas
        self._stage = stage
        self._pixels = np.asarray(canvas.buffer_rgba())
        self._dark = self._pixels.copy()
        self._lit: dict[object, U8] = {}

    def restore(self, draw: Callable[[Sequence[Artist]], None]) -> None:
        """Draw the home in the light of the stage, by a function that draws artists."""
        key = self._stage.light_key
        if key in self._lit:
            self._pixels[:] = self._lit[key]
            return
        self._pixels[:] = self._dark
        draw(self._stage.light_artists)
        if len(self._lit) == MAX_LIT:
            del self._lit[next(iter(self._lit))]
        self._lit[key] = self._pixels.copy()


def draw_frames(stage: Stage, first: int, moments: I64) -> Iterator[tuple[int, U8]]:
    """Yield the number and the pixels of some frames of a film."""
    canvas: Any = stage.figure.canvas
    for artist in (*stage.light_artists, *stage.body_artists, *stage.clock_artists):
        artist.set_animated(True)
    canvas.draw()
    home = LitHome(stage)
    pixels = np.asarray(canvas.buffer_rgba())
    # Kept in one array: matplotlib's own copies take new memory for each, and four times as long.
    scene = pixels.copy()
    width, height = canvas.get_width_height()
    stamps = TextStamps(width, height, stage.figure.dpi)

    def draw(artists: Sequence[Artist]) -> None:
        for artist in artists:
            if isinstance(artist, Text):
                stamps.paste(artist, pixels)
            elif isinstance(artist, Collection) and not artist.get_paths():
                continue  # drawing none takes as long as drawing some
            elif artist.axes is not None:
                artist.axes.draw_artist(artist)

    for moment in moments.tolist():
        if stage.show(first + moment * stage.stride):
            home.restore(draw)
            draw(stage.body_artists)
            scene[:] = pixels
        else:
            pixels[:] = scene
        draw(stage.clock_artists)
        yield moment, pixels


def _write_mp4(path: Path, frames: Iterator[tuple[int, U8]], total: int, rate: Fraction) -> None:
    with extra("film", "an MP4 film needs PyAV"):
        import av
    number, first = next(frames)
    last = np.zeros_like(first)
    rows, columns = first.shape[:2]
    frame = av.VideoFrame(columns, rows, "yuv420p")
    planes = [_array_of(plane) for plane in frame.planes]
    with (
        av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as container,
        ThreadPoolExecutor(1) as thread,
    ):
        stream: Any = container.add_stream("libx264", rate=rate)
        stream.width = columns
        stream.height = rows
        stream.pix_fmt = "yuv420p"
        stream.time_base = stream.codec_context.time_base = frame.time_base = 1 / rate
        stream.thread_type = "FRAME"  # slices of one picture would wait for each other
        stream.options = X264

        def encode(number: int, parts: list[ChangedPart]) -> None:
            for part in parts:
                converted = av.VideoFrame.from_numpy_buffer(part.pixels, format="rgba")
                small = converted.reformat(format="yuv420p")
                part.paste([_array_of(plane) for plane in small.planes], planes)
            frame.pts = number
            container.mux(stream.encode(frame))

        # Encoded in a thread that needs no interpreter, while the next pictures are drawn.
        waiting = deque([thread.submit(encode, number, changed_parts(last, first))])
        for number, pixels in frames:
            waiting.append(thread.submit(encode, number, changed_parts(last, pixels)))
            if len(waiting) > MAX_WAITING:
                waiting.popleft().result()
        while waiting:
            waiting.popleft().result()
        if number < total - 1:  # the last picture stays to the end
            encode(total - 1, [])
        container.mux(stream.encode(None))


def _array_of(plane: Any) -> U8:
    """Return the pixels of a plane of a frame, which share its memory."""
    pixels: U8 = np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)
    return pixels[: plane.height, : plane.width]


class ChangedPart(NamedTuple):
    """A rectangle of a picture: its corner, and its pixels, uint8 (rows, columns, 4)."""

    top: int
    left: int
    pixels: U8

    def paste(self, parts: Sequence[U8], planes: Sequence[U8]) -> None:
        """Paste the rectangle, as planes of brightness and of colours of half the size."""
        for part, plane in zip(parts, planes, strict=True):
            half = 1 if part is parts[0] else 2
            top = self.top // half
            left = self.left // half
            plane[top : top + part.shape[0], left : left + part.shape[1]] = part


def changed_parts(last: U8, pixels: U8) -> list[ChangedPart]:
    """Return the rectangles in which a picture differs from the last, and update the last.

    Converting the colours of whole pictures would take as long as drawing them. Corners and sizes
    are even, as are those of the picture: colours are stored for two by two pixels.

    Args:
        last: uint8 (rows, columns, 4), changed in place.
        pixels: The same of the present picture.

    Example:
        >>> last, pixels = np.zeros((2, 40, 20, 4), np.uint8)
        >>> pixels[3, 5] = pixels[30:33, 8] = 255
        >>> [(part.top, part.left, part.pixels.shape) for part in changed_parts(last, pixels)]
        [(2, 4, (2, 2, 4)), (30, 8, (4, 2, 4))]
        >>> changed_parts(last, pixels)
        []
    """
    changed = last.view(np.uint32)[..., 0] != pixels.view(np.uint32)[..., 0]
    rows = np.flatnonzero(changed.any(axis=1))
    parts = []
    bands = np.split(rows, np.flatnonzero(np.diff(rows) > ROWS_BETWEEN) + 1)
    for band in bands if len(rows) else ():
        columns = np.flatnonzero(changed[band[0] : band[-1] + 1].any(axis=0))
        top, bottom = _even_ends(band)
        left, right = _even_ends(columns)
        part = pixels[top:bottom, left:right].copy()
        last[top:bottom, left:right] = part
        parts.append(ChangedPart(top, left, part))
    return parts


def _even_ends(places: NDArray[np.intp]) -> tuple[int, int]:
    """Return the even numbers that enclose sorted places."""
    return int(places[0]) // 2 * 2, int(places[-1]) // 2 * 2 + 2


def _write_pictures(
    path: Path, kind: str, frames: Iterator[tuple[int, U8]], total: int, rate: Fraction
) -> None:
    """Write a film of the kind gif or webp, whose pictures have durations of their own."""
    from PIL import Image

    numbers: list[int] = []
    pictures: list[Any] = []
    for number, pixels in frames:
        if len(pictures) >= MAX_PICTURES:
            raise InputError(
                f"{kind.upper()} films have at most {MAX_PICTURES} pictures: choose a"
                " higher --speed, a shorter stretch, or .mp4"
            )
        picture = Image.fromarray(pixels).convert("RGB")
        if kind == "gif":
            picture = picture.quantize(128, dither=Image.Dither.NONE)
        numbers.append(number)
        pictures.append(picture)
    lengths = np.diff([*numbers, total]) * float(1000 / rate)
    durations = [max(20, round(length)) for length in lengths.tolist()]
    options = {"append_images": pictures[1:], "duration": durations, "loop": 0, "save_all": True}
    if kind == "webp":
        options |= {"quality": 80, "method": 2}
    pictures[0].save(path, format=kind, **options)
