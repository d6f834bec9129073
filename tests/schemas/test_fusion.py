"""What the fusion's report says of heads that disagree."""

import pytest

from schemas.fusion import Disagreement, FusionReport, PairDisagreement

HEADS = {1: 1, 2: 1, 3: 2, 4: 2}


def report(of_pairs: dict[tuple[int, int], float], points: int = 100) -> FusionReport:
    """Cameras that disagree by so much, and not at all after their correction."""
    corrected = Disagreement(median_mm=0.0, deviation_mm=0.0, rms_mm=0.0, systematic_mm=0.0)
    return FusionReport(
        pairs=[
            PairDisagreement(
                cameras=pair,
                points=points,
                before=Disagreement(median_mm=mm, deviation_mm=0.0, rms_mm=mm, systematic_mm=mm),
                after=corrected,
            )
            for pair, mm in of_pairs.items()
        ],
        heads=HEADS,
    )


def test_heads_that_disagree_put_all_measures_in_doubt_whatever_corrections_made_them_agree_on() -> None:
    apart = report(dict.fromkeys([(1, 3), (1, 4), (2, 3), (2, 4)], 0.53))
    assert apart.heads_apart == {(1, 2): 0.53}
    assert apart.systematic_mm == pytest.approx(0.53)
    assert (apart.doubt or "").startswith("heads 1 and 2 place the same skin 0.53 mm apart")
    assert report(dict.fromkeys([(1, 3), (1, 4), (2, 3), (2, 4)], 0.1)).doubt is None


def test_a_knocked_camera_beside_a_good_one_is_no_head_that_disagrees() -> None:
    knocked = report({(1, 2): 0.8, (1, 3): 0.8, (1, 4): 0.8, (2, 3): 0.02, (2, 4): 0.03})
    assert knocked.doubt is None
    assert knocked.systematic_mm == pytest.approx(0.03)


def test_few_comparisons_say_nothing_of_heads() -> None:
    assert report({(1, 3): 0.9}, points=3).heads_apart == {}
