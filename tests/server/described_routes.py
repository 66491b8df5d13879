"""Every route keeps its description in `/openapi.json`: bodies, answers and errors, with valid and
invalid values; for `test_fuzz.py`."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings

from tests.kit.sizes import size

EXAMPLES = size("EXAMPLES", 2, 250)


def check_every_route_answers_what_the_description_states(address: str) -> None:
    schemathesis = pytest.importorskip("schemathesis")
    schema = schemathesis.openapi.from_url(address + "/openapi.json")
    operations = [result.ok() for result in schema.get_all_operations()]
    assert len(operations) > 50
    faults = [fault for operation in operations for fault in faults_of(operation)]
    assert not faults, "\n\n".join(faults)


def faults_of(operation: Any) -> list[str]:
    """Try an operation with all checks; return its faults."""
    from schemathesis.checks import CHECKS, load_all_checks
    from schemathesis.core.failures import FailureGroup

    load_all_checks()
    # The description cannot distinguish a model's bytes from other bytes, which answer 422.
    left_out = "positive_data_acceptance" if operation.path.endswith("/file") else ""
    checks = [check for check in CHECKS.get_all() if check.__name__ != left_out]
    faults = []

    @settings(
        max_examples=EXAMPLES,
        deadline=None,
        database=None,
        derandomize=True,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=operation.as_strategy())
    def send(case: Any) -> None:
        try:
            case.call_and_validate(checks=checks)
        except FailureGroup as error:
            faults.append(f"{case.method} {case.path}: {error}"[:1500])

    send()
    return faults[:1]
