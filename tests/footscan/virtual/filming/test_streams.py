"""The virtual streams as any HTTP client sees them."""

import http.client
import itertools
import json
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from urllib.parse import urlsplit

import numpy as np
import pytest

from footscan.virtual.filming.stream_faults import KINDS, StreamFault, random_faults, torn
from footscan.virtual.filming.streams import SentFrame, VirtualStreams, free_running

pytestmark = pytest.mark.real_time  # frames are sent over a socket when they are due

JPEG = b"\xff\xd8" + bytes(range(1, 200)) * 10 + b"\xff\xd9"
LIMIT_S = 30.0


def picture(camera: int, seconds: float) -> bytes:
    return JPEG[:2] + f"camera {camera} at {seconds:.6f}".encode() + JPEG[2:]


class Client:
    """Reads the parts of a multipart stream one by one."""

    def __init__(self, url: str) -> None:
        address = urlsplit(url)
        self.connection = http.client.HTTPConnection(str(address.hostname), address.port, timeout=LIMIT_S)
        self.connection.request("GET", address.path)
        self.reply = self.connection.getresponse()
        self.reply.readline()

    def __iter__(self) -> Iterator[bytes]:
        while (kind := self.reply.readline()).strip():
            assert kind == b"Content-Type: image/jpeg\r\n"
            length = int(self.reply.readline().removeprefix(b"Content-Length: "))
            assert self.reply.readline() == b"\r\n"
            yield self.reply.read(length)
            assert self.reply.readline() == b"\r\n"
            assert self.reply.readline() == b"--frame\r\n"


def number_of(jpeg: bytes) -> int:
    """From the comment behind the start of the image."""
    assert jpeg[:4] == b"\xff\xd8\xff\xfe"
    length = int.from_bytes(jpeg[4:6], "big")
    return int(jpeg[6 : 4 + length].removeprefix(b"exposure "))


def until(condition: Callable[[], bool]) -> None:
    limit = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < limit
        time.sleep(0.01)


def test_every_exposure_is_sent_once_and_in_order() -> None:
    with VirtualStreams([1, 2], picture, free_running(100, jitter_s=0.002)) as streams:
        for camera in (1, 2):
            client = Client(streams.url(camera))
            assert client.reply.headers["Content-Type"] == "multipart/x-mixed-replace;boundary=frame"
            frames = list(itertools.islice(client, 30))
            numbers = [number_of(frame) for frame in frames]
            assert numbers == list(range(numbers[0], numbers[0] + 30))
            record = streams.sent(camera)
            for frame, number in zip(frames, numbers, strict=True):
                assert f"camera {camera} at {record[number].exposed:.6f}".encode() in frame


def test_the_default_clock_makes_two_hundred_exposures_in_eleven_seconds() -> None:
    seconds = list(free_running(count=201)(1))
    assert seconds[200] - seconds[0] == pytest.approx(11.0)
    assert np.ptp(np.diff(seconds)) < 1e-9


def test_jitter_stays_within_what_it_may() -> None:
    jittered = np.array(list(free_running(20, jitter_s=0.01, count=500)(3)))
    off = jittered - np.arange(500) / 20
    assert 0.015 < np.ptp(off) <= 0.02 + 1e-6


def test_nothing_is_sent_before_its_delay_is_over() -> None:
    with VirtualStreams([1], picture, free_running(50), latency_s=0.12, jitter_s=0.02) as streams:
        assert len(list(itertools.islice(Client(streams.url(1)), 10))) == 10
        until(lambda: sum(frame.sent is not None for frame in streams.sent(1)) >= 10)
        delays = [frame.sent - frame.exposed for frame in streams.sent(1) if frame.sent is not None]
    assert min(delays) >= 0.12


def test_each_fault_does_what_it_says() -> None:
    faults = {
        1: [StreamFault("drop", 40, 2), StreamFault("repeat", 50), StreamFault("tear", 60), StreamFault("cut", 80)]
    }
    with VirtualStreams([1], picture, free_running(100), faults=faults) as streams:
        frames = list(Client(streams.url(1)))
        until(lambda: len(streams.sent(1)) > 85)
        numbers = [number_of(frame) for frame in frames]
        first = numbers[0]
        assert first < 40
        assert numbers == [49 if n == 50 else n for n in range(first, 80) if n not in {40, 41}]
        assert frames[numbers.index(49) + 1] == frames[numbers.index(49)]
        assert b"\xff\xd9" not in frames[numbers.index(60)]
        again = next(iter(Client(streams.url(1))))
        assert number_of(again) > 80
        kinds = {frame.number: frame.fault for frame in streams.sent(1) if frame.fault}
        assert kinds == {40: "drop", 41: "drop", 50: "repeat", 60: "tear", 80: "cut"}
        assert [frame.sent for frame in streams.sent(1) if frame.fault in {"drop", "cut"}] == [None] * 3


def test_a_stall_ends_in_a_burst() -> None:
    with VirtualStreams([1], picture, free_running(50), faults={1: [StreamFault("stall", 30, 10)]}) as streams:
        frames = list(itertools.islice(Client(streams.url(1)), 50))
        record: dict[int, SentFrame] = {frame.number: frame for frame in streams.sent(1)}
    numbers = [number_of(frame) for frame in frames]
    assert numbers == list(range(numbers[0], numbers[0] + 50))
    last = record[39].sent
    for number in range(30, 40):
        sent = record[number].sent
        assert sent is not None
        assert last is not None
        assert record[39].exposed <= sent <= last


def test_a_cut_camera_hangs_up_on_everyone() -> None:
    with VirtualStreams([1], picture, free_running(100), faults={1: [StreamFault("cut", 20, 1_000_000)]}) as streams:
        until(lambda: len(streams.sent(1)) > 25)
        with pytest.raises((http.client.HTTPException, OSError)):
            Client(streams.url(1))


def test_settings_are_answered_as_they_are() -> None:
    with VirtualStreams([1], picture) as streams:
        url = streams.url(1).replace("/stream", "/control")
        with urllib.request.urlopen(f"{url}?exposure=4.5&gain=0.25", timeout=LIMIT_S) as reply:
            assert json.load(reply) == {"exposure": 4.5, "gain": 0.25}
        assert streams.settings(1) == {"exposure": 4.5, "gain": 0.25}
        for wrong in ("colour=1", "gain=high"):
            with pytest.raises(urllib.error.HTTPError):
                urllib.request.urlopen(f"{url}?{wrong}", timeout=LIMIT_S)
        assert streams.settings(1) == {"exposure": 4.5, "gain": 0.25}


def test_random_faults_are_apart_and_the_same_for_a_seed() -> None:
    for seed in range(50):
        faults = random_faults(seed, 200)
        assert faults == random_faults(seed, 200)
        assert sorted(fault.kind for fault in faults) == sorted(KINDS)
        for before, after in itertools.pairwise(faults):
            assert before.first + before.count < after.first
        assert faults[0].first >= 20
        assert faults[-1].first + faults[-1].count <= 200


def test_too_few_exposures_for_the_faults() -> None:
    with pytest.raises(ValueError, match="at least 48 exposures"):
        random_faults(1, 40)


def test_three_ways_to_tear() -> None:
    whole = bytes(range(30))
    assert torn(whole, 0) == whole[:28]
    assert torn(whole, 1) == whole[:20]
    assert torn(whole, 2) == whole[:10] + whole[20:]
