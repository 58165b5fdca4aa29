"""What the tests share: the models that this build has, and drives."""

import hyst
import pytest
from hypothesis import settings

# Models of the papers that the package does not have yet. Their tests are written and skipped; a class that appears must
# be taken off this list (test_models.py says so).
NOT_IN_THIS_BUILD: set[str] = set()

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")


def build(name, **parameters):
    """The model of that name; skips the test if this build is not meant to have it."""
    if name in NOT_IN_THIS_BUILD and not hasattr(hyst, name):
        pytest.skip(f"{name}: not in this build")
    return getattr(hyst, name)(**parameters)


def pytest_report_header():
    missing = sorted(NOT_IN_THIS_BUILD)
    return f"hyst {hyst.__version__}; not in this build: {', '.join(missing) if missing else 'nothing'}"
