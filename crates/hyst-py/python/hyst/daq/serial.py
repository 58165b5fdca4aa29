"""Instruments with text commands at a serial port, through the package ``pyserial``.

**Not tried on hardware.** This module was tested only against a stand-in with the signatures of ``pyserial`` 3.5, and
with ``pyserial`` 3.5 itself at a pseudo-terminal of Linux (tests/python/test_daq_serial.py). Not tested at all: a
real instrument, a real port, USB adapters, Windows, macOS.

The samples are timed by software. This module waits for each sample with ``time.sleep`` and ``time.perf_counter``, then
sends the voltage and asks for the output. No hardware clock is involved. Therefore:

* A record has equal sample periods, but the real times differ from them: every command is late by some milliseconds,
  and by another amount each time. Use this for slow drives, up to about 50 Hz.
* Drive sample ``k`` is sent at time ``k`` times the period. Its measurement is requested one period later, just before
  drive sample ``k + 1`` is sent.
* If a voltage is not passed to the port, or a reply not read, half a period after its time, ``exchange`` raises.
  ``worst_lateness_s`` is the maximum delay of the run so far. The delay does not include the transmission of a voltage
  and its execution in the instrument, unless the instrument acknowledges: at 9600 baud each character takes 1 ms.

``time.perf_counter`` is a monotonic clock. ``time.monotonic`` is not used: on Windows it advances in steps of 16 ms
before Python 3.13.
"""

from __future__ import annotations

import importlib
import math
import re
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import Capabilities, OutputColumn
from ._volts import check_limits, checked_drive, ramp

__all__ = ["SerialInstrument"]

#: Fastest rate at which software times samples well enough on common computers [Hz].
_MAX_RATE_HZ = 50.0
#: A sample that is later than this share of the period may belong to the next one.
_MAX_LATENESS = 0.5
#: The share of the period that the advised rate leaves for the lateness that was measured.
_ADVISED_LATENESS = 0.25
#: Maximum length of a reply [bytes].
_MAX_REPLY = 1024


def _vendor() -> Any:
    """Imports the package ``pyserial`` (module ``serial``) as ``Any``, because it may have no type stubs."""
    # Absolute: this module has the same last name.
    try:
        package = importlib.import_module("serial")
    except ImportError as error:
        raise ImportError("hyst.daq.serial needs the package pyserial: pip install pyserial") from error
    if not hasattr(package, "Serial"):
        raise ImportError(f"{package.__name__} is not pyserial: pip uninstall serial, then pip install pyserial")
    return package


@dataclass(kw_only=True, eq=False)
class SerialInstrument:
    """An instrument at a serial port: one command sets the voltage, another asks for the output.

    Parameters
    ----------
    port : str
        Serial port, such as ``COM3`` or ``/dev/ttyUSB0``. It is opened at once, and stays open until ``close``.
    set : str
        Command that sets the voltage, with ``{volts}`` and a format, such as ``"VOLT {volts:.4f}"``.
    query : str
        Command that asks for the output, such as ``"MEAS?"``.
    min_v, max_v, rest_v : float
        Minimum, maximum and rest voltage [V].
    present_v : float, optional
        Voltage when the object is made [V]; the rest voltage if not given.
    identify : str, optional
        Command that asks for the name, such as ``"*IDN?"``. It is sent once, when the object is made.
    reply : str, optional
        Regular expression that finds the number in the reply to ``query``: its first group, or all of the match. The
        whole line if not given.
    acknowledge : str, optional
        Regular expression for the line that the instrument sends after ``set``, such as ``"OK"``. Give it only if there
        is such a line.
    output_per_unit, output_at_0 : float
        Output per unit of the reply and output at a reply of 0, in the unit of ``output``.
    output : str
        Quantity and unit of the output, as in ``Capabilities``.
    end : str
        Line ending of commands and replies.
    baud : int
        Baud rate.
    timeout_s : float
        Time limit for a reply, and for sending a command [s].
    port_options : mapping, optional
        More arguments of ``serial.Serial``, such as ``{"parity": "E", "rtscts": True}``.
    max_slew_v_per_s : float
        Maximum slew rate of the voltage [V/s].
    rest_slew_v_per_s : float
        Slope of the ramp to rest in ``stop``, if the voltage is not at rest by then [V/s].

    Attributes
    ----------
    worst_lateness_s : float
        The largest delay of a sample since ``start`` [s].

    Examples
    --------
    >>> from hyst.daq.serial import SerialInstrument
    >>> daq = SerialInstrument(  # doctest: +SKIP
    ...     port="COM3", set="VOLT {volts:.4f}", query="MEAS?", identify="*IDN?", min_v=0, max_v=100, baud=115200
    ... )
    """

    port: str
    set: str
    query: str
    min_v: float
    max_v: float
    rest_v: float = 0.0
    present_v: float | None = None
    identify: str | None = None
    reply: str | None = None
    acknowledge: str | None = None
    output_per_unit: float = 1.0
    output_at_0: float = 0.0
    output: OutputColumn = "displacement_um"
    end: str = "\n"
    baud: int = 9600
    timeout_s: float = 0.5
    port_options: Mapping[str, Any] | None = None
    max_slew_v_per_s: float = math.inf
    rest_slew_v_per_s: float = 100.0

    worst_lateness_s: float = field(init=False, repr=False, default=0.0)
    _line: Any = field(init=False, repr=False)
    _name: str = field(init=False, repr=False)
    _present_v: float = field(init=False, repr=False)
    #: Sample period; ``None`` when not started.
    _period_s: float | None = field(init=False, repr=False, default=None)
    #: When the next sample is due, on the clock ``time.perf_counter``; ``None`` before the first.
    _due_s: float | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        self._present_v = self.rest_v if self.present_v is None else self.present_v
        check_limits(self.min_v, self.max_v, self.rest_v, self._present_v)
        for name, value in (("timeout_s", self.timeout_s), ("slew to rest", self._slew_to_rest())):
            if not 0 < value < math.inf:
                raise ValueError(f"{name} = {value:g}: give a finite number above 0")
        if not self.end:
            raise ValueError("end is empty: give the line ending of the instrument, for example end='\\r\\n'")
        self._check_template()
        serial = _vendor()
        with self._explained("be opened"):
            self._line = serial.Serial(
                port=self.port, baudrate=self.baud, timeout=self.timeout_s, write_timeout=self.timeout_s, **(self.port_options or {})
            )
        try:
            self._name = f"serial {self.port}" if self.identify is None else self._ask(self.identify)
        except BaseException:
            self.close()
            raise

    def _check_template(self) -> None:
        """Raises ``ValueError`` if the template cannot set a voltage."""
        try:
            distinct = self.set.format(volts=self.min_v) != self.set.format(volts=self.max_v)
        except (KeyError, IndexError, ValueError) as error:
            raise ValueError(f"set = {self.set!r} is not a template ({error}): give for example set='VOLT {{volts:.4f}}'") from error
        if not distinct:
            raise ValueError(f"set = {self.set!r} does not depend on the voltage: give for example set='VOLT {{volts:.4f}}'")

    # --- the protocol

    def capabilities(self) -> Capabilities:
        """Returns the capabilities of the instrument. Nothing moves."""
        return Capabilities(
            self._name,
            min_v=self.min_v,
            max_v=self.max_v,
            rest_v=self.rest_v,
            present_v=self._present_v,
            max_slew_v_per_s=self.max_slew_v_per_s,
            min_rate_hz=0.01,
            max_rate_hz=_MAX_RATE_HZ,
            # An exchange that raises returns nothing: with one sample per call no other measurement is lost.
            max_block=1,
            output=self.output,
            # The port's own time limits come first: they say what is wrong.
            deadline_s=2.0 + 3 * self.timeout_s + (self.max_v - self.min_v) / self._slew_to_rest(),
        )

    def start(self, rate_hz: float) -> float:
        """Sets the sample period. The first sample is due when ``exchange`` is first called."""
        if self._period_s is not None:
            raise RuntimeError("the instrument is started already: call stop() first")
        limits = self.capabilities()
        if not limits.min_rate_hz <= rate_hz <= limits.max_rate_hz:
            raise ValueError(
                f"rate = {rate_hz:g} Hz, expected {limits.min_rate_hz:g} to {limits.max_rate_hz:g} Hz, because software times the samples: "
                "give another rate"
            )
        self._period_s, self._due_s, self.worst_lateness_s = 1 / rate_hz, None, 0.0
        return rate_hz

    def exchange(self, drive: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Puts out the drive and measures one period after each sample. There must be no pause before the next call.

        After an exception only ``stop`` works: it alone knows the voltage. A refused voltage (``ValueError``) changes
        nothing.
        """
        if self._period_s is None:
            raise RuntimeError("the instrument is not started: call start(rate_hz), or after an error stop() first")
        volts = checked_drive(drive, self.min_v, self.max_v)
        try:
            return {"output": np.array([self._sample(float(v), self._period_s) for v in volts])}
        except BaseException:
            self._period_s = None
            raise

    def stop(self) -> None:
        """Brings the voltage to rest. The port stays open."""
        self._period_s = None
        step_s = 1 / _MAX_RATE_HZ
        try:
            for volts in ramp(self._present_v, self.rest_v, self._slew_to_rest(), step_s):
                self._put_out(volts)
                if volts != self.rest_v:
                    time.sleep(step_s)
            with self._explained("send the rest voltage"):
                # What is not transmitted yet may be lost when the port is closed.
                self._line.flush()
        except (OSError, RuntimeError) as error:
            raise RuntimeError(
                f"{self.port} could not be brought to rest and may still be driven, last known at {self._present_v:.4g} V: "
                f"switch the amplifier off; {error}"
            ) from error

    def close(self) -> None:
        """Closes the port. The voltage stays as it is."""
        self._line.close()

    # --- one sample

    def _sample(self, volts: float, period_s: float) -> float:
        """Puts out a voltage when it is due, and measures when the next one is due."""
        due_s = time.perf_counter() if self._due_s is None else self._due_s
        self._put_out(volts)
        self._check_lateness(due_s, period_s)
        self._due_s = due_s + period_s
        time.sleep(max(0.0, self._due_s - time.perf_counter()))
        measured = self._measure()
        self._check_lateness(self._due_s, period_s)
        return measured

    def _check_lateness(self, due_s: float, period_s: float) -> None:
        """Raises ``TimeoutError`` if what was due is done too late."""
        late_s = time.perf_counter() - due_s
        self.worst_lateness_s = max(self.worst_lateness_s, late_s)
        if late_s > _MAX_LATENESS * period_s:
            raise TimeoutError(
                f"{self.port}: a sample was {1e3 * late_s:.3g} ms late, expected at most {1e3 * _MAX_LATENESS * period_s:.3g} ms, half of the "
                f"period: give a rate of at most {_ADVISED_LATENESS / late_s:.2g} Hz, or a faster baud rate, or close other programs"
            )

    def _slew_to_rest(self) -> float:
        return min(self.rest_slew_v_per_s, self.max_slew_v_per_s)

    def _put_out(self, volts: float) -> None:
        command = self.set.format(volts=volts)
        if self.acknowledge is None:
            self._send(command)
        else:
            answer = self._ask(command)
            if not re.search(self.acknowledge, answer):
                raise RuntimeError(
                    f"{self.port}: the reply to {command!r} is {answer!r}, expected a match of {self.acknowledge!r}: "
                    "check set and acknowledge against the instrument's manual"
                )
        self._present_v = volts

    def _measure(self) -> float:
        answer = self._ask(self.query)
        text: str | None = answer
        if self.reply is not None:
            found = re.search(self.reply, answer)
            text = found and (found[1] if found.re.groups else found[0])
        try:
            value = float(text or "")
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise RuntimeError(
                f"{self.port}: the reply to {self.query!r} is {answer!r}, expected a number: check query and baud, "
                "or give reply, a regular expression that finds the number, for example reply=r'([-+.0-9eE]+) um'"
            )
        return self.output_at_0 + self.output_per_unit * value

    # --- lines

    def _send(self, command: str) -> None:
        with self._explained(f"take {command!r}"):
            # A reply that came too late must not be read as the next one.
            self._line.reset_input_buffer()
            self._line.write((command + self.end).encode("ascii"))

    def _ask(self, command: str) -> str:
        """Sends a command and returns the line that comes back."""
        self._send(command)
        end = self.end.encode("ascii")
        with self._explained(f"answer {command!r}"):
            # By position: pyserial has renamed the first parameter.
            line: bytes = self._line.read_until(end, _MAX_REPLY)
        if not line.endswith(end):
            raise TimeoutError(
                f"{self.port}: no line in reply to {command!r} within {self.timeout_s:g} s, only {line!r}: check port, baud "
                f"({self.baud}), end ({self.end!r}) and whether the instrument is on, or give a larger timeout_s"
            )
        return line.decode("ascii", errors="backslashreplace").strip()

    @contextmanager
    def _explained(self, task: str) -> Iterator[None]:
        """Adds advice to an error of the port."""
        try:
            yield
        except ValueError:
            # A setting of the port, which the message names.
            raise
        except Exception as error:  # pyserial lets termios.error through, which is no OSError.
            raise RuntimeError(
                f"{self.port} cannot {task}: check the cable and the name of the port, and close other programs that use it; {error}"
            ) from error
