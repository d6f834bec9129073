import numpy as np

from footscan.cloud.fusion.motion import MOST_TERMS, SCALE_MM, moved

CENTRE = np.array([1.0, 40.0])
RANGES = np.array([[-30.0, 0.0], [31.0, 80.0]])


def move(yz: tuple[float, float], **terms: float) -> list[float]:
    """One point by the coefficients of the terms t0 to t11."""
    coefficients = np.zeros(MOST_TERMS)
    for name, coefficient in terms.items():
        coefficients[int(name[1:])] = coefficient
    return moved(np.array([yz]), coefficients, CENTRE, RANGES)[0].round(9).tolist()


def test_rigid_terms_by_hand() -> None:
    assert move((5.0, 6.0), t0=0.3, t1=-0.2) == [5.3, 5.8]
    # 25 mm above the centre half a coefficient, towards -Y.
    assert move((1.0, 65.0), t2=0.2) == [0.9, 65.0]
    assert move((1.0 + SCALE_MM, 40.0), t2=0.2) == [51.0, 40.2]


def test_smooth_terms_by_hand() -> None:
    # u = 0.5 and v = -0.4
    point = (26.0, 20.0)
    assert move(point, t3=1.0) == [26.5, 19.6]
    assert move(point, t4=1.0) == [26.5, 20.4]
    assert move(point, t5=1.0) == [25.6, 20.5]
    assert move(point, t6=1.0) == [26.25, 20.0]
    assert move(point, t10=1.0) == [26.0, 19.8]
    assert move(point, t11=1.0) == [26.0, 20.16]


def test_smooth_terms_end_at_the_range() -> None:
    # At Y = 81 as at 31, where u = 0.6.
    assert move((81.0, 40.0), t6=1.0) == [81.36, 40.0]
    assert move((81.0, 40.0), t2=1.0) == [81.0, 41.6]
