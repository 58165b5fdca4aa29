"""The adapter ``hyst.daq.serial`` with a simulated replacement of ``pyserial``, without hardware. One test runs in real
time.

Convention: drive sample ``k`` is output at clock edge ``k``, and its measurement is the reading one period later.
"""

import inspect
import os
import sys
import threading
import types

import numpy as np
import pytest
from hyst.daq import Daq
from hyst.daq.serial import SerialInstrument

from actuator_stand_in import expected_outputs, play, wave
from pyserial_stand_in import Serial


def make_serial(**changes):
    settings = {"port": "COM3", "set": "VOLT {volts:.6f}", "query": "MEAS?", "min_v": -20, "max_v": 130}
    return SerialInstrument(**{**settings, **changes})


@pytest.mark.parametrize("sizes", [(1,), (4,), (5, 1, 3)])
def test_serial_measures_each_drive_sample_one_period_later(instrument, sizes):
    instrument.latency_s = 0.0
    daq, drive = make_serial(), np.round(wave(60), 6)
    assert isinstance(daq, Daq) and daq.start(50.0) == 50.0
    measured = play(daq, drive, sizes)
    np.testing.assert_allclose(measured["output"], expected_outputs(drive, 50.0), atol=1e-9)
    times, volts = np.array(instrument.sets).T
    np.testing.assert_array_equal(volts, drive)
    np.testing.assert_allclose(np.diff(times), 1 / 50, atol=1e-9)
    daq.stop()
    assert instrument.actuator.volts == 0.0 and instrument.flushed


def test_serial_does_not_drift_and_reports_its_lateness(instrument):
    instrument.latency_s = 4e-3
    daq = make_serial()
    daq.start(50.0)
    play(daq, wave(100), (1,))
    times = np.array(instrument.sets)[:, 0]
    # The first one is not delayed by a query; each of the others is delayed by one query.
    np.testing.assert_allclose(times - times[0], np.arange(100) / 50 + 4e-3 * (np.arange(100) > 0), atol=1e-9)
    assert daq.worst_lateness_s == pytest.approx(4e-3)


def test_serial_starts_its_clock_with_the_first_sample(instrument, clock):
    daq = make_serial()
    daq.start(50.0)
    clock.sleep(5.0)
    assert len(daq.exchange([0.0])["output"]) == 1


def test_serial_identifies_and_scales(instrument):
    instrument.answer, instrument.acknowledge, instrument.end = "POS {:.12f} um", "OK", "\r\n"
    daq = make_serial(
        identify="*IDN?",
        acknowledge="^OK$",
        reply=r"POS (\S+) um",
        end="\r\n",
        baud=115200,
        port_options={"parity": "E"},
        output_per_unit=1e3,
        output_at_0=5.0,
        output="displacement_nm",
    )
    assert daq.capabilities().device == "ACME,PIEZO 1"
    assert instrument.arguments == {"port": "COM3", "baudrate": 115200, "parity": "E", "write_timeout": 0.5}
    daq.start(1.0)
    np.testing.assert_allclose(play(daq, [10.0, 20.0])["output"], [1005.0, 2005.0])


@pytest.mark.parametrize(
    ("answer", "reply"), [("ERR 7", None), ("", None), ("nan", None), ("inf", None), ("\xff\xfe", None), ("7", r"POS (\S+)"), ("POS", r"POS( \d)?")]
)
def test_serial_reports_an_invalid_reply(instrument, answer, reply):
    daq = make_serial(reply=reply)
    daq.start(10.0)
    daq.exchange([50.0]) if reply is None else None
    instrument.answer = answer
    with pytest.raises(RuntimeError, match=r"COM3: the reply to 'MEAS\?' is .*, expected a number: check query and baud"):
        daq.exchange([60.0])
    with pytest.raises(RuntimeError, match=r"after an error stop\(\) first"):
        daq.exchange([60.0])
    daq.stop()
    assert_serial_at_rest(instrument)


def assert_serial_at_rest(instrument):
    """Asserts that the voltage is at rest after a ramp of 100 V/s from 60 V."""
    assert instrument.actuator.volts == 0.0
    times, volts = np.array(instrument.sets).T
    down = volts[list(volts).index(60.0) :]
    assert np.all(np.diff(down) >= -2.0 - 1e-9) and np.all(np.diff(down) < 0)


def test_serial_reports_a_missing_reply(instrument):
    daq = make_serial()
    daq.start(10.0)
    instrument.answer = None
    with pytest.raises(TimeoutError, match=r"COM3: no line in reply to 'MEAS\?' within 0.5 s.*check port, baud \(9600\), end"):
        daq.exchange([60.0])
    daq.stop()
    assert_serial_at_rest(instrument)


def test_serial_closes_the_port_of_an_instrument_that_does_not_identify_itself(instrument):
    instrument.answer = None
    with pytest.raises(TimeoutError, match="no line in reply to 'MEAS"):
        make_serial(identify="MEAS?")
    assert not instrument.port.is_open


@pytest.mark.parametrize("latency_s", [0.011, 0.03])
def test_serial_reports_lateness(instrument, latency_s):
    instrument.latency_s = latency_s
    daq = make_serial()
    daq.start(50.0)
    with pytest.raises(TimeoutError, match=rf"{1e3 * latency_s:.3g} ms late, expected at most 10 ms.* rate of at most {0.25 / latency_s:.2g} Hz"):
        daq.exchange([60.0])
    assert daq.worst_lateness_s == pytest.approx(latency_s)
    daq.stop()
    assert_serial_at_rest(instrument)


def test_serial_reports_a_pause_between_two_calls(instrument, clock):
    daq = make_serial()
    daq.start(50.0)
    daq.exchange([60.0])
    clock.sleep(0.02)
    with pytest.raises(TimeoutError, match="late"):
        daq.exchange([60.0])


def test_serial_reports_a_wrong_acknowledgement(instrument):
    instrument.acknowledge = "ERROR"
    daq = make_serial(acknowledge="OK")
    daq.start(10.0)
    with pytest.raises(RuntimeError, match="the reply to 'VOLT 60.000000' is 'ERROR', expected a match of 'OK'"):
        daq.exchange([60.0])


def test_serial_discards_old_replies(instrument):
    daq = make_serial()
    daq.start(10.0)
    daq._line.incoming = b"77\n"
    assert daq.exchange([0.0])["output"] == [0.0]


def test_serial_reports_a_lost_port(instrument):
    daq = make_serial()
    daq.start(10.0)
    daq.exchange([60.0])
    instrument.lost = True
    with pytest.raises(RuntimeError, match="COM3 cannot take 'VOLT 61.000000': check the cable.*Input/output error"):
        daq.exchange([61.0])
    with pytest.raises(RuntimeError, match="COM3 could not be brought to rest.* last known at 60 V: switch the amplifier off"):
        daq.stop()
    with pytest.raises(RuntimeError, match="COM3 cannot be opened"):
        make_serial()


def test_serial_rejects_an_invalid_voltage_and_continues(instrument):
    daq = make_serial()
    daq.start(10.0)
    daq.exchange([1.0])
    with pytest.raises(ValueError, match="drive sample 0 is 131 V, expected -20 to 130 V"):
        daq.exchange([131.0])
    assert len(daq.exchange([2.0])["output"]) == 1


@pytest.mark.parametrize("template", ["VOLT", "VOLT {}", "VOLT {v}", "VOLT {volts:q}", "VOLT {volts"])
def test_serial_rejects_a_template_without_the_voltage(instrument, template):
    with pytest.raises(ValueError, match="give for example set='VOLT {volts:.4f}'"):
        make_serial(set=template)


def test_serial_rejects_calls_out_of_order(instrument):
    daq = make_serial()
    daq.stop()
    with pytest.raises(RuntimeError, match=r"call start\(rate_hz\)"):
        daq.exchange([0.0])
    with pytest.raises(ValueError, match="rate = 60 Hz, expected 0.01 to 50 Hz"):
        daq.start(60.0)
    daq.start(10.0)
    with pytest.raises(RuntimeError, match="started already"):
        daq.start(10.0)
    daq.stop()
    daq.stop()
    daq.close()
    assert not daq._line.is_open


def test_serial_names_the_missing_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(ImportError, match="pip install pyserial"):
        make_serial()


def test_serial_detects_another_package_of_the_same_name(monkeypatch):
    monkeypatch.setitem(sys.modules, "serial", types.ModuleType("serial"))
    with pytest.raises(ImportError, match="pip uninstall serial, then pip install pyserial"):
        make_serial()


def test_replacement_has_the_signatures_of_pyserial():
    serial = pytest.importorskip("serial")
    for name in ("__init__", "read_until", "reset_input_buffer", "flush", "close"):
        mine, vendor = (inspect.signature(getattr(cls, name)) for cls in (Serial, serial.Serial))
        assert list(mine.parameters) in (list(vendor.parameters), ["self", "args", "kwargs"]) or name == "__init__", name
    vendor = inspect.signature(serial.serialutil.SerialBase.__init__).parameters
    assert list(inspect.signature(Serial.__init__).parameters) == list(vendor)
    assert issubclass(serial.SerialException, OSError)


def test_serial_works_with_pyserial_at_a_pseudo_terminal():
    """In real time, if pyserial is installed. At 5 Hz, so that a busy computer is not late."""
    pytest.importorskip("serial")
    tty = pytest.importorskip("tty")
    ours, theirs = os.openpty()
    tty.setraw(ours)
    tty.setraw(theirs)
    sets = []

    def answer():
        with open(ours, "r+b", buffering=0) as line:
            while (command := line.readline().decode().strip()) != "QUIT":
                if command.startswith("V="):
                    sets.append(float(command[2:]))
                else:
                    line.write(b"ACME\r\n" if command == "ID?" else f"POS {0.1 * sets[-1]:.4f} um\r\n".encode())

    thread = threading.Thread(target=answer, daemon=True)
    thread.start()
    daq = make_serial(port=os.ttyname(theirs), set="V={volts:.3f}", query="MEAS?", identify="ID?", reply=r"POS (\S+)", end="\r\n")
    assert daq.capabilities().device == "ACME"
    daq.start(5.0)
    np.testing.assert_allclose(play(daq, [1.0, 2.0, 3.0], (1,))["output"], [0.1, 0.2, 0.3])
    daq.stop()
    daq._send("QUIT")
    thread.join(5.0)
    assert sets == [1.0, 2.0, 3.0, 1.5, 0.0]
    # The thread has closed its end, as with a disconnected cable.
    daq.start(5.0)
    with pytest.raises(RuntimeError, match="check the cable"):
        daq.exchange([1.0])
    with pytest.raises(RuntimeError, match="could not be brought to rest"):
        daq.stop()
    daq.close()
    os.close(theirs)
