from dataclasses import replace
from itertools import combinations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from footscan.capture.cameras.usb_bus import HIGH_SPEED_US, UsbCamera, microframe_us, plan_passes
from schemas.base.errors import RefusedInput

GREEDY = (128, 512, 1024, 1536, 2048, 3072)
"""Settings of a common webcam, in bytes a microframe."""


def cameras(bus: str = "usb1", numbers: range = range(1, 9), reserved: int | None = None) -> list[UsbCamera]:
    return [UsbCamera(n, bus, f"1-1.{n}", 480, GREEDY, reserved=reserved) for n in numbers]


def groups(given: list[UsbCamera]) -> list[tuple[int, ...]]:
    return [step.cameras for step in plan_passes(given)]


def test_time_on_a_high_speed_bus() -> None:
    """3072 bytes: 38 * 8 + 3 bits of overhead, 3072 * 8 * 7 / 6 = 28672 bits with stuffing, at 480 bits a us."""
    assert microframe_us(3072, 480) == pytest.approx((307 + 28672) / 480)
    assert microframe_us(1024, 480) == pytest.approx((307 + 9557) / 480)
    assert microframe_us(0, 480) == 0


def test_time_on_a_super_speed_bus() -> None:
    """Three packets of 1024 bytes with 128 of overhead each, ten bits a byte, at 5000 bits a us."""
    assert microframe_us(3072, 5000) == pytest.approx(3 * 1152 * 10 / 5000)


def test_eight_greedy_cameras_on_one_hub_film_one_at_a_time() -> None:
    """As the thesis had to: two of them would take 121 of 100 us."""
    passes = plan_passes(cameras())
    assert [step.cameras for step in passes] == [(n,) for n in range(1, 9)]
    assert passes[0].reason == (
        "Pass 1 of 8, camera 1: bus usb1 grants 100 us of a microframe and has 8 cameras of up to 60.4 us (3072 bytes)."
    )


def test_two_controllers_halve_the_passes() -> None:
    found = groups(cameras("usb1", range(1, 5)) + cameras("usb3", range(5, 9)))
    assert found == [(1, 5), (2, 6), (3, 7), (4, 8)]


def test_the_fuller_of_two_buses_decides() -> None:
    passes = plan_passes(cameras("usb1", range(1, 3)) + cameras("usb3", range(3, 9)))
    assert len(passes) == 6
    assert "bus usb3" in passes[0].reason


def test_usb_2_cameras_behind_usb_3_hubs_share_the_usb_2_bus_beside_it() -> None:
    behind = [replace(camera, port=f"1-{camera.camera // 3}.{camera.camera % 3}") for camera in cameras()]
    assert len(groups(behind)) == 8


def test_super_speed_cameras_film_together() -> None:
    fast = [replace(camera, bus="usb2", speed_mbit=5000, payloads=(1024, 3072, 12288)) for camera in cameras()]
    [step] = plan_passes(fast[:4])
    assert step.cameras == (1, 2, 3, 4)
    assert step.reason == "All 4 cameras in one pass: bus usb2 carries 111 of 112 us."


def test_what_a_camera_has_reserved_counts_more_than_what_it_might() -> None:
    """800 bytes take 16.2 us: six go together."""
    assert sorted(map(len, groups(cameras(reserved=800)))) == [2, 6]
    assert groups(cameras(reserved=512)) == [tuple(range(1, 9))]


def test_bulk_cameras_reserve_nothing() -> None:
    assert len(groups([replace(camera, is_bulk=True, payloads=()) for camera in cameras()])) == 1


def test_network_cameras_are_on_no_bus() -> None:
    [step] = plan_passes([UsbCamera(n) for n in range(1, 9)])
    assert step.cameras == tuple(range(1, 9))
    assert "on no USB bus of this computer" in step.reason


def test_network_cameras_film_in_the_first_pass() -> None:
    assert groups([*cameras(numbers=range(1, 3)), UsbCamera(3)]) == [(1, 3), (2,)]


def test_what_is_not_known_is_told() -> None:
    [step] = plan_passes([replace(camera, payloads=()) for camera in cameras(numbers=range(1, 3))])
    assert "what cameras 1, 2 will reserve is not known" in step.reason


def test_a_camera_at_full_speed_films_by_itself_and_is_told() -> None:
    slow = replace(cameras()[0], speed_mbit=12.0)
    passes = plan_passes([slow, *cameras(numbers=range(2, 4), reserved=512)])
    assert [step.cameras for step in passes] == [(1,), (2, 3)]
    assert "camera 1 got no more than 12 Mbit/s: try another cable or port" in passes[0].reason


def test_no_cameras_no_passes() -> None:
    assert plan_passes([]) == []


def test_a_camera_twice_is_refused() -> None:
    with pytest.raises(RefusedInput, match="each camera once"):
        plan_passes(cameras() + cameras(numbers=range(8, 9)))


def test_more_than_a_bus_holds_is_refused() -> None:
    with pytest.raises(RefusedInput, match="camera 1 reserves"):
        plan_passes([replace(cameras()[0], payloads=(8192,))])


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(1, 4900), min_size=1, max_size=6))
def test_no_plan_has_fewer_passes(payloads: list[int]) -> None:
    """Beside all ways to put up to six cameras into groups, one after the other."""
    planned = [UsbCamera(n, "usb1", None, 480, (payload,)) for n, payload in enumerate(payloads)]
    costs = [microframe_us(payload, 480) for payload in payloads]
    passes = groups(planned)
    assert sorted(sum(passes, ())) == list(range(len(payloads)))
    assert all(sum(costs[n] for n in step) <= HIGH_SPEED_US + 1e-6 for step in passes)
    assert len(passes) == _fewest(frozenset(range(len(payloads))), costs)


def _fewest(left: frozenset[int], costs: list[float]) -> int:
    if not left:
        return 0
    first = min(left)
    others = sorted(left - {first})
    return 1 + min(
        _fewest(left - {first, *more}, costs)
        for count in range(len(others) + 1)
        for more in combinations(others, count)
        if costs[first] + sum(costs[n] for n in more) <= HIGH_SPEED_US
    )
