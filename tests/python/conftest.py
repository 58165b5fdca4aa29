"""Shared helpers: construction of models that this build may not have, and settings."""

import hyst
import pytest
from hypothesis import settings

# Models of the papers that the package does not have yet. Their tests are skipped. If the package has the class, remove
# it from this list (test_models.py checks that).
NOT_IN_THIS_BUILD: set[str] = set()

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")


def build(name, **parameters):
    """Builds the model of that name; skips the test if this build does not have it."""
    if name in NOT_IN_THIS_BUILD and not hasattr(hyst, name):
        pytest.skip(f"{name}: not in this build")
    return getattr(hyst, name)(**parameters)


def pytest_report_header():
    missing = sorted(NOT_IN_THIS_BUILD)
    return f"hyst {hyst.__version__}; not in this build: {', '.join(missing) if missing else 'nothing'}"
