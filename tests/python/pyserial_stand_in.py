"""Simulated replacement of the package ``pyserial``, with one instrument.

It accepts exactly the arguments of the vendor's functions. test_daq_serial.py compares it with the package, if
installed.
"""

from actuator_stand_in import Actuator


class SerialException(OSError):
    pass


class TermiosError(Exception):
    """Like ``termios.error``, which pyserial does not convert."""


class Instrument:
    """An instrument with the actuator; it answers after ``latency_s``."""

    def __init__(self, clock):
        self.clock, self.actuator = clock, Actuator(clock.now)
        self.latency_s, self.answer, self.acknowledge, self.lost = 1e-3, "{:.12f}", None, False
        self.end, self.sets, self.arguments, self.flushed = "\n", [], {}, False

    def take(self, line):
        """Returns the answer to a line, or None."""
        self.actuator.until(self.clock.now)
        if line == "*IDN?":
            return "ACME,PIEZO 1"
        if line == "MEAS?":
            return None if self.answer is None else self.answer.format(self.actuator.output)
        command, _, volts = line.partition(" ")
        assert command == "VOLT"
        self.actuator.volts = float(volts)
        self.sets.append((self.clock.now, float(volts)))
        return self.acknowledge


class Serial:
    instrument = None

    def __init__(
        self,
        port=None,
        baudrate=9600,
        bytesize=8,
        parity="N",
        stopbits=1,
        timeout=None,
        xonxoff=False,
        rtscts=False,
        write_timeout=None,
        dsrdtr=False,
        inter_byte_timeout=None,
        exclusive=None,
        **kwargs,
    ):
        if kwargs:
            raise ValueError(f"unexpected keyword arguments: {kwargs!r}")
        self.instrument.arguments = {"port": port, "baudrate": baudrate, "parity": parity, "write_timeout": write_timeout}
        self.timeout, self.incoming, self.is_open = timeout, b"", True
        self.instrument.port = self
        self.check()

    def check(self):
        if self.instrument.lost or not self.is_open:
            raise SerialException("device disconnected")

    def reset_input_buffer(self):
        if self.instrument.lost:
            raise TermiosError(5, "Input/output error")
        self.incoming = b""

    def write(self, data, /):
        self.check()
        end = self.instrument.end.encode()
        assert data.endswith(end)
        answer = self.instrument.take(data[: -len(end)].decode())
        if answer is not None:
            self.incoming += answer.encode("latin1") + end
        return len(data)

    def read_until(self, expected=b"\n", size=None):
        self.check()
        line, found, self.incoming = self.incoming.partition(expected)
        self.instrument.clock.sleep(min(self.instrument.latency_s, self.timeout) if found else self.timeout)
        return (line + found)[:size]

    def flush(self):
        self.check()
        self.instrument.flushed = True

    def close(self):
        self.is_open = False
