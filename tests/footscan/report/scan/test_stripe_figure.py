"""Figures of an extraction, read back as pixels and as data of their axes."""

import io
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from footscan.report.scan.stripe_figure import film_figure, frame_figure
from footscan.stripe.points import STRIPE_DTYPE, StripePoints

ROWS, COLUMNS = 200, 300


def points_at(i: object, j: object, score: float = 1.0, **known: object) -> StripePoints:
    i, j = np.broadcast_arrays(np.asarray(i, np.float64), np.asarray(j, np.float64))
    points = np.zeros(i.size, STRIPE_DTYPE)
    points["i"], points["j"], points["score"] = i, j, score
    points["width"], points["peak"], points["sigma"] = 4.0, 200.0, 0.05
    for name, value in known.items():
        points[name] = value
    return points


def line_at(i: NDArray[np.floating]) -> NDArray[np.floating]:
    return 60 + 0.3 * i


def red_line() -> NDArray[np.uint8]:
    """A black frame with a red line 9 px wide along `line_at`."""
    j, i = np.mgrid[0:ROWS, 0:COLUMNS]
    image = np.zeros((ROWS, COLUMNS, 3), np.uint8)
    image[np.abs(j - line_at(i)) <= 4] = [255, 0, 0]
    return image


def read(png: bytes) -> NDArray[np.int16]:
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), np.int16)


def stripe_in(picture: NDArray[np.int16]) -> tuple[NDArray[np.bool_], NDArray[np.int16]]:
    """Mask of red in the smallest rectangle around all red, and the pixels of that rectangle."""
    red = (picture[..., 0] > 100) & (picture[..., 1:].max(axis=2) < 40)
    rows, columns = np.nonzero(red.any(axis=1))[0], np.nonzero(red.any(axis=0))[0]
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    return red[box], picture[box]


@pytest.mark.parametrize("off", [-2.5, 0.0, 3.0])
def test_points_lie_where_they_do_on_the_stripe(off: float) -> None:
    i = np.arange(COLUMNS)
    red, pixels = stripe_in(read(frame_figure(red_line(), points_at(i, line_at(i) + off))))
    drawn_px = red.shape[1] / COLUMNS
    points = pixels[..., 1] > 60  # only points are green
    assert COLUMNS < points.sum() < red.sum() / 3  # both are seen
    rows, columns = np.nonzero(red | points)
    slope, start = np.polyfit(columns, rows, 1)
    assert slope == pytest.approx(0.3, abs=0.01)
    rows, columns = np.nonzero(points)
    apart = (rows - slope * columns - start) / drawn_px
    assert apart.mean() == pytest.approx(off, abs=0.1)
    assert np.ptp(apart) < 1.0


def test_a_score_has_its_colour() -> None:
    i = np.arange(COLUMNS)
    low, high = (stripe_in(read(frame_figure(red_line(), points_at(i, line_at(i), score))))[1] for score in (0.0, 1.0))
    blue, yellow = (lambda p: p[..., 2] > p[..., 0] + 20), (lambda p: np.minimum(p[..., 0], p[..., 1]) > 150)
    assert blue(low).sum() > COLUMNS
    assert yellow(high).sum() > COLUMNS
    assert blue(high).sum() == yellow(low).sum() == 0


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Collects the figures that are drawn, before they become pixels."""
    figures: list[Figure] = []

    def keep(figure: Figure) -> bytes:
        figures.append(figure)
        return b""

    monkeypatch.setattr("footscan.report.scan.stripe_figure.png_of", keep)
    return figures


def panel_of(figure: Figure, label: str) -> Axes:
    return next(axes for axes in figure.axes if label in {axes.get_xlabel(), axes.get_ylabel()})


def title_of(figure: Figure) -> str:
    return figure.get_suptitle()


@pytest.mark.parametrize("down", [False, True], ids=["across", "down"])
def test_what_was_measured_stands_in_line_with_the_stripe(drawn: list[Figure], down: bool) -> None:
    along, across = np.array([10.0, 11.0, 12.0, 80.0]), np.array([5.0, 5.1, 5.2, 5.3])
    widths = np.array([3.0, 4.0, 5.0, 6.0])
    i, j = (across, along) if down else (along, across)
    frame_figure(np.zeros((100, 100, 3), np.uint8), points_at(i, j, width=widths))
    [figure] = drawn
    width = panel_of(figure, "width, px")
    picture = panel_of(figure, "row j, px")
    data = np.asarray(width.collections[0].get_offsets())
    np.testing.assert_allclose(data, np.column_stack([widths, j] if down else [i, widths]), atol=1e-6)
    if down:
        assert width.get_ylim() == picture.get_ylim() == (99.5, -0.5)
        assert width.get_position().y0 == pytest.approx(picture.get_position().y0)
        assert width.get_position().y1 == pytest.approx(picture.get_position().y1)
    else:
        assert width.get_xlim() == picture.get_xlim() == (-0.5, 99.5)
        assert width.get_position().x0 == pytest.approx(picture.get_position().x0)
        assert width.get_position().x1 == pytest.approx(picture.get_position().x1)
    share = "1 % of the columns and 4 % of the rows" if down else "4 % of the columns and 1 % of the rows"
    assert title_of(figure) == (
        f"4 points in 100 x 100 px, in {share}\nmedians: width 4.5 px, peak 200, expected sigma 0.050 px"
    )


@pytest.mark.parametrize("size", [(1, 640), (640, 1), (1, 1), (3000, 20), (600, 8000)], ids=str)
def test_a_frame_of_any_shape_is_drawn(size: tuple[int, int]) -> None:
    rows, columns = size
    image = np.full((rows, columns, 3), 90, np.uint8)
    diagonal = np.linspace(0, 1, 200)
    for points in (points_at([], []), points_at(diagonal * (columns - 1), diagonal * (rows - 1))):
        picture = read(frame_figure(image, points))
        assert max(picture.shape) < 3000
        assert np.all(picture == 63, axis=2).sum() > 50_000  # 90, dimmed


def test_a_large_frame_is_scaled_down_to_its_means(drawn: list[Figure]) -> None:
    image = np.zeros((600, 8000, 3), np.uint8)
    image[:, ::2] = 200
    frame_figure(image, points_at([], []))
    shown = panel_of(drawn[0], "row j, px").images[0]
    assert shown.get_extent() == [-0.5, 7999.5, 599.5, -0.5]
    pixels = np.asarray(shown.get_array())
    assert max(pixels.shape) < 1500
    assert np.abs(pixels.mean() - 70) < 2
    assert title_of(drawn[0]) == "no stripe in 8000 x 600 px"


def test_the_same_frame_gives_the_same_bytes_in_threads() -> None:
    i = np.arange(COLUMNS)
    points = points_at(i, line_at(i))
    with ThreadPoolExecutor(2) as pool:
        pictures = list(pool.map(lambda _: frame_figure(red_line(), points), range(2)))
    assert len(set(pictures)) == 1


def grey_of(number: int) -> int:
    return 40 + 5 * number


def film(count: int, lost: tuple[int, ...] = ()) -> Iterator[NDArray[np.uint8] | None]:
    """Frames of 20 x 10 px, each of one grey, all in the same buffer, as a film is decoded."""
    buffer = np.empty((10, 20, 3), np.uint8)
    for number in range(count):
        buffer[:] = grey_of(number)
        yield None if number in lost else buffer
    buffer[:] = 255


def test_frames_shown_are_spread_over_those_with_a_stripe(drawn: list[Figure]) -> None:
    points = np.concatenate([points_at([3, 4], [5, 5], frame=number) for number in range(10, 25)])
    film_figure(film(40), 40, points)
    shown = {axes.get_title(): np.asarray(axes.images[0].get_array()) for axes in drawn[0].axes if axes.images}
    numbers = [9, 10, 13, 16, 18, 21, 24, 25]  # without points: the one before and the one behind
    assert list(shown) == [f"frame {number}: {'2 points' if 10 <= number < 25 else 'no stripe'}" for number in numbers]
    marks = next(line for axes in drawn[0].axes for line in axes.lines if line.get_label() == "frame shown above")
    assert list(marks.get_xdata()) == numbers
    for number, pixels in zip(numbers, shown.values(), strict=True):
        assert np.unique(pixels).tolist() == [round(grey_of(number) * 0.7)]
    assert title_of(drawn[0]) == "30 points in 15 of 40 frames"


def test_a_film_without_stripe_shows_frames_from_end_to_end(drawn: list[Figure]) -> None:
    film_figure(film(15), 15, points_at([], []))
    titles = [axes.get_title() for axes in drawn[0].axes if axes.images]
    assert titles == [f"frame {number}: no stripe" for number in (0, 2, 4, 6, 8, 10, 12, 14)]
    assert title_of(drawn[0]) == "no stripe in 15 frames"


def frames_shown(figure: Figure) -> list[int]:
    return [int(axes.get_title().split(":")[0].removeprefix("frame ")) for axes in figure.axes if axes.images]


@pytest.mark.parametrize(
    ("held", "lost", "shown"),
    [
        (range(8), (), [0, 1, 2, 3, 4, 5, 6, 7]),
        (range(9), (), [0, 1, 2, 3, 5, 6, 7, 8]),
        ([4], (), [3, 4, 5]),
        ([4], (3, 5), [4]),
        ([0, 1, 3, 4], (), [0, 1, 2, 3, 4]),
        ([0, 1, 3, 4], (2,), [0, 1, 3, 4, 5]),
        ([1, 8], (3,), [1, 2, 7, 8]),
        ([], (0, 8), [1, 2, 3, 4, 5, 6, 7]),
    ],
    ids=["all", "all of more", "beside", "lost beside", "between", "lost between", "many between", "none"],
)
def test_frames_without_a_stripe_are_shown_too(
    drawn: list[Figure], held: Sequence[int], lost: tuple[int, ...], shown: list[int]
) -> None:
    count = len(held) if len(held) > 7 else 9
    points = np.concatenate([points_at([], []), *(points_at([3, 4], [5, 5], frame=number) for number in held)])
    film_figure(film(count, lost), count, points, lost)
    assert frames_shown(drawn[0]) == shown


def test_without_points_there_are_words_and_no_axes(drawn: list[Figure]) -> None:
    frame_figure(red_line(), points_at([], []))
    film_figure(film(15), 15, points_at([], []))
    for figure, pictures in zip(drawn, (1, 8), strict=True):
        assert [len(axes.images) for axes in figure.axes] == [1] * pictures
        parts = [figure, *figure.subfigs]
        assert [text.get_text() for part in parts for text in part.texts if text is not part._suptitle] == ["no stripe"]
    assert panel_of(drawn[0], "row j, px").get_xlabel() == "column i, px"


@pytest.mark.parametrize("points", [points_at(np.arange(10), 5), points_at([], [])], ids=["stripe", "none"])
def test_a_title_begins_with_whose_it_is(drawn: list[Figure], points: StripePoints) -> None:
    about = "a$x$_\u8db3.png, gap_px=4.0"  # math text of matplotlib, and a letter that its font lacks
    frame_figure(np.zeros((300, 300, 3), np.uint8), points, about)
    film_figure(film(4), 4, points, about=about)
    for figure in drawn:
        assert title_of(figure).splitlines()[0] == "a$x$_\N{REPLACEMENT CHARACTER}.png, gap_px=4.0"
        assert len(title_of(figure).splitlines()) > 1


@pytest.mark.parametrize("size", [(300, 300), (3000, 20), (20, 3000)], ids=str)
def test_a_long_title_stands_above_the_picture(drawn: list[Figure], size: tuple[int, int]) -> None:
    about = "film-of-a-foot.avi, " + ", ".join(f"parameter_{number}_px={number}.0" for number in range(15))
    frame_figure(np.zeros((*size, 3), np.uint8), points_at(np.arange(10), 5), about)
    [figure] = drawn
    box = figure._suptitle.get_window_extent()
    assert " ".join(title_of(figure).splitlines()).startswith(about)
    assert box.x0 > 0
    assert box.x1 < figure.bbox.x1
    assert box.y1 < figure.bbox.y1
    assert box.y0 > panel_of(figure, "row j, px").get_window_extent().y1


def test_what_was_found_over_the_travel(drawn: list[Figure]) -> None:
    """Frame 0: half of the 20 columns, one of the 10 rows; frame 1: none; frame 2: lost; frame 3: down a column."""
    across = points_at(np.arange(10), 3.2, frame=0, width=np.arange(10.0))
    twice = points_at([4.4, 4.4], [3.2, 9.0], frame=0, width=[4.0, 5.0])  # in the same column
    down = points_at(7.0, np.arange(8), frame=3, peak=np.arange(8.0))
    film_figure(film(4, lost=(2,)), 4, np.concatenate([across, twice, down]), [2])
    [figure] = drawn
    nan = np.nan
    by_label = {line.get_label(): line.get_ydata() for line in panel_of(figure, "covered, % of the image").lines}
    np.testing.assert_allclose(by_label["columns that hold a point"], [50, 0, nan, 5])
    np.testing.assert_allclose(by_label["rows that hold a point"], [20, 0, nan, 80])
    np.testing.assert_allclose(panel_of(figure, "points a frame").lines[0].get_ydata(), [12, 0, nan, 8])
    np.testing.assert_allclose(panel_of(figure, "width, px").lines[0].get_ydata(), [4.5, nan, nan, 4])
    np.testing.assert_allclose(panel_of(figure, "peak, grey levels").lines[0].get_ydata(), [200, nan, nan, 3.5])
    assert title_of(figure) == "20 points in 2 of 4 frames; 1 lost"


@pytest.mark.parametrize(
    ("count", "lost", "points"),
    [
        (1, (), points_at(np.arange(20), 4)),
        (1, (0,), points_at([], [])),
        (5, (0, 1, 2, 3, 4), points_at([], [])),
        (9, (3,), points_at(np.arange(20), 4, frame=8)),
    ],
    ids=["one frame", "one lost", "all lost", "one of many"],
)
def test_a_film_of_any_kind_is_drawn(count: int, lost: tuple[int, ...], points: StripePoints) -> None:
    rows, columns = read(film_figure(film(count, lost), count, points, lost)).shape[:2]
    assert columns == 1430
    assert rows > (500 if len(points) else 300)  # words instead of panels


def test_the_same_film_gives_the_same_bytes() -> None:
    points = points_at(np.arange(20), 4, frame=2)
    assert film_figure(film(5), 5, points) == film_figure(film(5), 5, points)
