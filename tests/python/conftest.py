"""Shared helpers: construction of models that this build may not have, replacements of devices, and settings."""

import sys
import types

import hyst
import pytest
from hypothesis import settings
from hyst.daq import ni
from hyst.daq import serial as serial_adapter

import nidaqmx_stand_in
import pyserial_stand_in
from actuator_stand_in import Clock

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


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(ni, "time", clock)
    monkeypatch.setattr(serial_adapter, "time", clock)
    return clock


@pytest.fixture
def card(monkeypatch, clock):
    """Installs the replacement of the package ``nidaqmx``. Returns its card."""
    contents = {
        "nidaqmx": {"Task": nidaqmx_stand_in.Task, "DaqError": nidaqmx_stand_in.DaqError},
        "nidaqmx.constants": {
            "AcquisitionType": nidaqmx_stand_in.AcquisitionType,
            "Edge": nidaqmx_stand_in.Edge,
            "RegenerationMode": nidaqmx_stand_in.RegenerationMode,
            "TerminalConfiguration": nidaqmx_stand_in.TerminalConfiguration,
        },
        "nidaqmx.errors": {"Error": nidaqmx_stand_in.Error, "DaqError": nidaqmx_stand_in.DaqError},
        "nidaqmx.stream_readers": {"AnalogMultiChannelReader": nidaqmx_stand_in.AnalogMultiChannelReader},
        "nidaqmx.stream_writers": {"AnalogSingleChannelWriter": nidaqmx_stand_in.AnalogSingleChannelWriter},
    }
    for name, members in contents.items():
        module = types.ModuleType(name)
        vars(module).update(members)
        monkeypatch.setitem(sys.modules, name, module)
        if "." in name:
            setattr(sys.modules["nidaqmx"], name.partition(".")[2], module)
    card = nidaqmx_stand_in.Card(clock)
    monkeypatch.setattr(nidaqmx_stand_in.Task, "card", card)
    return card


@pytest.fixture
def instrument(monkeypatch, clock):
    """Installs the replacement of the package ``serial``. Returns the instrument at its port."""
    module = types.ModuleType("serial")
    module.Serial, module.SerialException = pyserial_stand_in.Serial, pyserial_stand_in.SerialException
    monkeypatch.setitem(sys.modules, "serial", module)
    instrument = pyserial_stand_in.Instrument(clock)
    monkeypatch.setattr(pyserial_stand_in.Serial, "instrument", instrument)
    return instrument
