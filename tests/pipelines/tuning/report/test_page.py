"""The page of a search: well formed, self-contained, with escaped names."""

import re
from html.parser import HTMLParser
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from footscan.stripe.points import STRIPE_DTYPE
from pipelines.tuning.report.influence import share_of_variance
from pipelines.tuning.report.page import sentences, tune_page
from pipelines.tuning.report.plots import course, trade_off
from pipelines.tuning.report.result import FrameChange, Gain, Goal, Trial, TuneResult
from pipelines.tuning.report.stripe_change import change_by_frame

HOSTILE = '<script>alert("1")</script>&'
ACCURACY = Goal("accuracy", "mm", "mean distance of the surface to the truth")
COMPLETENESS = Goal("completeness", "%", "share of the truth", larger_is_better=True)


def trial(number: int, *, front: bool = False, problem: str | None = None) -> Trial:
    return Trial(
        number=number,
        point={"extraction.red_threshold": 10 + number, "extraction.centre_method": "fir" if number % 2 else HOSTILE},
        values={"accuracy": 0.05 - 0.001 * number, "completeness": 95.0},
        of_sets={"accuracy": {"P1/a": 0.05}, "completeness": {"P1/a": 95.0}},
        problems={"P1/a": problem} if problem else {},
        on_front=front,
    )


@pytest.fixture
def result() -> TuneResult:
    trials = [*(trial(number, front=number == 9) for number in range(10)), trial(10, problem=f"no {HOSTILE}")]
    held_out = [
        Gain(ACCURACY, {"P2/a": (0.050, 0.038), "P3/a": (0.060, 0.046)}),
        Gain(COMPLETENESS, {"P2/a": (95.0, 94.0), "P3/a": (95.0, 95.4), "P4/a": (None, 96.0)}),
    ]
    image = np.full((60, 80, 3), 40, np.uint8)
    change = FrameChange(HOSTILE, 3, 17, image, np.array([[10.25, 20.0], [11, 20]]), np.empty((0, 2)))
    notes = [f"said of {HOSTILE}"]
    gains = [Gain(ACCURACY, {HOSTILE: (0.05, 0.04)}), Gain(COMPLETENESS, {"P1/a": (95, 95)})]
    return TuneResult([ACCURACY, COMPLETENESS], "tpe", notes, trials, trials[9], gains, held_out, [change])


class Elements(HTMLParser):
    """Elements and words of a page; fails at a wrong end tag."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open, self.tags, self.addresses, self.words = list[str](), list[str](), list[str](), ""
        self.feed(page)
        assert self.open == []

    def handle_starttag(self, tag: str, attributes: Any) -> None:
        self.tags.append(tag)
        self.addresses += [value for name, value in attributes if name in {"src", "href"}]
        if tag not in {"meta", "img", "wbr"}:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attributes: Any) -> None:
        self.handle_starttag(tag, attributes)
        if tag not in {"meta", "img", "wbr"}:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += f" {data.strip()}"


def test_page_is_whole_and_asks_for_nothing(result: TuneResult) -> None:
    page = Elements(tune_page(result))
    assert "script" not in page.tags
    assert page.addresses
    assert all(address.startswith("data:image/jpeg;base64,") for address in page.addresses)
    assert page.words.count(HOSTILE) > 5
    for words in ("Trial 9 of 10 is best", "at present", "of the winner", "1 trials in which scans failed"):
        assert words in page.words


def test_page_is_the_same_for_the_same(result: TuneResult) -> None:
    assert tune_page(result) == tune_page(result)


def test_sentences_tell_whether_a_gain_is_real(result: TuneResult) -> None:
    first, second = sentences(result)
    assert first == (
        "accuracy, on the held-out scans: gain 0.0130 mm, better on 2 of 2 data sets, "
        "spread between them 0.0014 mm: real."
    )
    assert second == (
        "completeness, on the held-out scans: the present parameters fail on 1 of 3 data sets, the winner on 0. "
        "On the others: loss 0.30 %, better on 1 of 2 data sets, spread between them 0.99 %: "
        "no larger than the spread, it can be chance."
    )


def test_without_held_out_scans_that_is_said(result: TuneResult) -> None:
    plain = TuneResult(**{**vars(result), "held_out": [], "changes": []})
    assert sentences(plain) == [
        "accuracy, on the scans that chose it: gain 0.0100 mm; a single data set does not show whether that is real.",
        "completeness, on the scans that chose it: no gain.",
    ]
    words = Elements(tune_page(plain)).words
    assert "Held-out" not in words
    assert "Where the stripe changes" not in words


def places(drawing: str) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', drawing)]


def test_plots_hold_a_point_for_each_sound_trial(result: TuneResult) -> None:
    drawn = places(course(ACCURACY, result.trials, result.winner))
    assert len(drawn) == 10  # the one that failed is left out
    by_number = sorted(drawn)
    assert all(b[1] > a[1] for a, b in pairwise(by_number))  # it falls: downwards, y grows
    assert len(places(trade_off(ACCURACY, COMPLETENESS, result.trials, result.winner))) == 10
    assert places(course(ACCURACY, result.trials, result.winner))[-1] == by_number[-1]  # the winner lies on top


def test_share_of_variance() -> None:
    generator = np.random.default_rng(1)
    threshold = generator.integers(8, 60, 200).tolist()
    method = generator.choice(["gravity", "fir"], 200).tolist()
    values = [abs(value - 30) + generator.normal(0, 1) for value in threshold]
    share, other = share_of_variance(threshold, values), share_of_variance(method, values)
    assert share is not None
    assert other is not None
    assert share > 0.75  # although it neither rises nor falls on the whole
    assert other < 0.03
    assert share_of_variance(["a"] * 5 + ["b"] * 5, [1, 2, 3, 4, 5, 11, 12, 13, 14, 15]) == pytest.approx(
        1 - (20 / 8) / (82.5 / 9)  # ranks 1 to 10: 10 within each half, 82.5 in all
    )
    assert share_of_variance([1, 2, 3], [1, 2, 3]) is None
    assert share_of_variance([1] * 9, range(9)) is None
    assert share_of_variance(range(9), [1.0] * 9) is None


def stripe(*points: tuple[int, float, float]) -> Any:
    found = np.zeros(len(points), STRIPE_DTYPE)
    for name, column in zip(("frame", "i", "j"), zip(*points, strict=True), strict=False):
        found[name] = column
    return found


def test_change_of_a_frame_is_how_far_its_points_move() -> None:
    a = stripe((0, 10, 10), (0, 12, 10), (2, 50, 50))
    b = stripe((0, 10, 10.5), (0, 12, 10), (1, 10, 10))
    # frame 0: 0.5 both ways; frame 1 and 2: a point that has no other counts 10 px
    np.testing.assert_allclose(change_by_frame(a, b, 4), [1.0, 10.0, 10.0, 0.0])
    np.testing.assert_allclose(change_by_frame(a, b[:0], 4), [20.0, 0.0, 10.0, 0.0])
    np.testing.assert_array_equal(change_by_frame(a, a, 4), np.zeros(4))
