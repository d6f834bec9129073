"""`footscan calibrate latency`."""

from typing import Annotated

import typer

from pipelines.cli.live.options import (
    VIRTUAL_FOLDER,
    RigFile,
    StateTeller,
    Virtual,
    VirtualFolder,
    opened_rig,
    plain_world,
)
from pipelines.cli.terminal.output import AsJson, message, print_json, print_table


def latency(
    rig: RigFile = None,
    from_mm: Annotated[
        float | None, typer.Option(help="Start of the passes, mm; default: that of the rig's travel.")
    ] = None,
    to_mm: Annotated[
        float | None, typer.Option(help="End of the passes, mm; default: that of the rig's travel.")
    ] = None,
    power: Annotated[float, typer.Option(min=0.01, max=1, help="Power of the lasers, as a share of full power.")] = 1.0,
    exposure_ms: Annotated[
        float, typer.Option(min=0.05, max=1000, help="Exposure of all cameras, ms; preferably that of later scans.")
    ] = 10.0,
    virtual: Virtual = False,
    virtual_folder: VirtualFolder = VIRTUAL_FOLDER,
    as_json: AsJson = False,
) -> int:
    """Find the latency of each camera from passes forth and back over an object placed at an angle."""
    from pipelines.live.latencies import measure_latencies, rig_with
    from pipelines.live.light import light_by_hand
    from pipelines.live.rig_file import write_rig
    from pipelines.live.scanner import LiveScanner

    world = plain_world(virtual, virtual_folder, "block")
    with opened_rig(rig, virtual_folder, world) as opened:
        if world is not None:
            from pipelines.live.virtual.world import block_range_mm

            from_mm, to_mm = block_range_mm(world)
        travel, light = opened.rig.travel, light_by_hand(opened.rig, power, exposure_ms)
        with LiveScanner(opened.rig) as scanner:
            scanner.listen(StateTeller())
            scanner.connect()
            measured = measure_latencies(
                scanner,
                travel.start_mm if from_mm is None else from_mm,
                travel.end_mm if to_mm is None else to_mm,
                light,
                lambda *_: None,
            )
        write_rig(opened.file, rig_with(opened.rig, measured.latencies, light))
    figures = [
        {
            "camera": camera,
            "latency_ms": round(1e3 * one.seconds, 3),
            "sd_ms": round(1e3 * one.sd_s, 3),
            "exposure_share": round(one.exposure_share, 3),
            "frame_sd_ms": round(1e3 * one.frame_sd_s, 3),
            "play_mm": round(one.play_mm, 4),
        }
        for camera, one in sorted(measured.latencies.items())
    ]
    if as_json:
        print_json({"cameras": figures, "problems": {str(k): v for k, v in measured.problems.items()}})
    else:
        names = ["camera", "latency_ms", "sd_ms", "exposure_share", "frame_sd_ms", "play_mm"]
        print_table("", names, [[f"{one[name]:g}" for name in names] for one in figures])
    for problem in measured.problems.values():
        message(f"footscan: {problem}")
    return 1 if measured.problems else 0
