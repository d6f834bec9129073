"""Ranking of lasts beside deviations worked out by hand."""

from collections.abc import Callable
from typing import Any

import pytest

from footscan.sizing.lasts import rank_lasts
from schemas.base.errors import RefusedInput
from schemas.feet import Foot
from schemas.lasts import Last, LastRules, Ranking
from schemas.sizes import SizeTable

MakeFoot = Callable[..., Foot]
FOOT = {
    "foot_length": 260.0,
    "ball_length": 192.0,
    "ball_girth": 245.0,
    "waist_girth": 235.0,
    "instep_girth": 240.0,
    "heel_girth": 325.0,
}
FITTING = {
    "length": 272.0,
    "ball_length": 194.0,
    "ball_girth": 244.0,
    "waist_girth": 230.0,
    "instep_girth": 235.0,
    "heel_girth": 330.0,
}


def last(name: str, side: str = "both", **measures: float) -> Last:
    told: dict[str, Any] = {"name": name, "side": side, "measures": FITTING | measures, "place": f"{name} {side}"}
    return Last.model_validate(told)


@pytest.fixture
def rules(table: SizeTable) -> LastRules:
    return table.lasts


def order(ranking: Ranking) -> list[str]:
    return [ranked.name for ranked in ranking.lasts]


def test_deviations_and_score_of_one_last(make_foot: MakeFoot, rules: LastRules) -> None:
    """Beyond what everyday shoes allow: length 3 mm, ball girth -2 mm, heel girth 1.5 mm."""
    lasts = [last("a", length=278.0, ball_girth=239.0, heel_girth=336.5)]
    [ranked] = rank_lasts([make_foot(**FOOT)], lasts, rules, "everyday").lasts
    fit = ranked.feet["right"]
    assert {name: (one.difference, one.outside) for name, one in fit.deviations.items()} == {
        "length": (18.0, 3.0),
        "ball_length": (2.0, 0.0),
        "ball_girth": (-6.0, -2.0),
        "waist_girth": (-5.0, 0.0),
        "instep_girth": (-5.0, 0.0),
        "heel_girth": (11.5, 1.5),
    }
    assert ranked.score == fit.score == 9.0 + 4.0 + 2.25
    assert (ranked.rank, fit.rejected, fit.mirrored, fit.not_compared) == (1, [], False, [])


def test_weights_count(make_foot: MakeFoot, rules: LastRules) -> None:
    everyday = rules.purposes["everyday"]
    heavy = {**everyday, "length": everyday["length"].model_copy(update={"weight": 2.5})}
    weighted = rules.model_copy(update={"purposes": {"heavy": heavy}})
    [ranked] = rank_lasts([make_foot(**FOOT)], [last("a", length=277.0)], weighted, "heavy").lasts
    assert ranked.score == 2.5 * 2.0**2


@pytest.mark.parametrize(
    ("purpose", "scores"),
    [
        ("dress", {238.0: 0.0, 245.0: 0.0, 247.0: 4.0, 251.0: 36.0}),  # -8 to 0
        ("everyday", {238.0: 9.0, 245.0: 0.0, 247.0: 0.0, 251.0: 16.0}),  # -4 to +2
        ("comfort", {238.0: 49.0, 245.0: 0.0, 247.0: 0.0, 251.0: 0.0}),  # 0 to +6
    ],
)
def test_the_purpose_decides_how_tight_a_last_may_be(
    make_foot: MakeFoot, rules: LastRules, purpose: str, scores: dict[float, float]
) -> None:
    lasts = [last(f"{girth:g}", ball_girth=girth) for girth in scores]
    ranking = rank_lasts([make_foot(**FOOT)], lasts, rules, purpose)
    assert {float(ranked.name): ranked.score for ranked in ranking.lasts} == scores


def test_the_best_last_is_first_and_those_alike_by_the_middle(make_foot: MakeFoot, rules: LastRules) -> None:
    lasts = [
        last("long", length=276.0),
        last("edge", length=270.0),
        last("middle", length=272.5),
        last("far", length=280),
    ]
    ranking = rank_lasts([make_foot(**FOOT)], lasts, rules, "everyday")
    assert [(ranked.rank, ranked.name) for ranked in ranking.lasts] == [
        (1, "middle"),
        (2, "edge"),
        (3, "long"),
        (4, "far"),
    ]
    assert order(rank_lasts([make_foot(**FOOT)], lasts[::-1], rules, "everyday")) == order(ranking)


@pytest.mark.parametrize(
    ("measure", "value", "reason"),
    [
        ("length", 264.9, "length minus the foot's is +4.9 mm, expected at least +5"),
        ("ball_girth", 232.9, "ball_girth minus the foot's is -12.1 mm, expected at least -12"),
    ],
)
def test_hard_rejects(make_foot: MakeFoot, rules: LastRules, measure: str, value: float, reason: str) -> None:
    poor = last("poor", length=320.0, heel_girth=300.0)
    lasts = [last("out", **{measure: value}), last("limit", length=265.0, ball_girth=233.0), poor]
    ranking = rank_lasts([make_foot(**FOOT)], lasts, rules, "everyday")
    assert [(ranked.rank, ranked.name) for ranked in ranking.lasts] == [(1, "limit"), (2, "poor"), (None, "out")]
    assert ranking.lasts[-1].feet["right"].rejected == [reason]


def test_a_pair_by_the_worse_foot(make_foot: MakeFoot, rules: LastRules) -> None:
    left = make_foot("left", **FOOT | {"foot_length": 264.0})
    right = make_foot("right", **FOOT)
    lasts = [last("for the right", length=270.0), last("for both", length=274.5)]
    ranking = rank_lasts([right, left], lasts, rules, "everyday")
    assert order(ranking) == ["for both", "for the right"]
    best, second = ranking.lasts
    assert best.score == 0.0
    assert (second.score, second.worse) == (16.0, "left")  # 6 mm longer than the left foot, 10 are wished
    assert {side: fit.score for side, fit in second.feet.items()} == {"left": 16.0, "right": 0.0}
    assert order(rank_lasts([right], lasts, rules, "everyday")) == ["for both", "for the right"]
    assert rank_lasts([right], lasts, rules, "everyday").lasts[1].score == 0.0


def test_what_is_too_short_for_one_foot_is_out_for_the_pair(make_foot: MakeFoot, rules: LastRules) -> None:
    left, right = make_foot("left", **FOOT | {"foot_length": 268.0}), make_foot("right", **FOOT)
    [ranked] = rank_lasts([left, right], [last("a")], rules, "everyday").lasts
    assert ranked.rank is None
    assert [bool(fit.rejected) for fit in ranked.feet.values()] == [True, False]


def test_each_foot_gets_the_last_of_its_side(make_foot: MakeFoot, rules: LastRules) -> None:
    left, right = make_foot("left", **FOOT), make_foot("right", **FOOT)
    lasts = [last("pair", "left", length=271.0), last("pair", "right", length=273.0), last("single", "left")]
    by_name = {one.name: one for one in rank_lasts([left, right], lasts, rules, "everyday").lasts}
    lengths = {side: fit.deviations["length"].last for side, fit in by_name["pair"].feet.items()}
    assert lengths == {"left": 271.0, "right": 273.0}
    assert {side: fit.mirrored for side, fit in by_name["pair"].feet.items()} == {"left": False, "right": False}
    assert {side: fit.mirrored for side, fit in by_name["single"].feet.items()} == {"left": False, "right": True}


def test_what_is_not_measured_is_not_compared(make_foot: MakeFoot, rules: LastRules) -> None:
    foot = make_foot(**FOOT | {"heel_girth": {"value": None, "status": "incomplete", "note": "a gap"}})
    bare = Last(name="bare", measures={"length": 272.0, "ball_girth": 244.0}, place="bare")
    ranking = rank_lasts([foot], [bare, last("full")], rules, "everyday")
    assert ranking.missing == ["right: heel_girth is incomplete: a gap"]
    assert order(ranking) == ["full", "bare"]  # both fit, but more is known of one
    assert ranking.lasts[0].feet["right"].not_compared == ["heel_girth"]
    assert ranking.lasts[1].feet["right"].not_compared == ["ball_length", "waist_girth", "instep_girth", "heel_girth"]


@pytest.mark.parametrize("missing", ["foot_length", "ball_girth"])
def test_a_foot_without_length_or_girth_is_refused(make_foot: MakeFoot, rules: LastRules, missing: str) -> None:
    foot = make_foot(source="foot.json", **FOOT | {missing: {"value": None, "note": "a gap"}})
    with pytest.raises(
        RefusedInput, match=rf"^foot.json: {missing} is incomplete: a gap, expected it to choose a last"
    ):
        rank_lasts([foot], [last("a")], rules, "everyday")


def test_what_is_no_pair_is_refused(make_foot: MakeFoot, rules: LastRules) -> None:
    right = make_foot(source="b", **FOOT)
    for feet in ([right, right], [right, make_foot("unknown", source="b", **FOOT)], [right, right, right]):
        with pytest.raises(RefusedInput, match=r"^b: expected one foot, or a left and a right one, found right, "):
            rank_lasts(feet, [last("a")], rules, "everyday")
    with pytest.raises(RefusedInput, match=r"^purpose: expected one of everyday, dress, comfort, found 'ski'$"):
        rank_lasts([right], [last("a")], rules, "ski")


def test_the_best_of_a_thousand_lasts(make_foot: MakeFoot, rules: LastRules) -> None:
    feet = [make_foot("left", **FOOT), make_foot("right", **FOOT)]
    lasts = [last(f"{number}", length=240.0 + number / 10) for number in range(1000)]
    ranking = rank_lasts(feet, lasts, rules, "everyday")
    assert ranking.lasts[0].name == "325"  # 272.5: 12.5 mm longer than the foot
