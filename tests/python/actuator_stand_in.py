"""Simulated clock and actuator for the adapters in ``hyst.daq``, drives for them, and the outputs to expect."""

import math

import numpy as np

TAU_S = 3e-3


class Clock:
    """Replaces the module ``time``: time passes only during ``sleep`` and ``until``."""

    def __init__(self):
        self.now = 100.0
        self.listeners = []

    def perf_counter(self):
        return self.now

    def sleep(self, seconds):
        assert seconds >= 0
        self.until(self.now + seconds)

    def until(self, then):
        for listener in self.listeners:
            listener(then)
        self.now = max(self.now, then)


class Actuator:
    """First order: the output follows the voltage [µm] = 0.1 µm/V, with the time constant ``TAU_S``."""

    def __init__(self, now):
        self.output, self.volts, self.now = 0.0, 0.0, now

    def until(self, then):
        if then > self.now:
            self.output += (0.1 * self.volts - self.output) * -math.expm1(-(then - self.now) / TAU_S)
            self.now = then


def expected_outputs(drive, rate_hz):
    """Returns the output of the actuator if each voltage is held for one period and measured at its end."""
    outputs, output = [], 0.0
    for volts in drive:
        output += (0.1 * volts - output) * -math.expm1(-1 / rate_hz / TAU_S)
        outputs.append(output)
    return np.array(outputs)


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
