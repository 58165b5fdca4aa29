"""The adapters of ``hyst.daq`` with simulated replacements of the vendors' packages, without hardware. One test runs in
real time.

Convention: drive sample ``k`` is output at clock edge ``k``, and its measurement is the reading one period later.
"""

import inspect
import math
import os
import sys
import threading
import types

import numpy as np
import pytest
from hyst.daq import Daq, ni
from hyst.daq import serial as serial_adapter
from hyst.daq.ni import Ni
from hyst.daq.serial import SerialInstrument

from daq_stand_ins import (
    GAIN,
    PER_V,
    TAU_S,
    AcquisitionType,
    AIChannelCollection,
    AnalogMultiChannelReader,
    AnalogSingleChannelWriter,
    AOChannelCollection,
    Card,
    Clock,
    DaqError,
    DaqReadError,
    Edge,
    Error,
    InStream,
    Instrument,
    OutStream,
    RegenerationMode,
    Serial,
    SerialException,
    Task,
    TerminalConfiguration,
    Timing,
)


def expected_outputs(drive, rate_hz):
    """Returns the output of the actuator if each voltage is held for one period and measured at its end."""
    outputs, output = [], 0.0
    for volts in drive:
        output += (0.1 * volts - output) * -math.expm1(-1 / rate_hz / TAU_S)
        outputs.append(output)
    return np.array(outputs)


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
        "nidaqmx": {"Task": Task, "DaqError": DaqError},
        "nidaqmx.constants": {
            "AcquisitionType": AcquisitionType,
            "Edge": Edge,
            "RegenerationMode": RegenerationMode,
            "TerminalConfiguration": TerminalConfiguration,
        },
        "nidaqmx.errors": {"Error": Error, "DaqError": DaqError},
        "nidaqmx.stream_readers": {"AnalogMultiChannelReader": AnalogMultiChannelReader},
        "nidaqmx.stream_writers": {"AnalogSingleChannelWriter": AnalogSingleChannelWriter},
    }
    for name, members in contents.items():
        module = types.ModuleType(name)
        vars(module).update(members)
        monkeypatch.setitem(sys.modules, name, module)
        if "." in name:
            setattr(sys.modules["nidaqmx"], name.partition(".")[2], module)
    card = Card(clock)
    monkeypatch.setattr(Task, "card", card)
    return card


def make_ni(**changes):
    settings = {"drive": "Dev1/ao0", "sensor": "Dev1/ai0", "amplifier_gain": GAIN, "output_per_v": PER_V, "min_v": -20, "max_v": 130}
    return Ni(**{**settings, **changes})


def play(daq, drive, sizes=(64,)):
    """Plays a drive as the runner does: in blocks, then with empty calls until every sample has arrived."""
    parts, sent, received, calls = [], 0, 0, 0
    while received < len(drive):
        block = drive[sent : sent + sizes[calls % len(sizes)]]
        parts.append({name: np.asarray(values) for name, values in daq.exchange(np.array(block, dtype=float)).items()})
        lengths = {len(values) for values in parts[-1].values()}
        assert len(lengths) == 1, "all columns have the same length"
        sent, received, calls = sent + len(block), received + lengths.pop(), calls + 1
        assert received <= sent, "more measurements than drives"
        assert len(block) or len(parts[-1]["output"]), "the device stalls"
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def wave(samples=2000):
    """Returns a drive from rest to rest. Neighbouring samples differ, so that a lost, repeated or shifted one is found."""
    return 55 * (1 - np.cos(np.linspace(0, 2 * np.pi * 3, samples))) + np.sin(np.arange(samples)) * np.hanning(samples)


# --- nidaqmx: measurements


@pytest.mark.parametrize("sizes", [(1,), (7,), (64,), (250,), (256,), (1, 200, 2, 77), (256, 1)])
def test_ni_measures_each_drive_sample_once_one_period_later(card, sizes):
    daq, drive = make_ni(monitor="Dev1/ai1", temperature="Dev1/ai2"), wave()
    assert daq.start(1000.0) == 1000.0
    measured = play(daq, drive, sizes)
    np.testing.assert_allclose(measured["output"], expected_outputs(drive, 1000.0), atol=1e-9)
    np.testing.assert_allclose(measured["drive"], drive, atol=1e-12)
    np.testing.assert_allclose(measured["temperature"], 23.5)
    daq.stop()
    assert card.volts == 0.0 and not card.open_tasks()


@pytest.mark.parametrize("samples", [1, 2, 3, 499, 500, 501])
def test_ni_plays_drives_that_are_shorter_than_its_queue(card, samples):
    daq, drive = make_ni(), wave()[500 : 500 + samples]
    daq.start(1000.0)
    np.testing.assert_allclose(play(daq, drive)["output"], expected_outputs(drive, 1000.0), atol=1e-9)
    daq.stop()


def test_ni_outputs_the_samples_one_period_apart(card):
    daq, drive = make_ni(), wave(300)
    daq.start(500.0)
    play(daq, drive)
    times, volts = np.array(card.history[:300]).T
    np.testing.assert_allclose(volts, drive, atol=1e-12)
    np.testing.assert_allclose(np.diff(times), 1 / 500, atol=1e-9)


@pytest.mark.parametrize(("rate_hz", "samples"), [(1.0, 20), (3.0, 20), (10_000.0, 40_000)])
def test_ni_plays_slow_and_fast(card, rate_hz, samples):
    daq, drive = make_ni(queue_s=1.8), wave(samples)
    daq.start(rate_hz)
    np.testing.assert_allclose(play(daq, drive, (200,))["output"], expected_outputs(drive, rate_hz), atol=1e-9)
    daq.stop()


def test_ni_waits_for_readings_in_transfer(card):
    """Readings reach the computer some clock edges after they were taken. Until then, padding keeps the clock running."""
    card.in_transit = 30
    daq, drive = make_ni(queue_s=0.1), wave(450)
    daq.start(1000.0)
    np.testing.assert_allclose(play(daq, drive)["output"], expected_outputs(drive, 1000.0), atol=1e-9)


def test_ni_holds_the_last_voltage_between_drives(card, clock):
    daq = make_ni()
    daq.start(1000.0)
    play(daq, [0.0, 10.0, 20.0])
    clock.sleep(1.0)
    assert GAIN * card.volts == 20.0 and daq.capabilities().present_v == 20.0
    outputs = play(daq, [30.0] * 100 + [0.0])["output"]
    assert 2.0 < outputs[0] < outputs[1] < 3.0 and len(outputs) == 101
    daq.stop()


def test_ni_runs_again_after_stop(card):
    daq, drive = make_ni(), wave(700)
    for rate_hz in (1000.0, 200.0):
        card.actuator.output = 0.0
        daq.start(rate_hz)
        np.testing.assert_allclose(play(daq, drive)["output"], expected_outputs(drive, rate_hz), atol=1e-9)
        daq.stop()


def test_ni_returns_nothing_if_no_sample_is_due(card):
    daq = make_ni(monitor="Dev1/ai1")
    daq.start(100.0)
    assert {name: len(values) for name, values in daq.exchange([]).items()} == {"output": 0, "drive": 0}


def test_ni_keeps_its_queue_filled(card):
    """A caller that is late by less than ``queue_s`` loses nothing, and the queue fills again."""
    daq, drive = make_ni(queue_s=0.2), wave(1000)
    daq.start(1000.0)
    parts, levels = [], []
    for k in range(0, 1000, 50):
        parts.append(daq.exchange(drive[k : k + 50])["output"])
        levels.append(len(card.tasks[0].queue))
        card.clock.sleep(0.15 if k == 500 else 0.01)
    # One of the 200 samples is being output. After the delay of 150 samples the queue gains 40 samples per call.
    assert levels[4:] == [199] * 7 + [99, 139, 179] + [199] * 6
    parts.append(daq.exchange([])["output"])
    np.testing.assert_allclose(np.concatenate(parts), expected_outputs(drive, 1000.0), atol=1e-9)


def test_ni_works_if_the_padding_runs_out(card):
    """The output fails with -200290 while the last samples are read; they are complete, and ``stop`` works."""
    daq, drive = make_ni(queue_s=0.05), wave(40)
    daq.start(1000.0)
    daq.exchange(drive)
    card.read_latency_s = 0.5
    np.testing.assert_allclose(daq.exchange([])["output"], expected_outputs(drive, 1000.0), atol=1e-9)
    assert card.tasks[0].failed
    card.read_latency_s = 0.0
    assert len(play(daq, drive)["output"]) == 40
    daq.stop()
    assert card.volts == 0.0


def test_ni_reports_the_rate_of_the_card(card):
    card.rate_factor = 1.0001
    daq = make_ni()
    assert daq.start(1000.0) == pytest.approx(1000.1)


# --- nidaqmx: limits and settings


@pytest.mark.parametrize(("gain", "limits"), [(GAIN, (-1.0, 6.5)), (-GAIN, (-6.5, 1.0))])
def test_ni_sets_the_limits_of_the_card(card, gain, limits):
    daq = make_ni(amplifier_gain=gain)
    daq.start(1000.0)
    daq.stop()
    outputs = [task for task in card.tasks if task.output]
    assert len(outputs) == 2 and all(task.limits == limits for task in outputs)


def test_ni_reaches_its_limits(card):
    """Both ends of the range are reached despite the division by the gain."""
    daq = make_ni(min_v=-0.3, max_v=100.1, amplifier_gain=7.3)
    daq.start(100.0)
    assert len(play(daq, [-0.3, 100.1, 0.0])["output"]) == 3


@pytest.mark.parametrize("bad", [130.1, -20.1, math.nan, math.inf])
def test_ni_rejects_a_block_with_an_invalid_voltage_and_continues(card, bad):
    daq, drive = make_ni(queue_s=0.1), wave(400)
    daq.start(1000.0)
    parts = [daq.exchange(drive[:200])["output"]]
    with pytest.raises(ValueError, match=r"drive sample 1 is .* V, expected -20 to 130 V; nothing of this block was put out"):
        daq.exchange([1.0, bad])
    parts += [daq.exchange(drive[200:])["output"], daq.exchange([])["output"]]
    np.testing.assert_allclose(np.concatenate(parts), expected_outputs(drive, 1000.0), atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"amplifier_gain": 0.0}, "amplifier_gain = 0"),
        ({"output_per_v": math.nan}, "output_per_v = nan"),
        ({"monitor_per_v": 0.0}, "monitor_per_v = 0"),
        ({"min_v": 130}, "min_v below max_v"),
        ({"rest_v": -30}, "rest_v = -30 V is outside -20 to 130 V"),
        ({"present_v": 131}, "present_v = 131 V"),
        ({"queue_s": 0}, "queue_s = 0"),
        ({"max_slew_v_per_s": 0}, "slew to rest = 0"),
        ({"terminal": "SINGLE"}, "terminal = 'SINGLE': give one of RSE, NRSE"),
    ],
)
def test_ni_rejects_invalid_settings(card, changes, message):
    with pytest.raises(ValueError, match=message):
        make_ni(**changes)


def test_ni_rejects_calls_out_of_order(card):
    daq = make_ni()
    with pytest.raises(RuntimeError, match=r"call start\(rate_hz\)"):
        daq.exchange([0.0])
    with pytest.raises(ValueError, match="rate = 20000 Hz, expected 1 to 10000 Hz"):
        daq.start(20_000.0)
    daq.start(1000.0)
    with pytest.raises(RuntimeError, match=r"started already: call stop\(\) first"):
        daq.start(1000.0)
    with pytest.raises(ValueError, match="257 drive samples in one call, expected at most 256"):
        daq.exchange(np.zeros(257))


def test_ni_satisfies_the_protocol_and_outputs_nothing_before_the_first_drive(card, clock):
    daq = make_ni(temperature="Dev1/ai2", output="displacement_nm", present_v=3.0)
    assert isinstance(daq, Daq)
    capabilities = daq.capabilities()
    assert (capabilities.queued, capabilities.temperature, capabilities.load) == (True, True, False)
    assert (capabilities.output, capabilities.present_v, capabilities.rest_v) == ("displacement_nm", 3.0, 0.0)
    daq.start(1000.0)
    clock.sleep(1.0)
    assert not card.history


def test_ni_names_the_missing_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "nidaqmx", None)
    with pytest.raises(ImportError, match="pip install nidaqmx"):
        make_ni()


# --- nidaqmx: errors and the ramp to rest


def assert_at_rest_without_steps(card, slew_v_per_s=100.0):
    """Asserts that the output is at rest, nothing is reserved, and the output ramped there from its last voltage."""
    assert card.volts == 0.0 and not card.open_tasks()
    times, volts = np.array(card.history).T
    software = np.flatnonzero(np.diff(times) >= 0.009)
    assert np.all(np.abs(np.diff(volts))[software] <= slew_v_per_s * 0.01 + 1e-9)


def test_ni_reports_an_empty_queue(card, clock):
    daq, drive = make_ni(queue_s=0.1), wave()
    daq.start(1000.0)
    for k in range(0, 600, 100):
        daq.exchange(drive[k : k + 100])
    clock.sleep(0.2)
    with pytest.raises(RuntimeError, match=r"Dev1/ao0: .* ran dry.* give a larger queue_s \(now 0.1 s\) or a lower rate.*-200290") as raised:
        daq.exchange(drive[600:700])
    assert raised.value.__cause__.error_code == -200290
    assert GAIN * card.volts == pytest.approx(drive[599])
    assert daq.capabilities().present_v == drive[599]
    with pytest.raises(RuntimeError, match=r"after an error stop\(\) first"):
        daq.exchange([0.0])
    daq.stop()
    assert_at_rest_without_steps(card)


def test_ni_reports_why_no_sample_arrived(card, monkeypatch):
    """If a read times out because the output has failed, the failed output is reported."""
    daq = make_ni(queue_s=0.1)
    daq.start(1000.0)
    for k in range(3):
        daq.exchange(wave()[100 * k : 100 * k + 100])
    # The last samples do not reach the card.
    monkeypatch.setattr(AnalogSingleChannelWriter, "write_many_sample", lambda writer, data, timeout=10.0: len(data))
    with pytest.raises(RuntimeError, match="ran dry"):
        daq.exchange(wave()[300:400])


def test_ni_reports_a_missing_clock_signal(card):
    card.routed = False
    daq = make_ni(queue_s=5.0)
    daq.start(1000.0)
    with pytest.raises(RuntimeError, match="no sample came in: check that the clock terminal /Dev1/ao/SampleClock exists"):
        play(daq, wave(6000))
    daq.stop()
    assert_at_rest_without_steps(card)


def test_ni_reports_a_clock_terminal_that_does_not_exist(card):
    with pytest.raises(RuntimeError, match="no clock terminal /Dev7/ao/SampleClock: give clock"):
        make_ni(clock="/Dev7/ao/SampleClock").start(1000.0)
    assert not card.open_tasks()


@pytest.mark.parametrize("where", ["read", "write", "start input", "start output"])
@pytest.mark.parametrize("blocks", [1, 8])
def test_ni_is_at_rest_after_an_exchange_that_raised(card, where, blocks):
    daq, drive = make_ni(queue_s=0.1), wave()
    daq.start(1000.0)
    if where.startswith("start"):
        card.errors[where] = -50103
    with pytest.raises(RuntimeError, match="another program|look up this error"):
        for k in range(100):
            if k == blocks:
                card.errors[where] = -50103
            daq.exchange(drive[100 * k : 100 * k + 100])
    card.errors.clear()
    daq.stop()
    assert_at_rest_without_steps(card)
    # It can be used again.
    daq.start(1000.0)
    assert len(play(daq, drive)["output"]) == len(drive)


def test_ni_ramps_from_the_present_output_not_from_the_end_of_its_queue(card):
    daq = make_ni(queue_s=0.5)
    daq.start(1000.0)
    for k in range(8):
        daq.exchange(np.linspace(0.1 * k, 0.1 * (k + 1), 100, endpoint=False) * 100)
    reached = GAIN * card.volts
    assert reached < 35
    daq.stop()
    before = len(card.history)
    assert max(volts for _, volts in card.history) == pytest.approx(reached)
    assert_at_rest_without_steps(card)
    assert before == len(card.history)


def test_ni_is_at_rest_after_an_interrupt(card, monkeypatch):
    daq = make_ni(queue_s=0.1)
    daq.start(1000.0)
    daq.exchange(wave()[:200])

    def interrupt(*arguments, **named):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(AnalogMultiChannelReader, "read_many_sample", interrupt)
        daq.exchange(wave()[200:300])
    # The rest of the queue is not output.
    assert not card.open_tasks()
    daq.stop()
    assert_at_rest_without_steps(card)


@pytest.mark.parametrize("slew_v_per_s", [10.0, 1000.0])
def test_ni_ramps_no_faster_than_the_slew_and_within_its_deadline(card, clock, slew_v_per_s):
    daq = make_ni(max_slew_v_per_s=slew_v_per_s)
    daq.start(1000.0)
    play(daq, [130.0])
    start = clock.now
    daq.stop()
    assert clock.now - start == pytest.approx(130 / min(slew_v_per_s, 100.0), abs=0.02)
    assert clock.now - start < daq.capabilities().deadline_s
    assert_at_rest_without_steps(card, min(slew_v_per_s, 100.0))


def test_ni_rests_at_the_given_rest_voltage(card):
    daq = make_ni(rest_v=-10.0)
    daq.start(1000.0)
    play(daq, [5.0, 6.0])
    daq.stop()
    assert GAIN * card.volts == -10.0


def test_ni_can_be_stopped_repeatedly(card):
    daq = make_ni()
    daq.stop()
    daq.start(1000.0)
    daq.stop()
    daq.stop()
    assert card.volts == 0.0 and not card.open_tasks() and len(card.history) == 3


def test_ni_reports_that_it_cannot_be_brought_to_rest(card):
    daq = make_ni()
    daq.start(1000.0)
    play(daq, [5.0, 6.0])
    card.errors["write one"] = -201003
    with pytest.raises(RuntimeError, match="Dev1/ao0 could not be brought to rest.* last known at 6 V: switch the amplifier off; .*cable"):
        daq.stop()
    assert not card.open_tasks()


@pytest.mark.parametrize(
    ("code", "advice"),
    [(-200220, "NI MAX"), (-200077, "data sheet"), (-200561, "check amplifier_gain"), (-1, "look up this error"), (None, "install the driver")],
)
def test_ni_gives_advice_on_errors_of_the_driver(card, code, advice):
    daq = make_ni()
    card.errors["output channel"] = code
    with pytest.raises(RuntimeError, match=advice):
        daq.start(1000.0)
    assert not card.open_tasks()


def test_every_advice_is_complete(card):
    for code in ni._ADVICE:
        advice = make_ni()._advice(DaqError("words", code))
        assert "{" not in advice and f"NI-DAQmx: words Status Code: {code}" in advice


def test_replacement_has_the_signatures_of_nidaqmx():
    """If the package is installed: the replacement takes the same arguments, and the codes of the advice exist."""
    pytest.importorskip("nidaqmx")
    import nidaqmx.constants
    from nidaqmx import error_codes, errors, stream_readers, stream_writers, task

    pairs = [
        (Task.__init__, task.Task.__init__),
        *((getattr(Task, name), getattr(task.Task, name)) for name in ("start", "stop", "close", "is_task_done")),
        (AOChannelCollection.add_ao_voltage_chan, task.collections.AOChannelCollection.add_ao_voltage_chan),
        (AIChannelCollection.add_ai_voltage_chan, task.collections.AIChannelCollection.add_ai_voltage_chan),
        (Timing.cfg_samp_clk_timing, task.Timing.cfg_samp_clk_timing),
        (AnalogSingleChannelWriter.__init__, stream_writers.AnalogSingleChannelWriter.__init__),
        (AnalogSingleChannelWriter.write_many_sample, stream_writers.AnalogSingleChannelWriter.write_many_sample),
        (AnalogSingleChannelWriter.write_one_sample, stream_writers.AnalogSingleChannelWriter.write_one_sample),
        (AnalogMultiChannelReader.__init__, stream_readers.AnalogMultiChannelReader.__init__),
        (AnalogMultiChannelReader.read_many_sample, stream_readers.AnalogMultiChannelReader.read_many_sample),
        (DaqError.__init__, errors.DaqError.__init__),
        (DaqReadError.__init__, errors.DaqReadError.__init__),
    ]
    for ours, theirs in pairs:
        mine, vendor = (list(inspect.signature(function).parameters.values()) for function in (ours, theirs))
        assert [(p.name, p.kind) for p in mine] == [(p.name, p.kind) for p in vendor], ours
    for ours, theirs in [(OutStream, task.OutStream), (InStream, task.InStream), (Timing, task.Timing)]:
        for name in (name for name, member in vars(ours).items() if isinstance(member, property)):
            assert isinstance(getattr(theirs, name), property), name
            assert (getattr(theirs, name).fset is None) <= (vars(ours)[name].fset is None), name
    for ours in (AcquisitionType, RegenerationMode, TerminalConfiguration, Edge):
        assert {member.name for member in ours} <= set(getattr(nidaqmx.constants, ours.__name__).__members__)
    assert issubclass(errors.DaqError, errors.Error)
    for code in ni._ADVICE:
        error_codes.DAQmxErrors(code)


@pytest.fixture
def instrument(monkeypatch, clock):
    """Installs the replacement of the package ``serial``. Returns the instrument at its port."""
    module = types.ModuleType("serial")
    module.Serial, module.SerialException = Serial, SerialException
    monkeypatch.setitem(sys.modules, "serial", module)
    instrument = Instrument(clock)
    monkeypatch.setattr(Serial, "instrument", instrument)
    return instrument


def make_serial(**changes):
    settings = {"port": "COM3", "set": "VOLT {volts:.6f}", "query": "MEAS?", "min_v": -20, "max_v": 130}
    return SerialInstrument(**{**settings, **changes})


# --- pyserial


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
