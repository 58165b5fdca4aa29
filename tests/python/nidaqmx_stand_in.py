"""Simulated replacement of the package ``nidaqmx``, with one card.

It accepts exactly the arguments of the vendor's functions. test_daq_ni.py compares it with the package, if installed.
"""

import enum

import numpy as np
from hyst.daq.ni import Ni

from actuator_stand_in import Actuator

GAIN = 20.0
PER_V = 10.0


class Error(Exception):
    pass


class DaqError(Error):
    def __init__(self, message, error_code, task_name=""):
        super().__init__(f"{message}\n\nStatus Code: {error_code}")
        self.error_code = error_code


class DaqReadError(DaqError):
    def __init__(self, message, error_code, samps_per_chan_read, task_name=""):
        super().__init__(message, error_code, task_name)
        self.samps_per_chan_read = samps_per_chan_read


AcquisitionType = enum.Enum("AcquisitionType", "FINITE CONTINUOUS HW_TIMED_SINGLE_POINT")
RegenerationMode = enum.Enum("RegenerationMode", "ALLOW_REGENERATION DONT_ALLOW_REGENERATION")
TerminalConfiguration = enum.Enum("TerminalConfiguration", "RSE NRSE DIFF PSEUDO_DIFF DEFAULT")
Edge = enum.Enum("Edge", "RISING FALLING")
VoltageUnits = enum.Enum("VoltageUnits", "VOLTS FROM_CUSTOM_SCALE")
UNSET = object()


class Card:
    """One card: an output with a queue without regeneration, inputs on its clock, and an actuator after the amplifier."""

    def __init__(self, clock):
        self.clock, self.actuator = clock, Actuator(clock.now)
        clock.listeners.append(self.until)
        self.volts, self.history = 0.0, []
        self.tasks, self.errors = [], {}
        self.rate_factor, self.read_latency_s, self.in_transit, self.routed = 1.0, 0.0, 0, True

    def open_tasks(self):
        return [task for task in self.tasks if not task.closed]

    def raise_if(self, where):
        """Raises the error that a test has set for this place."""
        if where in self.errors:
            raise DaqError(f"error of the test at {where}", self.errors[where])

    def put(self, volts):
        self.volts = volts
        self.actuator.volts = GAIN * volts
        self.history.append((self.clock.now, GAIN * volts))

    def reading(self, channel):
        return {"Dev1/ai0": self.actuator.output / PER_V, "Dev1/ai1": self.volts, "Dev1/ai2": 0.235}[channel]

    def until(self, then):
        """Advances the clock of the running output."""
        for task in self.open_tasks():
            while task.ticking and task.edge_s() <= then + 1e-12:
                self.clock.now = max(self.clock.now, task.edge_s())
                self.actuator.until(self.clock.now)
                self.tick(task)
        self.actuator.until(then)

    def tick(self, output):
        if not output.queue:
            output.ticking, output.failed = False, True
            return
        # The inputs convert the values at the clock edge.
        for task in self.open_tasks():
            if task.inputs and task.started and self.routed:
                task.readings.append([self.reading(channel) for channel in task.inputs])
        output.generated += 1
        self.put(output.queue.pop(0))


class Task:
    card = None

    def __init__(self, new_task_name="", *, grpc_options=None):
        self.ao_channels, self.ai_channels, self.timing = AOChannelCollection(self), AIChannelCollection(self), Timing(self)
        self.in_stream, self.out_stream = InStream(self), OutStream(self)
        self.output, self.inputs, self.limits = None, [], None
        self.rate_hz, self.size, self.written = None, None, 0
        self.queue, self.generated, self.readings = [], 0, []
        self.started = self.ticking = self.failed = self.closed = False
        self.regeneration = RegenerationMode.ALLOW_REGENERATION
        self.card.tasks.append(self)

    def __enter__(self):
        return self

    def __exit__(self, type, value, traceback):
        self.close()

    def edge_s(self):
        return self.start_s + (self.generated + 1e-9) / self.rate_hz

    def check(self):
        assert not self.closed, "a closed task is used"
        if self.failed:
            raise DaqError("The generation has stopped to prevent the regeneration of old samples.", -200290)

    def reserve(self):
        """Two tasks cannot use one output."""
        for task in self.card.open_tasks():
            if task is not self and task.output == self.output and task.written:
                raise DaqError("The specified resource is reserved.", -50103)

    def start(self):
        self.check()
        self.card.raise_if("start input" if self.inputs else "start output")
        if self.output:
            assert self.regeneration is RegenerationMode.DONT_ALLOW_REGENERATION
            if not self.queue:
                raise DaqError("Output buffer is empty.", -200462)
            self.ticking, self.start_s = True, self.card.clock.now
        self.started = True
        self.card.clock.until(self.card.clock.now)

    def stop(self):
        self.started = self.ticking = False
        self.check()

    def close(self):
        assert not self.closed, "a task is closed twice"
        self.started = self.ticking = False
        self.closed = True

    def is_task_done(self):
        self.check()
        return False


class AOChannelCollection:
    def __init__(self, task):
        self.task = task

    def add_ao_voltage_chan(
        self, physical_channel, name_to_assign_to_channel="", min_val=-10.0, max_val=10.0, units=VoltageUnits.VOLTS, custom_scale_name=""
    ):
        self.task.card.raise_if("output channel")
        assert min_val < max_val
        self.task.output, self.task.limits = physical_channel, (min_val, max_val)


class AIChannelCollection:
    def __init__(self, task):
        self.task = task

    def add_ai_voltage_chan(
        self,
        physical_channel,
        name_to_assign_to_channel="",
        terminal_config=TerminalConfiguration.DEFAULT,
        min_val=-5.0,
        max_val=5.0,
        units=VoltageUnits.VOLTS,
        custom_scale_name="",
    ):
        assert isinstance(terminal_config, TerminalConfiguration)
        self.task.inputs.append(physical_channel)


class Timing:
    def __init__(self, task):
        self.task = task

    def cfg_samp_clk_timing(self, rate, source="", active_edge=Edge.RISING, sample_mode=AcquisitionType.FINITE, samps_per_chan=1000):
        assert sample_mode is AcquisitionType.CONTINUOUS
        if self.task.inputs and source != "/Dev1/ao/SampleClock":
            raise DaqError("Source terminal to be routed could not be found on the device.", -89120)
        self.task.rate_hz = rate * (1 if self.task.inputs else self.task.card.rate_factor)

    @property
    def samp_clk_rate(self):
        return self.task.rate_hz


class OutStream:
    """Raises for a name that the vendor's class does not have."""

    __slots__ = ("task",)

    def __init__(self, task):
        self.task = task

    @property
    def regen_mode(self):
        return self.task.regeneration

    @regen_mode.setter
    def regen_mode(self, val):
        assert not self.task.written, "set before the first write"
        self.task.regeneration = RegenerationMode(val)

    @property
    def output_buf_size(self):
        return self.task.size

    @output_buf_size.setter
    def output_buf_size(self, val):
        self.task.size = int(val)

    @property
    def total_samp_per_chan_generated(self):
        self.task.check()
        return self.task.generated


class InStream:
    __slots__ = ("task",)

    def __init__(self, task):
        self.task = task

    @property
    def input_buf_size(self):
        return self.task.size

    @input_buf_size.setter
    def input_buf_size(self, val):
        self.task.size = int(val)


class AnalogSingleChannelWriter:
    def __init__(self, task_out_stream, auto_start=UNSET):
        self.task, self.auto_start = task_out_stream.task, auto_start

    def check_limits(self, data):
        low, high = self.task.limits
        if not np.all((data >= low) & (data <= high)):
            raise DaqError("Attempted writing analog data that is too large or too small.", -200561)

    def write_many_sample(self, data, timeout=10.0):
        task = self.task
        task.check()
        task.card.raise_if("write")
        task.reserve()
        assert data.dtype == np.float64 and data.ndim == 1 and data.flags.c_contiguous
        self.check_limits(data)
        if task.size is None and task.written:
            raise DaqError("Write failed, because the buffer size was automatically configured.", -200547)
        if len(task.queue) + len(data) > (task.size or len(data)):
            raise DaqError("Some or all of the samples to write could not be written yet.", -200292)
        task.queue.extend(data)
        task.written += len(data)
        return len(data)

    def write_one_sample(self, data, timeout=10):
        assert isinstance(data, float) and self.auto_start is not False
        self.task.card.raise_if("write one")
        self.task.reserve()
        self.check_limits(np.array(data))
        self.task.card.clock.until(self.task.card.clock.now)
        self.task.card.put(data)


class AnalogMultiChannelReader:
    def __init__(self, task_in_stream):
        self.task = task_in_stream.task

    def read_many_sample(self, data, number_of_samples_per_channel=-1, timeout=10.0):
        task, count, clock = self.task, number_of_samples_per_channel, self.task.card.clock
        assert data.dtype == np.float64 and data.flags.c_contiguous and task.started
        assert data.shape == (len(task.inputs), count)
        task.card.raise_if("read")
        clock.sleep(task.card.read_latency_s)
        deadline_s = clock.now + timeout
        while len(task.readings) - task.card.in_transit < count:
            ticking = [other.edge_s() for other in task.card.open_tasks() if other.ticking]
            if not ticking or ticking[0] > deadline_s:
                clock.until(deadline_s)
                raise DaqReadError("Some or all of the samples requested have not yet been acquired.", -200284, len(task.readings))
            clock.until(ticking[0])
        if len(task.readings) > task.size:
            raise DaqReadError("The application is not able to keep up with the hardware acquisition.", -200279, 0)
        data[:] = np.array(task.readings[:count]).T
        del task.readings[:count]
        return count


def make_ni(**changes):
    settings = {"drive": "Dev1/ao0", "sensor": "Dev1/ai0", "amplifier_gain": GAIN, "output_per_v": PER_V, "min_v": -20, "max_v": 130}
    return Ni(**{**settings, **changes})
