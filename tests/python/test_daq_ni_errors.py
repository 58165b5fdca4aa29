"""The adapter ``hyst.daq.ni`` with a simulated replacement of ``nidaqmx``: errors and the ramp to rest."""

import numpy as np
import pytest
from hyst.daq._nidaqmx import ADVICE

from actuator_stand_in import play, wave
from nidaqmx_stand_in import GAIN, AnalogMultiChannelReader, AnalogSingleChannelWriter, DaqError, make_ni


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
    for code in ADVICE:
        advice = make_ni()._advice(DaqError("words", code))
        assert "{" not in advice and f"NI-DAQmx: words Status Code: {code}" in advice
