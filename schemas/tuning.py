"""The search of `footscan tune`: the section `tune:` of workflow.yaml, and the journal of its trials."""

import difflib
from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
    TypeAdapter,
    ValidationError,
    field_validator,
    model_validator,
)

from schemas.base.model import Document
from schemas.parameters.scan import ScanParameters

Objective = Literal["accuracy", "accuracy_p99", "repeatability", "completeness", "disagreement", "false_points", "time"]
Sampler = Literal["grid", "random", "tpe", "nsga2"]


class SearchRange(Document):
    """Values from `low` to `high`, both included; whole ones where the parameter is a whole number."""

    low: float
    high: float
    log: bool = False
    """True if equal ratios count as equal steps."""
    step: Annotated[float, Field(gt=0)] | None = None
    """Step from value to value, starting at `low`; a grid over numbers that are not whole needs it."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.low >= self.high:
            raise ValueError(f"expected low below high, found {self.low:g} and {self.high:g}")
        if self.log and (self.low <= 0 or self.step is not None):
            raise ValueError("log: expected low above 0 and no step")
        return self


def _as_list(patterns: Any) -> Any:
    return [patterns] if isinstance(patterns, str) else patterns


def _kind_of_search(value: Any) -> str:
    return "choices" if isinstance(value, list) else "range"


def _kind_of_held_out(value: Any) -> str:
    try:
        float(value)
    except (TypeError, ValueError):
        return "scans"
    return "share"


Patterns = Annotated[list[Annotated[str, Field(min_length=1)]], BeforeValidator(_as_list), Field(min_length=1)]
"""Patterns of scans as `patient/scan`, with `*`, `?` and `[...]` as in a shell."""
Search = Annotated[
    Annotated[SearchRange, Tag("range")] | Annotated[list[Any], Field(min_length=1), Tag("choices")],
    Discriminator(_kind_of_search),
]
HeldOut = Annotated[
    Annotated[Patterns, Tag("scans")] | Annotated[float, Field(gt=0, lt=1), Tag("share")],
    Discriminator(_kind_of_held_out),
]


def _accuracy_alone() -> list[Objective]:
    return ["accuracy"]


class Tuning(Document):
    """The parameters that are sought, the scans that decide, and the objectives."""

    data: Patterns = Field(default_factory=lambda: ["*"])
    """Scans of the archive that decide, without those held out."""
    held_out: HeldOut | None = None
    """Scans that take no part in the search and test its winner; or a share, drawn by `seed`, of the patients."""
    search: Annotated[dict[str, Search], Field(min_length=1)]
    """Values to try for each parameter, by `section.name`: a range, or a list."""
    objectives: Annotated[list[Objective], Field(min_length=1)] = Field(default_factory=_accuracy_alone)
    """Objectives to optimise; with several, the search seeks their Pareto front."""
    sampler: Sampler = "tpe"
    """`grid` tries every combination; the others are Optuna's."""
    trials: Annotated[int, Field(ge=1, le=10_000)] = 40
    """Number of different sets of parameters that are tried; a grid is tried as a whole."""
    seed: Annotated[int, Field(ge=0)] = 1

    @field_validator("objectives")
    @classmethod
    def _each_once(cls, objectives: list[Objective]) -> list[Objective]:
        if len(set(objectives)) < len(objectives):
            raise ValueError("expected each objective once")
        return objectives

    @field_validator("search")
    @classmethod
    def _of_known_parameters(cls, search: Mapping[str, SearchRange | list[Any]]) -> dict[str, SearchRange | list[Any]]:
        """Check that each parameter accepts its values; choices become the parameter's own type."""
        wrong: dict[str, ValueError] = {}
        checked: dict[str, SearchRange | list[Any]] = {}
        for name, tried in search.items():
            try:
                checked[name] = _checked(name, tried)
            except ValueError as error:
                wrong[name] = error
        if wrong:
            raise ValidationError.from_exception_data(
                cls.__name__,
                [{"type": "value_error", "loc": (n,), "input": {}, "ctx": {"error": e}} for n, e in wrong.items()],
            )
        return checked


class TuneJournal(Document):
    """The first line of a journal: the search that the trials below belong to."""

    format: Literal["footscan.trials/1"] = "footscan.trials/1"
    search: dict[str, Any]
    sampler: Sampler
    seed: int
    objectives: list[Objective]


class TriedPoint(Document):
    """A further line of a journal: a set of parameters whose steps have all been run."""

    point: dict[str, Any] | None
    """Value of each parameter that is sought; None for the present values."""
    seconds: dict[str, float]
    """Duration of each step that was run for it, by the key of its action."""


def is_whole(name: str) -> bool:
    """True if a parameter `section.name` is a whole number."""
    return _fields()[name][0] is int


@cache
def _fields() -> dict[str, tuple[Any, TypeAdapter[Any]]]:
    """Type and value check of each parameter, by `section.name`."""
    found: dict[str, tuple[Any, TypeAdapter[Any]]] = {}
    for section, model in ScanParameters.model_fields.items():
        if model.exclude:  # a preset, which is no parameter itself
            continue
        assert isinstance(model.annotation, type)
        assert issubclass(model.annotation, BaseModel)
        for name, field in model.annotation.model_fields.items():
            checks: Any = Annotated[(field.annotation, *field.metadata)] if field.metadata else field.annotation
            found[f"{section}.{name}"] = field.annotation, TypeAdapter(checks)
    return found


def _checked(name: str, tried: SearchRange | list[Any]) -> SearchRange | list[Any]:
    """The values to try for a parameter, choices in its own type; ValueError if the parameter does not accept them."""
    if name not in _fields():
        near = difflib.get_close_matches(name, _fields(), n=1)
        raise ValueError("unknown parameter, " + (f"did you mean {near[0]!r}?" if near else "expected SECTION.NAME"))
    kind, adapter = _fields()[name]
    if isinstance(tried, list):
        values = _taken(tried, adapter)
        if any(values.count(value) > 1 for value in values):
            raise ValueError("expected each value once")
        return values
    if kind not in (int, float):
        raise ValueError("is no number, expected a list of values")
    if kind is int and any(value % 1 for value in (tried.low, tried.high, tried.step or 0)):
        raise ValueError("is a whole number, expected such a low, high and step")
    _taken([kind(tried.low), kind(tried.high)], adapter)
    return tried


def _taken(values: list[Any], adapter: TypeAdapter[Any]) -> list[Any]:
    try:
        return [adapter.dump_python(adapter.validate_python(value), mode="json") for value in values]
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        problem = str(first["msg"])
        raise ValueError(f"{problem[0].lower()}{problem[1:]}, found {str(first['input'])[:80]!r}") from None
