"""`footscan devices`."""

from typing import Any

from pipelines.cli.live.options import RIG, VIRTUAL_FOLDER, RigFile, Virtual, VirtualFolder, opened_rig, plain_world
from pipelines.cli.terminal.output import AsJson, note, print_json, print_line, print_table


def devices(
    rig: RigFile = None,
    virtual: Virtual = False,
    virtual_folder: VirtualFolder = VIRTUAL_FOLDER,
    as_json: AsJson = False,
) -> None:
    """List serial ports and cameras with their buses, and what the rig expects."""
    from pipelines.live.devices import devices_json

    if rig is None and not virtual and not RIG.exists():
        found = devices_json(None)
    else:
        with opened_rig(rig, virtual_folder, plain_world(virtual, virtual_folder)) as opened:
            found = devices_json(opened.rig)
    if as_json:
        print_json(found)
    else:
        _print(found)


def _print(found: dict[str, Any]) -> None:
    ports = [[port["stable_name"], port["words"]] for port in found["serial_ports"]]
    print_table("Serial ports", ["port", "adapter"], ports) if ports else print_line("No serial port.")
    cameras = [[one["device"], one["name"], one["bus"] or "-", one["problem"] or "ok"] for one in found["cameras"]]
    print_table("Cameras", ["device", "name", "bus", ""], cameras) if cameras else print_line(
        "No camera on this computer."
    )
    if "rig" not in found:
        note("no rig.yaml here: nothing is expected")
        return
    there = {None: "on the network", True: "there", False: "missing"}
    rows = [
        [
            str(one["camera"]),
            str(one["head"]),
            one["device"],
            there[one["there"]],
            "-" if one["latency_ms"] is None else f"{one['latency_ms']:.1f}",
        ]
        for one in found["rig"]["cameras"]
    ]
    print_table(f"Rig, board at {found['rig']['port']}", ["camera", "head", "device", "", "latency (ms)"], rows)
    for each in found["rig"]["passes"]:
        print_line(each["reason"])
