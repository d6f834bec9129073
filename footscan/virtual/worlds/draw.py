"""Draws a whole world from a seed.

The ranges are wider than any scanner is built for, and none follows from what the reconstruction assumes. Each part of
a world has a generator of its own: a new quantity in one part changes no other part of the worlds that exist.
`docs/worlds.md` lists the main ranges with their reasons.
"""

import numpy as np

from schemas.world import (
    Covering,
    Deformity,
    Kind,
    Knock,
    World,
    WorldCameras,
    WorldGlass,
    WorldHead,
    WorldLaser,
    WorldRoom,
    WorldSubject,
)

ROOM, LASER, HEADS, CAMERAS, GLASS, SUBJECT, ASSEMBLED, MOVING, PASSING = range(100, 109)
"""Numbers of the parts' generators."""
HEAD_COUNT = 3
TRAVEL_MM = 400.0
"""The thesis's travel."""
LOWER_CAMERAS = (5, 6, 7, 8)
KINDS: tuple[Kind, ...] = ("foot", "cast", "last")
COVERINGS: tuple[Covering, ...] = ("none", "white sock", "black sock", "patterned sock")


def draw_world(seed: int) -> World:
    """Draw the world of a seed; the same seed gives the same world.

    Examples
    --------
    >>> draw_world(7) == draw_world(7), draw_world(7) == draw_world(8)
    (True, False)
    """
    subject = _subject(_generator(seed, SUBJECT))
    return World(
        seed=seed,
        room=_room(_generator(seed, ROOM)),
        laser=_laser(_generator(seed, LASER)),
        heads=_heads(_generator(seed, HEADS)),
        cameras=_cameras(_generator(seed, CAMERAS), subject.kind),
        glass=_glass(_generator(seed, GLASS)),
        subject=subject,
    )


def draw_assembled(seed: int) -> World:
    """Draw a scanner that was assembled at home and has no other error: what a film of a body can show of it.

    Heads are off by up to 3 mm and 1 degree about each axis, their travels by 0.5 %, sheets are bent by up to 0.5 mm,
    and the shutters take up to 33 ms from the first row to the last. The feet differ too.

    Examples
    --------
    >>> draw_assembled(7).heads[0].ripple_mm
    0.0
    """
    random, subject = _generator(seed, ASSEMBLED), _generator(seed, SUBJECT)

    def head() -> WorldHead:
        yaw, pitch, roll = (_even(random, -1.0, 1.0) for _ in range(3))
        return WorldHead(
            offset_mm=_even(random, -3.0, 3.0),
            yaw_deg=yaw,
            pitch_deg=pitch,
            roll_deg=roll,
            travel_scale=_even(random, -0.005, 0.005),
        )

    foot = WorldSubject(
        side="right" if _happens(subject, 0.5) else "left",
        shape_seed=int(subject.integers(2**31)),
        length_mm=_even(subject, 220.0, 295.0),
        arch_mm=_even(subject, 6.0, 20.0),
        y_mm=_even(subject, -8.0, 8.0),
        turn_deg=_even(subject, -8.0, 8.0),
    )
    cameras = WorldCameras(step_mm=2.0, frames=200, rolling_shutter_ms=_even(random, 0.0, 33.0))
    laser = WorldLaser(bend_mm=_even(random, -0.5, 0.5))
    return World(seed=seed, laser=laser, heads=(head(), head(), head()), cameras=cameras, subject=foot)


def draw_moving(seed: int) -> World:
    """Draw the scanner of `draw_assembled` with a foot that does not stand quite still.

    It sways with an amplitude of up to 0.3 mm, and trembles by up to 0.15 mm (standard deviation).

    Examples
    --------
    >>> draw_moving(7).heads == draw_assembled(7).heads, draw_moving(7).subject.sway_mm > 0.0
    (True, True)
    """
    world, random = draw_assembled(seed), _generator(seed, MOVING)
    moving = {"sway_mm": _even(random, 0.0, 0.3), "tremor_mm": _even(random, 0.0, 0.15)}
    return world.model_copy(update={"subject": world.subject.model_copy(update=moving)})


def draw_passing(seed: int) -> World:
    """Draw the scanner of `draw_moving` whose lower head films in a second pass, 15 to 60 s later.

    Examples
    --------
    >>> 15.0 < draw_passing(7).subject.wait_s < 60.0
    True
    """
    world = draw_moving(seed)
    wait_s = _even(_generator(seed, PASSING), 15.0, 60.0)
    return world.model_copy(update={"subject": world.subject.model_copy(update={"wait_s": wait_s})})


def as_designed(world: World) -> World:
    """The world of `draw_assembled` with an ideal scanner."""
    return world.model_copy(
        update={
            "laser": world.laser.model_copy(update={"bend_mm": 0.0}),
            "heads": (WorldHead(), WorldHead(), WorldHead()),
            "cameras": world.cameras.model_copy(update={"rolling_shutter_ms": 0.0}),
        }
    )


def _generator(seed: int, part: int) -> np.random.Generator:
    return np.random.default_rng([seed, part])


def _room(random: np.random.Generator) -> WorldRoom:
    is_lit = _happens(random, 0.8)
    return WorldRoom(
        light=_log(random, 0.01, 3.0) if is_lit else 0.002,
        warmth=_even(random, -0.3, 0.4),
        flicker=_even(random, 0.0, 0.5) if _happens(random, 0.5) else 0.0,
        mains_hz=50 if _happens(random, 0.6) else 60,
        things=_count(random, 0, 10),
        red_things=_count(random, 0, 3),
        line_things=_count(random, 0, 5),
        sun_patches=_count(random, 0, 2) if is_lit and _happens(random, 0.3) else 0,
        people=_count(random, 0, 2) if _happens(random, 0.3) else 0,
        mirrors=_count(random, 0, 1) if _happens(random, 0.3) else 0,
        head_glints=_count(random, 0, 4),
        room_glints=_count(random, 0, 3),
        stripe_glints=_count(random, 0, 2),
    )


def _laser(random: np.random.Generator) -> WorldLaser:
    return WorldLaser(
        colour=("red", "green", "blue")[int(random.choice(3, p=(0.6, 0.25, 0.15)))],
        power=_log(random, 4.0, 40.0),
        sigma_mm=_log(random, 0.15, 0.7),
        bend_mm=_even(random, -0.5, 0.5) if _happens(random, 0.5) else 0.0,
        speckle=_even(random, 0.04, 0.3),
        lower_lasers=2 if _happens(random, 0.4) else 1,
    )


def _heads(random: np.random.Generator) -> tuple[WorldHead, WorldHead, WorldHead]:
    speed_differs = _happens(random, 0.3)

    def head() -> WorldHead:
        yaw, pitch, roll = (_often_small(random, 1.0) for _ in range(3))
        return WorldHead(
            offset_mm=_often_small(random, 3.0),
            yaw_deg=yaw,
            pitch_deg=pitch,
            roll_deg=roll,
            travel_scale=_often_small(random, 0.005),
            speed=_even(random, 0.5, 1.5) if speed_differs else 1.0,
            jitter_mm=_even(random, 0.0, 0.15),
            ripple_mm=_even(random, 0.0, 0.2),
            ripple_period_mm=_even(random, 20.0, 80.0),
            lost_mm=_even(random, -2.0, 2.0) if _happens(random, 0.1) else 0.0,
            lost_at=_even(random, 0.1, 0.9),
        )

    return head(), head(), head()


def _cameras(random: np.random.Generator, kind: str) -> WorldCameras:
    step_mm = _even(random, 2.0, 5.0)
    missing = sorted(int(camera) for camera in random.choice(8, size=_missing_cameras(random), replace=False) + 1)
    knocks = [int(camera) for camera in random.choice(8, size=int(_happens(random, 0.2)), replace=False) + 1]
    return WorldCameras(
        size="640x480" if _happens(random, 0.85) else "1280x720",
        frames=round(TRAVEL_MM / step_mm),
        step_mm=step_mm,
        frames_per_second=_even(random, 10.0, 30.0),
        gain=_log(random, 0.35, 2.8),
        auto_exposure=_happens(random, 0.2),
        auto_white_balance=_happens(random, 0.3),
        gamma=_even(random, 1.0, 2.4),
        noise=_log(random, 0.5, 3.0),
        blur_px=_even(random, 0.4, 1.4),
        defocus_px=_even(random, 0.0, 1.5),
        smudges=_count(random, 0, 3),
        jpeg_quality=_count(random, 60, 95),
        jpeg_chroma="422" if _happens(random, 0.5) else "420",
        rolling_shutter_ms=_even(random, 0.0, 33.0),
        missing=list(LOWER_CAMERAS) if kind != "foot" else missing,
        knocked=[Knock(camera=camera, mm=_three(random, 0.6), turn_deg=_three(random, 0.2)) for camera in knocks],
        corner_px=_log(random, 0.02, 0.3),
    )


def _missing_cameras(random: np.random.Generator) -> int:
    return int(random.choice(3, p=(0.7, 0.2, 0.1)))


def _glass(random: np.random.Generator) -> WorldGlass:
    return WorldGlass(
        thickness_mm=_even(random, 4.0, 10.0),
        tilt_x_deg=_often_small(random, 0.5),
        tilt_y_deg=_often_small(random, 0.5),
        height_mm=_often_small(random, 1.5),
        ghost=_log(random, 0.005, 0.05),
        scratches=_count(random, 0, 4),
        dust=_count(random, 0, 30),
        fingerprints=_count(random, 0, 3),
        wet_spots=_count(random, 0, 3) if _happens(random, 0.3) else 0,
    )


def _subject(random: np.random.Generator) -> WorldSubject:
    kind = KINDS[int(random.choice(3, p=(0.9, 0.05, 0.05)))]
    covering = COVERINGS[int(random.choice(4, p=(0.7, 0.1, 0.1, 0.1)))]
    skin = _log(random, 0.08, 0.75)
    albedo = {"none": skin, "white sock": 0.8, "black sock": 0.04, "patterned sock": 0.4}[covering]
    length_mm = (
        _even(random, 120.0, 330.0) if _happens(random, 0.4) else float(np.clip(random.normal(257, 18), 200, 320))
    )
    return WorldSubject(
        kind=kind,
        side="right" if _happens(random, 0.5) else "left",
        shape_seed=int(random.integers(2**31)),
        length_mm=length_mm,
        arch_mm=_even(random, 2.0, 24.0),
        toe_gap_mm=_even(random, -1.0, 6.0) if kind == "foot" else -1.0,
        deformity=_deformity(random) if kind == "foot" else Deformity(),
        leg_mm=_even(random, 80.0, 108.0) if kind == "last" else _even(random, 100.0, 250.0),
        y_mm=_even(random, -20.0, 20.0),
        turn_deg=_even(random, -20.0, 20.0),
        covering=covering if kind == "foot" else "none",
        albedo=0.7 if kind != "foot" else albedo,
        scatter_mm=_even(random, 0.3, 2.0) if kind == "foot" and covering == "none" else 0.1,
        hairs=_count(random, 0, 40) if covering == "none" and kind == "foot" else 0,
        nail_gloss=_even(random, 0.0, 1.0) if covering == "none" and kind == "foot" else 0.0,
        tattoos=_count(random, 0, 2) if covering == "none" and _happens(random, 0.2) else 0,
        tremor_mm=_even(random, 0.0, 0.3) if kind == "foot" else 0.0,
        sway_mm=_even(random, 0.0, 1.0) if kind == "foot" and _happens(random, 0.5) else 0.0,
        shift_mm=_shift(random) if kind == "foot" else (0.0, 0.0),
    )


def _deformity(random: np.random.Generator) -> Deformity:
    lost = random.choice(5, size=int(random.integers(1, 4)), replace=False) + 1
    missing_toes = sorted(int(toe) for toe in lost) if _happens(random, 0.06) else []
    return Deformity(
        ankle_swelling_mm=_even(random, 2.0, 12.0) if _happens(random, 0.15) else 0.0,
        hammer_toes=_even(random, 0.2, 1.0) if _happens(random, 0.15) else 0.0,
        missing_toes=missing_toes,
        amputated_at=_even(random, 0.5, 0.72) if _happens(random, 0.04) else None,
    )


def _shift(random: np.random.Generator) -> tuple[float, float]:
    x, y = random.normal(0.0, 0.8, 2) if _happens(random, 0.3) else (0.0, 0.0)
    return round(float(x), 4), round(float(y), 4)


def _even(random: np.random.Generator, low: float, high: float) -> float:
    return round(float(random.uniform(low, high)), 4)


def _log(random: np.random.Generator, low: float, high: float) -> float:
    """Even in the logarithm."""
    return round(float(np.exp(random.uniform(np.log(low), np.log(high)))), 5)


def _often_small(random: np.random.Generator, largest: float) -> float:
    """Zero in half of the worlds, so that the effect of a single error can be told apart; even up to `largest`."""
    value = _even(random, -largest, largest)
    return value if _happens(random, 0.5) else 0.0


def _three(random: np.random.Generator, largest: float) -> tuple[float, float, float]:
    return _even(random, -largest, largest), _even(random, -largest, largest), _even(random, -largest, largest)


def _count(random: np.random.Generator, low: int, high: int) -> int:
    return int(random.integers(low, high + 1))


def _happens(random: np.random.Generator, probability: float) -> bool:
    return bool(random.random() < probability)
