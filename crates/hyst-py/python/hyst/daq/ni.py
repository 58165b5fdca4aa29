"""Cards of National Instruments, through the package ``nidaqmx``.

**Not tried on hardware.** This module was tested only against a stand-in with the signatures of ``nidaqmx`` 1.7
(tests/python/test_daq_ni.py). Not tested at all: a real card, the NI-DAQmx driver, its simulated devices, cDAQ
chassis, USB cards. Before you connect an actuator, play a slow drive with the amplifier off, watch the analog output on
an oscilloscope, and check that ``stop`` brings it to rest.

How it works. One analog output drives the amplifier. The analog inputs use the sample clock of the output, so both
share one time base. The output takes its samples from a queue and never repeats old ones. Therefore the queue must not
run dry during a drive: it holds ``queue_s`` seconds of drive, and the clock starts when it is full or when the drive is
complete. After the last drive sample the queue is padded with copies of this sample until all measurements have come
in. The measurements of the padding are discarded.

Which measurement belongs to which drive. Drive sample ``k`` is put out at clock edge ``k``. Its measurement is the
reading at edge ``k + 1``, one period later, when drive sample ``k + 1`` is put out. The reading at edge 0 is from
before the drive and is discarded. Input and output act on the same edge, and the input converts up to some microseconds
after it. An amplifier with a piezo is much slower than that. If you wire the output straight to an input, the reading
may show sample ``k + 1`` instead. Delta-sigma inputs delay their readings by many samples; do not use them here.

Between two drives, when all measurements are in, the clock stops and the output holds its last voltage.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import Capabilities, OutputColumn
from ._nidaqmx import advice, cause_of, vendor
from ._volts import check_limits, checked_drive, ramp

__all__ = ["Ni"]

#: Time limit of a call of the driver in addition to the time of its samples [s].
_TIME_LIMIT_S = 2.0
#: Time between two voltages of the software-timed ramp to rest [s]; a write takes about 1 ms on USB cards.
_RAMP_STEP_S = 0.01
#: The fewest samples that the queue holds: one on its way out, one waiting.
_MIN_DEPTH = 2
#: Maximum number of drive samples of one ``exchange``. A call waits while its block is put out, so that a larger block
#: delays a stop request at low rates.
_MAX_BLOCK = 256
#: Room in the buffers beyond what the queue needs [samples]; more than the 8191 samples that X series cards hold on
#: board.
_SPARE = 8192


@dataclass(kw_only=True, eq=False)
class Ni:
    """A card with one analog output (drive) and one to three analog inputs.

    Parameters
    ----------
    drive, sensor : str
        Physical channels of the analog output, behind which the amplifier is, and of the analog input of the sensor.
    amplifier_gain : float
        Drive voltage per volt of the analog output [V/V]; 1 without an amplifier.
    output_per_v, output_at_0v : float
        Output per volt of the sensor and output at 0 V, in the unit of ``output``.
    min_v, max_v, rest_v : float
        Minimum, maximum and rest voltage of the drive, after the amplifier [V]. The card gets the limits too.
    present_v : float, optional
        Drive voltage when the object is made [V]; the rest voltage if not given.
    output : str
        Quantity and unit of the output, as in ``Capabilities``.
    monitor : str, optional
        Analog input of the amplifier's voltage monitor; ``exchange`` then returns the measured ``drive``.
    monitor_per_v : float, optional
        Drive voltage per volt of the monitor [V/V]; ``amplifier_gain`` if not given.
    temperature : str, optional
        Analog input of a temperature sensor with a voltage output.
    degc_per_v, degc_at_0v : float
        Temperature per volt [°C/V] and temperature at 0 V [°C] of this sensor.
    input_range_v : tuple of float
        Minimum and maximum voltage at the analog inputs [V].
    terminal : str
        How the inputs are wired: ``DEFAULT``, ``RSE``, ``NRSE``, ``DIFF`` or ``PSEUDO_DIFF``.
    max_slew_v_per_s : float
        Maximum slew rate of the drive [V/s].
    rest_slew_v_per_s : float
        Slope of the ramp to rest in ``stop``, if the drive is not at rest by then [V/s].
    max_rate_hz : float
        Maximum rate of the sample clock with these inputs [Hz].
    queue_s : float
        Length of the queue [s]: the maximum delay of the caller. A stop request takes effect after this time.
    clock : str, optional
        Terminal of the output's sample clock; ``/Dev1/ao/SampleClock`` for a drive at ``Dev1/ao0``. For a module in a
        chassis give it: ``/cDAQ1/ao/SampleClock``.

    Examples
    --------
    >>> from hyst.daq.ni import Ni
    >>> daq = Ni(  # doctest: +SKIP
    ...     drive="Dev1/ao0", sensor="Dev1/ai0", amplifier_gain=20, output_per_v=10, min_v=-20, max_v=130, monitor="Dev1/ai1"
    ... )
    """

    drive: str
    sensor: str
    amplifier_gain: float
    output_per_v: float
    min_v: float
    max_v: float
    output_at_0v: float = 0.0
    rest_v: float = 0.0
    present_v: float | None = None
    output: OutputColumn = "displacement_um"
    monitor: str | None = None
    monitor_per_v: float | None = None
    temperature: str | None = None
    degc_per_v: float = 100.0
    degc_at_0v: float = 0.0
    input_range_v: tuple[float, float] = (-10.0, 10.0)
    terminal: str = "DEFAULT"
    max_slew_v_per_s: float = math.inf
    rest_slew_v_per_s: float = 100.0
    max_rate_hz: float = 10_000.0
    queue_s: float = 0.5
    clock: str | None = None

    _ni: Any = field(init=False, repr=False)
    #: Voltage at the output when no clock runs, in drive volts.
    _present_v: float = field(init=False, repr=False)
    #: Requested sample rate; ``None`` when not started.
    _rate_hz: float | None = field(init=False, repr=False, default=None)
    _ao: Any = field(init=False, repr=False, default=None)
    _ai: Any = field(init=False, repr=False, default=None)
    _writer: Any = field(init=False, repr=False, default=None)
    _reader: Any = field(init=False, repr=False, default=None)
    #: Whether the sample clock runs.
    _clocked: bool = field(init=False, repr=False, default=False)
    #: Drive samples [V] of which no measurement has been returned, and the number of those before them since the clock
    #: was set up.
    _pending: NDArray[np.float64] = field(init=False, repr=False)
    _returned: int = field(init=False, repr=False, default=0)
    #: Samples that the queue holds, and the rate that the card runs at.
    _depth: int = field(init=False, repr=False, default=_MIN_DEPTH)
    _actual_hz: float = field(init=False, repr=False, default=math.nan)

    def __post_init__(self) -> None:
        self._present_v = self.rest_v if self.present_v is None else self.present_v
        check_limits(self.min_v, self.max_v, self.rest_v, self._present_v)
        for name in ("amplifier_gain", "output_per_v", "monitor_per_v", "degc_per_v"):
            factor = getattr(self, name)
            if factor is not None and (not math.isfinite(factor) or factor == 0):
                raise ValueError(f"{name} = {factor:g}: give a finite factor that is not 0")
        for name, value in (("queue_s", self.queue_s), ("slew to rest", self._slew_to_rest())):
            if not 0 < value < math.inf:
                raise ValueError(f"{name} = {value:g}: give a finite number above 0")
        self._pending = np.empty(0)
        self._ni = vendor()
        wirings = list(self._ni.constants.TerminalConfiguration.__members__)
        if self.terminal not in wirings:
            raise ValueError(f"terminal = {self.terminal!r}: give one of {', '.join(wirings)}")

    # --- the protocol

    def capabilities(self) -> Capabilities:
        """Returns the capabilities of the card. Nothing moves."""
        # The slowest clock of common cards is below 0.1 Hz; 1 Hz keeps the time to fill and empty the queue short.
        min_rate_hz = 1.0
        filling_s = self.queue_s + (_MIN_DEPTH + 1) / min_rate_hz
        return Capabilities(
            f"NI {self.drive}",
            min_v=self.min_v,
            max_v=self.max_v,
            rest_v=self.rest_v,
            present_v=self._present_v,
            max_slew_v_per_s=self.max_slew_v_per_s,
            min_rate_hz=min_rate_hz,
            max_rate_hz=self.max_rate_hz,
            max_block=_MAX_BLOCK,
            output=self.output,
            temperature=self.temperature is not None,
            queued=True,
            # The driver's own time limits come first: they say what is wrong.
            deadline_s=3 * _TIME_LIMIT_S + filling_s + (self.max_v - self.min_v) / self._slew_to_rest(),
        )

    def start(self, rate_hz: float) -> float:
        """Sets up the sample clock and returns the rate that it runs at [Hz]. The clock itself starts with the first drive."""
        if self._rate_hz is not None:
            raise RuntimeError("the card is started already: call stop() first")
        limits = self.capabilities()
        if not limits.min_rate_hz <= rate_hz <= limits.max_rate_hz:
            raise ValueError(f"rate = {rate_hz:g} Hz, expected {limits.min_rate_hz:g} to {limits.max_rate_hz:g} Hz: give another rate or max_rate_hz")
        with self._explained():
            self._set_up(rate_hz)
        self._rate_hz = rate_hz
        return self._actual_hz

    def exchange(self, drive: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Queues the drive and returns what has been measured; with an empty drive, all that is still missing.

        After an exception the card is stopped where it was, and only ``stop`` works: it alone knows where the output
        is. A refused voltage (``ValueError``) changes nothing.
        """
        if self._rate_hz is None:
            raise RuntimeError("the card is not started: call start(rate_hz), or after an error stop() first")
        volts = checked_drive(drive, self.min_v, self.max_v)
        if len(volts) > _MAX_BLOCK:
            raise ValueError(f"{len(volts)} drive samples in one call, expected at most {_MAX_BLOCK}: give them in smaller blocks")
        with self._explained():
            if len(volts):
                return self._continue(volts, self._rate_hz)
            return self._complete()

    def stop(self) -> None:
        """Stops the clock, brings the output to the rest voltage and holds it there."""
        self._halt()
        try:
            self._ramp_to_rest()
        except self._ni.errors.Error as error:
            raise RuntimeError(
                f"{self.drive} could not be brought to rest and may still be driven, last known at {self._present_v:.4g} V: "
                f"switch the amplifier off; {self._advice(error)}"
            ) from error

    # --- one drive, from the first sample to the last measurement

    def _continue(self, volts: NDArray[np.float64], rate_hz: float) -> dict[str, NDArray[np.float64]]:
        """Queues more drive, and returns measurements once the queue is full."""
        if self._ao is None:
            self._set_up(rate_hz)
        self._write(volts)
        self._pending = np.concatenate((self._pending, volts))
        if not self._clocked and len(self._pending) < self._depth:
            return self._scaled(np.empty((len(self._inputs()), 0)))
        self._start_clock()
        # Waiting for the measurements beyond the queue's depth sets the pace.
        return self._take(max(0, len(self._pending) - self._depth))

    def _complete(self) -> dict[str, NDArray[np.float64]]:
        """Returns all measurements that are missing, and ends the drive."""
        if not len(self._pending):
            return self._scaled(np.empty((len(self._inputs()), 0)))
        last_v = float(self._pending[-1])
        # The last measurement needs one clock edge more than there are drive samples; the other copies keep the clock
        # alive until it is read.
        self._write(np.full(self._depth, last_v))
        self._start_clock()
        measured = self._take(len(self._pending))
        self._release()
        self._present_v = last_v
        return measured

    def _take(self, count: int) -> dict[str, NDArray[np.float64]]:
        """The next ``count`` measurements; waits for them."""
        measured = self._scaled(self._read(count))
        self._pending = self._pending[count:]
        self._returned += count
        return measured

    def _scaled(self, readings: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Readings of the inputs [V] in the units of the quantities."""
        return {name: at_0v + per_v * row for (name, _, per_v, at_0v), row in zip(self._inputs(), readings, strict=True)}

    def _inputs(self) -> list[tuple[str, str, float, float]]:
        """Name, channel, factor and offset of each input. The sensor is first: it is converted closest to the clock edge."""
        inputs = [("output", self.sensor, self.output_per_v, self.output_at_0v)]
        if self.monitor is not None:
            per_v = self.amplifier_gain if self.monitor_per_v is None else self.monitor_per_v
            inputs.append(("drive", self.monitor, per_v, 0.0))
        if self.temperature is not None:
            inputs.append(("temperature", self.temperature, self.degc_per_v, self.degc_at_0v))
        return inputs

    # --- the card

    def _set_up(self, rate_hz: float) -> None:
        """Makes both tasks. New ones for each drive: nothing of how the last one ended is carried over."""
        self._pending, self._returned, self._clocked = np.empty(0), 0, False
        self._depth = max(_MIN_DEPTH, math.ceil(self.queue_s * rate_hz))
        # A full queue, the padding, and a block: no write has to wait.
        size = 2 * self._depth + _MAX_BLOCK + _SPARE
        self._set_up_output(rate_hz, size)
        # At least as large as the output's: the clock stops before a measurement is overwritten.
        self._set_up_inputs(2 * size)

    def _set_up_output(self, rate_hz: float, size: int) -> None:
        ni, self._ao = self._ni, self._ni.Task()
        self._add_output(self._ao)
        self._ao.timing.cfg_samp_clk_timing(rate_hz, sample_mode=ni.constants.AcquisitionType.CONTINUOUS, samps_per_chan=size)
        self._actual_hz = float(self._ao.timing.samp_clk_rate)
        self._ao.out_stream.regen_mode = ni.constants.RegenerationMode.DONT_ALLOW_REGENERATION
        # Set explicitly: otherwise the first write sets it, and a second one before the start fails (-200547).
        self._ao.out_stream.output_buf_size = size
        self._writer = ni.stream_writers.AnalogSingleChannelWriter(self._ao.out_stream, auto_start=False)

    def _set_up_inputs(self, size: int) -> None:
        ni, self._ai = self._ni, self._ni.Task()
        low_v, high_v = self.input_range_v
        wiring = ni.constants.TerminalConfiguration[self.terminal]
        for _, channel, _, _ in self._inputs():
            self._ai.ai_channels.add_ai_voltage_chan(channel, terminal_config=wiring, min_val=low_v, max_val=high_v)
        continuous = ni.constants.AcquisitionType.CONTINUOUS
        self._ai.timing.cfg_samp_clk_timing(self._actual_hz, source=self._clock_terminal(), sample_mode=continuous, samps_per_chan=size)
        self._ai.in_stream.input_buf_size = size
        self._reader = ni.stream_readers.AnalogMultiChannelReader(self._ai.in_stream)

    def _add_output(self, task: Any) -> None:
        """The output channel, with the drive's limits as limits of the card."""
        low_v, high_v = sorted((self.min_v / self.amplifier_gain, self.max_v / self.amplifier_gain))
        task.ao_channels.add_ao_voltage_chan(self.drive, min_val=low_v, max_val=high_v)

    def _clock_terminal(self) -> str:
        return self.clock or f"/{self.drive.partition('/')[0]}/ao/SampleClock"

    def _start_clock(self) -> None:
        """Starts the clock if it does not run, and discards the reading from before the drive."""
        if self._clocked:
            return
        # The inputs first: they then wait for the first clock edge.
        self._ai.start()
        self._ao.start()
        self._clocked = True
        self._read(1)

    def _write(self, volts: NDArray[np.float64]) -> None:
        self._writer.write_many_sample(volts / self.amplifier_gain, timeout=_TIME_LIMIT_S)

    def _read(self, count: int) -> NDArray[np.float64]:
        """The next ``count`` readings of all inputs [V], a row per input."""
        readings = np.empty((len(self._inputs()), count))
        if count:
            timeout_s = count / self._actual_hz + _TIME_LIMIT_S
            self._reader.read_many_sample(readings, number_of_samples_per_channel=count, timeout=timeout_s)
        return readings

    def _halt(self) -> None:
        """Ends a run where it is. The output holds its voltage, which is noted for the ramp to rest."""
        self._present_v = self._position_v()
        self._rate_hz = None
        self._release()

    def _release(self) -> None:
        """Ends both tasks, if there are any."""
        tasks = (self._ao, self._ai)
        self._ao = self._ai = self._writer = self._reader = None
        self._pending, self._clocked = np.empty(0), False
        for task in tasks:
            if task is not None:
                # Errors of stopping are already known or irrelevant: the padding may have run out (-200290).
                with suppress(self._ni.errors.Error):
                    task.stop()
                with suppress(self._ni.errors.Error):
                    task.close()

    def _position_v(self) -> float:
        """Drive voltage at the output: the newest sample that was put out."""
        if not self._clocked or not len(self._pending):
            return self._present_v
        try:
            generated = int(self._ao.out_stream.total_samp_per_chan_generated)
        except self._ni.errors.Error:
            # A queue that ran dry has put out all.
            return float(self._pending[-1])
        # The padding is counted too.
        newest = min(generated - 1 - self._returned, len(self._pending) - 1)
        return float(self._pending[max(newest, 0)])

    def _slew_to_rest(self) -> float:
        return min(self.rest_slew_v_per_s, self.max_slew_v_per_s)

    def _ramp_to_rest(self) -> None:
        """Writes voltages one by one, without a clock, up to the rest voltage; only that one if it is at rest."""
        with self._ni.Task() as task:
            self._add_output(task)
            writer = self._ni.stream_writers.AnalogSingleChannelWriter(task.out_stream, auto_start=True)
            for volts in ramp(self._present_v, self.rest_v, self._slew_to_rest(), _RAMP_STEP_S):
                writer.write_one_sample(volts / self.amplifier_gain, timeout=_TIME_LIMIT_S)
                self._present_v = volts
                if volts != self.rest_v:
                    time.sleep(_RAMP_STEP_S)

    # --- errors

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Stops the card at its present voltage after any error, and adds advice to an error of the driver."""
        try:
            yield
        except self._ni.errors.Error as error:
            cause = cause_of(self._ni, error, self._ao)
            self._halt()
            raise RuntimeError(f"{self.drive}: {self._advice(cause)}") from cause
        except BaseException:
            self._halt()
            raise

    def _advice(self, error: Exception) -> str:
        return advice(error, self.queue_s, self._clock_terminal())
