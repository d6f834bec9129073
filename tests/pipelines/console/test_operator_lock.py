"""The page in charge: entering, leaving, taking over."""

import pytest

from pipelines.console.operator_lock import GONE_SECONDS, OperatorLock
from schemas.base.errors import RefusedInput


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


def test_the_first_page_is_in_charge_until_it_is_gone() -> None:
    clock = Clock()
    charge = OperatorLock(clock)
    assert charge.holder is None
    charge.enter("one")
    charge.enter("two")
    assert charge.holder == "one"
    charge.leave("one")
    clock.now += GONE_SECONDS - 0.1
    assert charge.holder == "one", "it may only be loading another page"
    with pytest.raises(RefusedInput, match="another page is in charge"):
        charge.need("two")
    clock.now += 0.2
    assert charge.holder is None
    charge.need("two")
    assert charge.holder == "two"


def test_a_page_that_is_loaded_anew_stays_in_charge() -> None:
    clock = Clock()
    charge = OperatorLock(clock)
    charge.enter("one")
    charge.leave("one")
    clock.now += 1.0
    charge.enter("one")
    clock.now += 1000.0
    assert charge.holder == "one"


def test_two_streams_of_one_page_count_as_one() -> None:
    clock = Clock()
    charge = OperatorLock(clock)
    charge.enter("one")
    charge.enter("one")
    charge.leave("one")
    clock.now += 1000.0
    assert charge.holder == "one"


def test_taking_over() -> None:
    charge = OperatorLock(Clock())
    charge.enter("one")
    charge.enter("two")
    charge.take("two")
    charge.need("two")
    with pytest.raises(RefusedInput):
        charge.need("one")
