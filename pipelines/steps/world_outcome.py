"""What a reconstruction made of a world, beside the truth."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import coordinates
from footscan.virtual.optics.scene import Mesh
from footscan.virtual.worlds.judge import Truth
from pipelines.arrays import unpack
from schemas.campaign import ShapeError, WorldMeasure, WorldOutcome
from schemas.fusion import FusionReport
from schemas.heads import HeadsReport
from schemas.measures import Measures
from schemas.world import World


def run(inputs: Mapping[str, bytes], parameters: World, places: Mapping[str, Path]) -> bytes:
    """Compare cloud, surface and measures with the truth.

    `inputs`: the `world` with its truth, the `kind` of the world, `heads`, `cleaned`, `fused`, `oriented`, `surface`
    and `measures`.
    """
    del places
    world = unpack(inputs["world"])
    truth = Truth(Mesh(world["vertices"], world["faces"]))
    surface, oriented = unpack(inputs["surface"]), unpack(inputs["oriented"])
    measured = surface["vertices"][~surface["filled"]].astype(np.float64)
    turn, shift = truth.registered(measured)

    def error(points: NDArray[np.float64]) -> ShapeError:
        return _shape_error(truth.distances(points @ turn.T + shift))

    measures = Measures.model_validate_json(inputs["measures"])
    agreement = FusionReport.model_validate_json(unpack(inputs["fused"])["report"].tobytes())
    cleaning: list[str] = json.loads(unpack(inputs["cleaned"])["warnings"].tobytes())
    heads = HeadsReport.model_validate_json(inputs["heads"])
    known: dict[str, float | None] = json.loads(world["measures"].tobytes())
    outcome = WorldOutcome(
        seed=parameters.seed,
        kind=json.loads(inputs["kind"]),
        problem=measures.finding,
        covered=world["covered"].item(),
        shift_mm=float(np.linalg.norm((turn - np.eye(3)) @ measured.mean(axis=0) + shift)),
        cloud=error(coordinates(oriented["cloud"])),
        surface=error(measured),
        # A foot that moved is a warning of the points, and the doubt of its measures.
        warnings=list(dict.fromkeys([*heads.warnings, *cleaning, *agreement.warnings, *measures.warnings])),
        measures={
            name: WorldMeasure(
                value=measure.value,
                truth=known[name],
                sigma=measure.uncertainty,
                status=measure.status,
                budget=measure.budget,
                note=measure.note,
            )
            for name, measure in measures.measures.items()
            if name in known
        },
    )
    return (outcome.model_dump_json(indent=2) + "\n").encode()


def _shape_error(distances: NDArray[np.float64]) -> ShapeError:
    return ShapeError(
        mean=float(distances.mean()),
        p95=float(np.quantile(distances, 0.95)),
        p99=float(np.quantile(distances, 0.99)),
        largest=float(distances.max()),
        beyond_1mm=float(np.mean(distances > 1.0)),
        beyond_2mm=float(np.mean(distances > 2.0)),
    )
