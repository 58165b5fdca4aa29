"""A device that is a Python object: valid, raising, blocking, slow, with invalid data. The drive always ends at rest."""

import dataclasses
import signal
import threading
import time

import numpy as np
import pytest

import hyst

RATE = 1000.0


class Bench:
    """A play operator of 5 V with a gain of 0.1 µm/V; it stores the drive that it receives."""

    def __init__(self, **capabilities):
        defaults = {"min_v": 0.0, "max_v": 100.0, "min_rate_hz": 1.0, "max_rate_hz": 1e5, "deadline_s": 0.3}
        self.limits = hyst.daq.Capabilities("bench", **{**defaults, **capabilities})
        self.put_out, self.calls, self.play = [], [], 0.0

    def capabilities(self):
        return self.limits

    def start(self, rate_hz):
        self.calls.append("start")
        return rate_hz

    def measure(self, drive):
        outputs = []
        for volts in drive:
            self.play = min(max(self.play, volts - 5.0), volts + 5.0)
            self.put_out.append(volts)
            outputs.append(0.1 * self.play)
        return np.array(outputs)

    def exchange(self, drive):
        self.calls.append("exchange")
        return self.measure(drive)

    def stop(self):
        self.calls.append("stop")

    def is_at_rest(self):
        return self.calls[-1] == "stop" and self.put_out[-1] == self.limits.rest_v


def drive(n=500):
    return 40 - 40 * np.cos(2 * np.pi * np.arange(n) / n * 2)


def test_a_valid_device_is_recorded_row_by_row(tmp_path):
    bench = Bench()
    log = tmp_path / "run.mcap"
    run = hyst.run(bench, drive=drive(), rate=RATE, log=log)
    assert bench.is_at_rest()
    np.testing.assert_array_equal(run.record.inputs, drive())
    expected = Bench().measure(drive())
    np.testing.assert_allclose(run.record.outputs, expected, atol=1e-12)
    assert run["samples"] == 500 and run["device"] == "bench" and "500 samples" in repr(run)
    logged = hyst.read_record(log)
    np.testing.assert_allclose(logged.outputs, expected, atol=1e-12)
    # No step is larger than that of the drive plus that of the ramp.
    assert np.abs(np.diff(bench.put_out)).max() <= np.abs(np.diff(drive())).max() + 100.0 / RATE + 1e-9


def test_a_reference_is_followed_with_the_model():
    train = hyst.run(Bench(), drive=np.concatenate([s * drive() for s in (1, 0.6, 0.3, 0.8)]), rate=RATE).record
    model = hyst.fit(train, model="pi")
    reference = 3 - 2 * np.cos(2 * np.pi * np.arange(800) / 400)
    run = hyst.run(Bench(), reference=reference, model=model, rate=RATE)
    assert run["tracking"]["rmse"] < 0.02, run
    closed = hyst.run(Bench(), reference=reference, model=model, rate=RATE, control="pid+feedforward")
    assert closed["tracking"]["rmse"] < 0.02, closed


def test_columns_and_a_queue():
    class Queue(Bench):
        """Returns its measurements one call later, with temperature, load and the monitored drive."""

        def __init__(self):
            super().__init__(queued=True, temperature=True, load=True, output="displacement_nm")
            self.waiting = {"output": np.empty(0), "drive": np.empty(0)}

        def exchange(self, drive):
            ready, self.waiting = self.waiting, {"output": self.measure(drive), "drive": np.asarray(drive) + 0.001}
            n = len(ready["output"])
            return {**ready, "temperature": np.full(n, 21.5), "load": np.full(n, 3)}

    queue = Queue()
    run = hyst.run(queue, drive=drive(), rate=RATE)
    np.testing.assert_allclose(run.record.outputs, Bench().measure(drive()), atol=1e-12)
    np.testing.assert_allclose(run.record.inputs, drive() + 0.001, atol=1e-9)
    assert run.record.output_column == "displacement_nm"
    assert set(run.record.temperature) == {21.5} and set(run.record.load) == {3.0}
    assert queue.is_at_rest()


def test_an_exception_is_raised_after_the_ramp_to_rest(tmp_path):
    class Raises(Bench):
        def exchange(self, drive):
            if len(self.put_out) > 256 and not self.raised:
                self.raised = True
                raise ConnectionError("the cable is out")
            return super().exchange(drive)

        raised = False

    bench, log = Raises(), tmp_path / "run.mcap"
    with pytest.raises(ConnectionError, match="the cable is out") as caught:
        hyst.run(bench, drive=drive(2000), rate=RATE, log=log)
    assert len(caught.value.record) > 0
    # The ramp after the failed call is not much steeper than the drive.
    assert bench.is_at_rest()
    assert np.abs(np.diff(bench.put_out)).max() <= 1.6 * np.abs(np.diff(drive(2000))).max()
    assert len(hyst.read_record(log)) > 0


def test_a_ramp_starts_at_the_present_voltage_of_the_device():
    class FailsAfterOutput(Bench):
        """Outputs its block, then fails."""

        failed = False

        def capabilities(self):
            return dataclasses.replace(self.limits, present_v=self.put_out[-1] if self.put_out else None)

        def exchange(self, drive):
            outputs = super().exchange(drive)
            if len(self.put_out) > 600 and not self.failed:
                self.failed = True
                raise TimeoutError("no samples came")
            return outputs

    bench = FailsAfterOutput()
    with pytest.raises(TimeoutError, match="no samples came"):
        hyst.run(bench, drive=drive(2000), rate=RATE)
    assert bench.is_at_rest()
    assert np.abs(np.diff(bench.put_out)).max() <= 1.6 * np.abs(np.diff(drive(2000))).max()


def test_a_device_error_has_priority_over_ctrl_c():
    class Fails(Bench):
        def exchange(self, drive):
            if len(self.put_out) > 512:
                signal.raise_signal(signal.SIGINT)
                time.sleep(0.2)
                raise OSError("the cable is out")
            return super().exchange(drive)

        def stop(self):
            raise OSError("the cable is out")

    with pytest.raises(hyst.DeviceError, match="the cable is out") as caught:
        hyst.run(Fails(), drive=drive(4000), rate=RATE)
    assert isinstance(caught.value.__cause__, KeyboardInterrupt)


def test_a_device_that_always_raises_is_stopped():
    class Dead(Bench):
        def exchange(self, drive):
            raise OSError("no such device")

    bench = Dead()
    with pytest.raises(OSError, match="no such device"):
        hyst.run(bench, drive=drive(), rate=RATE)
    assert bench.calls[-1] == "stop"


@pytest.mark.parametrize("method", ["start", "exchange"])
def test_a_blocking_call_stops_the_run(method):
    released = threading.Event()

    class Blocks(Bench):
        def start(self, rate_hz):
            if method == "start":
                released.wait(30)
            return super().start(rate_hz)

        def exchange(self, drive):
            if method == "exchange" and len(self.put_out) > 256:
                released.wait(30)
            return super().exchange(drive)

        def stop(self):
            # As in a driver whose task is closed: the waiting call ends.
            super().stop()
            released.set()

    bench = Blocks()
    with pytest.raises(hyst.DeviceError, match=f"{method} did not return within"):
        hyst.run(bench, drive=drive(2000), rate=RATE)
    assert "stop" in bench.calls


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (lambda y: y[:-1], "samples for"),
        (lambda y: np.append(y, 0.0), "samples for"),
        (lambda y: np.where(np.arange(len(y)) == 7, np.nan, y), 'as "output" of sample 7'),
        (lambda y: "nonsense", "one-dimensional array of numbers"),
        (lambda y: None, "samples for"),
        (lambda y: y.reshape(1, -1), "one-dimensional array of numbers"),
        (lambda y: {"position": y}, 'no "output"'),
        (lambda y: {"output": y, "drive": y[:3]}, '3 values of "drive"'),
    ],
)
def test_invalid_data_stops_the_run_at_rest(answer, message):
    class Invalid(Bench):
        def exchange(self, drive):
            outputs = super().exchange(drive)
            return answer(outputs) if len(self.put_out) > 256 else outputs

    bench = Invalid()
    with pytest.raises((hyst.DeviceError, TypeError), match=message):
        hyst.run(bench, drive=drive(2000), rate=RATE)
    # Invalid measurements do not prevent the ramp.
    assert bench.is_at_rest()
    assert np.abs(np.diff(bench.put_out)).max() <= 1.6 * np.abs(np.diff(drive(2000))).max()


def test_the_run_waits_for_a_slow_device():
    class Slow(Bench):
        def exchange(self, drive):
            time.sleep(0.05)
            return super().exchange(drive)

    assert len(hyst.run(Slow(max_block=100), drive=drive(300), rate=RATE).record) == 300


@pytest.mark.parametrize(
    ("capabilities", "message"),
    [
        ({"min_v": 5.0, "max_v": 5.0}, "no range"),
        ({"rest_v": -1.0}, "rest_v"),
        ({"output": "angle"}, "angle"),
        ({"max_block": 0}, "max_block"),
        ({"present_v": 200.0}, "present_v"),
    ],
)
def test_invalid_capabilities_are_rejected(capabilities, message):
    bench = Bench(**capabilities)
    with pytest.raises(ValueError, match=message):
        hyst.run(bench, drive=drive(), rate=RATE)
    assert bench.calls == []


def test_drives_and_rates_out_of_range_are_rejected_before_the_run():
    for wrong, rate in ((drive() * 2, RATE), (np.array([np.nan, 1.0]), RATE), (drive(), 1e7)):
        bench = Bench()
        with pytest.raises(ValueError):
            hyst.run(bench, drive=wrong, rate=rate)
        assert bench.put_out == []


def test_ctrl_c_ramps_to_rest(tmp_path):
    class Interrupted(Bench):
        def exchange(self, drive):
            if len(self.put_out) > 512 and not self.sent:
                self.sent = True
                signal.raise_signal(signal.SIGINT)
            time.sleep(0.02)
            return super().exchange(drive)

        sent = False

    bench, log = Interrupted(), tmp_path / "run.mcap"
    with pytest.raises(KeyboardInterrupt):
        hyst.run(bench, drive=np.tile(drive(), 40), rate=RATE, log=log)
    assert bench.is_at_rest() and len(bench.put_out) < 15_000
    assert len(hyst.read_record(log)) > 0


def test_the_bench_satisfies_the_protocol():
    assert isinstance(Bench(), hyst.daq.Daq)


def test_learning_on_a_python_device():
    bench = Bench()
    sine = 50.0 - 50.0 * np.cos(2 * np.pi * 2.0 * np.arange(3000) / RATE)
    train = hyst.run(bench, drive=sine * np.linspace(1.0, 0.3, len(sine)), rate=RATE).record
    model = hyst.fit(train, model="pi")
    wanted = 2.0 + 4.0 * np.abs((np.arange(600) / 150.0) % 2.0 - 1.0)
    learned = hyst.learn(bench, model, wanted, rate=RATE, passes=2, max_error=3.0)
    passes = [one["rmse"] for one in learned["passes"]]
    assert min(passes) == passes[learned["best"] - 1] <= passes[0] and bench.is_at_rest()
    # The best drive, with the reference held before and after it.
    drive, reference = learned.columns["voltage_v"], learned.columns["displacement_um"]
    assert len(drive) == len(reference) > len(wanted) and "output" not in learned
    assert np.all(reference[:50] == wanted[0]) and np.all(reference[50:650] == wanted)
    again = hyst.run(bench, drive=drive, rate=RATE).record
    assert np.sqrt(np.mean((again.outputs[50:650] - wanted) ** 2)) <= 1.5 * min(passes) + 1e-3
    with pytest.raises(hyst.InputError, match="does not move") as caught:
        hyst.learn(bench, model, np.full(100, 3.0), rate=RATE)
    assert caught.value.columns is None

    # A sensor that freezes after the first pass stops learning, and the drive of that pass is kept.
    one = Bench()
    first = hyst.learn(one, model, wanted, rate=RATE, passes=1)

    class Freezing(Bench):
        def exchange(self, drive):
            outputs = super().exchange(drive)
            return np.full(len(outputs), 3.0) if len(self.put_out) > len(one.put_out) + 100 else outputs

    with pytest.raises(hyst.CommandError, match="does not follow") as ended:
        hyst.learn(Freezing(), model, wanted, rate=RATE, passes=4)
    assert np.array_equal(ended.value.columns["voltage_v"], first.columns["voltage_v"])
