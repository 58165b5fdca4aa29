"""The adapter ``hyst.daq.ni`` with a simulated replacement of ``nidaqmx``, without hardware: measurements and settings.

Convention: drive sample ``k`` is output at clock edge ``k``, and its measurement is the reading one period later.
"""

import inspect
import math
import sys

import numpy as np
import pytest
from hyst.daq import Daq
from hyst.daq._nidaqmx import ADVICE

from actuator_stand_in import expected_outputs, play, wave
from nidaqmx_stand_in import (
    GAIN,
    AcquisitionType,
    AIChannelCollection,
    AnalogMultiChannelReader,
    AnalogSingleChannelWriter,
    AOChannelCollection,
    DaqError,
    DaqReadError,
    Edge,
    InStream,
    OutStream,
    RegenerationMode,
    Task,
    TerminalConfiguration,
    Timing,
    make_ni,
)

# --- measurements


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


# --- limits and settings


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
    for code in ADVICE:
        error_codes.DAQmxErrors(code)
