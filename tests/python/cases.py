"""Every model with parameters, a drive and a reference. To add a model, add an entry to ``CASES``."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from conftest import build
from drives import both_ways, on_lattice, one_way
from reference import activation, bouc_wen, fractional, linear, plays, preisach

PERIOD = 1e-3
N = 2000


@dataclass
class Case:
    label: str
    name: str
    parameters: dict
    u: np.ndarray
    # None if only general properties are tested.
    reference: Callable[[np.ndarray], np.ndarray] | None
    environment: dict = field(default_factory=dict)
    # As a share of the span of the output.
    tolerance: float = 1e-9
    # Options of the inverse; None if the model has no inverse and gives the reason.
    inverse: dict | None = None
    # Result of the inverse for the output of a drive:
    # "drive": the same drive.
    # "reference": the same output, by another drive if branches fold or the drive jumps at reversals of the reference.
    # "band": the output in a frequency band, within the stated error.
    # "preview": the output within its tolerance, with a preview.
    # "nearly": the output within a tolerance.
    # "part": the output as long as a condition holds, which this drive violates.
    finds: str = "drive"
    # As a share of the span of input and output; for "band" of the amplitude, in addition to the stated error.
    inverse_tolerance: float = 1e-9

    def model(self):
        return build(self.name, **self.parameters)


CASES: list[Case] = []


def case(label, name, parameters, u, reference, **more):
    CASES.append(Case(label, name, parameters, np.ascontiguousarray(u), reference, **more))


# --- plays

R, W = 5.0 * np.arange(1, 11), 0.02 / np.arange(1, 11)
SWING = both_ways(N, 100.0)
TEMPERATURE = 31.0 + 8.0 * np.sin(np.arange(N) * 2e-3)

case("play", "Play", dict(radius=12.0), SWING, lambda u: plays.plays(u, 12.0)[:, 0])
case("stop", "Stop", dict(limit=12.0), SWING, lambda u: plays.stops(u, 12.0)[:, 0])
case(
    "pi", "Pi", dict(gain=0.1, thresholds=R, weights=W), SWING,
    lambda u: plays.prandtl_ishlinskii(u, 0.1, R, W), inverse={},
)  # fmt: skip
case(
    "pi from an offset", "Pi", dict(gain=0.1, thresholds=R, weights=W), SWING + 70.0,
    lambda u: plays.prandtl_ishlinskii(u, 0.1, R, W), inverse={},
)  # fmt: skip
case(
    "pi with negative weights", "Pi", dict(gain=0.3, thresholds=R, weights=-0.5 * W), SWING,
    lambda u: plays.prandtl_ishlinskii(u, 0.3, R, -0.5 * W), inverse={},
)  # fmt: skip
# The envelopes cross at -25 V; the inverse is exact above.
for label, u, finds in [("gpi", SWING, "part"), ("gpi, envelopes apart", 0.5 * SWING + 60.0, "reference")]:
    case(
        label, "Gpi", dict(gain=0.1, thresholds=R, weights=W, left=[0.9, -2.0], right=[1.1, 3.0]), u,
        lambda u: plays.generalised_prandtl_ishlinskii(u, 0.1, R, W, lambda u: 0.9 * u - 2.0, lambda u: 1.1 * u + 3.0),
        inverse={}, finds=finds,
    )  # fmt: skip
case(
    "gpi that saturates", "Gpi",
    dict(gain=0.1, thresholds=R, weights=W, left=[90.0, 0.012, 0.1, -2.0], right=[95.0, 0.011, 0.0, 3.0]), SWING,
    lambda u: plays.generalised_prandtl_ishlinskii(
        u, 0.1, R, W, lambda u: 90 * np.tanh(0.012 * u + 0.1) - 2, lambda u: 95 * np.tanh(0.011 * u) + 3
    ), inverse={}, finds="part",
)  # fmt: skip
case(
    "gpi that saturates, envelopes apart", "Gpi",
    dict(gain=0.1, thresholds=R, weights=W, left=[90.0, 0.012, 0.0, -2.0], right=[90.0, 0.012, 0.1, 3.0]), SWING,
    lambda u: plays.generalised_prandtl_ishlinskii(
        u, 0.1, R, W, lambda u: 90 * np.tanh(0.012 * u) - 2, lambda u: 90 * np.tanh(0.012 * u + 0.1) + 3
    ), inverse={}, finds="reference",
)  # fmt: skip
for label, t in [("23 °C", 23.0), ("39 °C", 39.0), ("moving temperature", TEMPERATURE)]:
    case(
        f"td-pi, {label}", "TdPi", plays.TD_PI, 2 * SWING,
        lambda u, t=t: plays.td_pi(u, t, **plays.TD_PI), environment=dict(temperature=t), inverse={}, finds="reference",
    )  # fmt: skip
case(
    "maxwell-slip", "MaxwellSlip", dict(widths=R, gains=W, elasto_slip=True), SWING,
    lambda u: plays.maxwell_slip(u, R, W),
)  # fmt: skip
case(
    "maxwell-slip as backlash", "MaxwellSlip", dict(widths=R, gains=W), SWING,
    lambda u: plays.plays(u, R / 2) @ W, inverse={}, finds="reference",
)  # fmt: skip
case(
    "viscous pi", "ViscousPi", dict(gain=0.1, thresholds=R, weights=W, seconds=3e-3, period=PERIOD), SWING,
    lambda u: plays.viscous_prandtl_ishlinskii(u, 0.1, R, W, 3e-3, PERIOD), inverse={},
)  # fmt: skip
for label, seconds, volt_seconds in [("root", 0.0, 0.02), ("linear and root", 3e-3, 0.005)]:
    case(
        f"viscous pi, {label}", "ViscousPi",
        dict(gain=0.1, thresholds=R, weights=W, seconds=seconds, volt_seconds=volt_seconds, period=PERIOD), SWING,
        lambda u, s=seconds, j=volt_seconds: plays.root_viscous_prandtl_ishlinskii(u, 0.1, R, W, s, j, PERIOD),
        inverse={},
    )  # fmt: skip

# --- Preisach

CELLS, REFINE, LOW, HIGH = 6, 8, -10.0, 110.0
LATTICE = (HIGH - LOW) / (CELLS * REFINE)
DENSITY = np.random.default_rng(3).uniform(0.1, 1.0, CELLS * (CELLS + 1) // 2)
ONCE = np.random.default_rng(4).uniform(0.1, 1.0, CELLS)
FROM_BELOW = on_lattice(one_way(N, LOW, HIGH), LOW, LATTICE)
# Between -10 V and 110 V, starting at a node in the middle.
FROM_MIDDLE = on_lattice(50.0 + both_ways(N, 60.0), LOW, LATTICE)
# Without relays on the line on which a rest in the middle would divide cells.
OFF_THE_LINE = np.where(np.add(*np.tril_indices(CELLS)) + 1 == CELLS, 0.0, DENSITY)


def relays(**more):
    return preisach.Relays(LOW, HIGH, refine=REFINE, **more)


case(
    "preisach", "Preisach", dict(low=LOW, high=HIGH, density=DENSITY, once=ONCE), FROM_BELOW,
    relays(density=DENSITY, once=ONCE).simulate, inverse={},
)  # fmt: skip
case(
    "preisach from an offset", "Preisach", dict(low=LOW, high=HIGH, density=DENSITY), FROM_BELOW[250:],
    relays(density=DENSITY).simulate, inverse={},
)  # fmt: skip
case(
    "preisach, rest in the middle", "Preisach", dict(low=LOW, high=HIGH, density=OFF_THE_LINE, rest=50.0), FROM_MIDDLE,
    relays(density=OFF_THE_LINE, rest=50.0).simulate, inverse={},
)  # fmt: skip

# Decreases with the rate, and differs between rise and fall.
MIRROR = 1.0 - 0.02 * preisach.DPM_RATES[:, None] - 0.0005 * (preisach.DPM_CHANGES[None, :] + 80.0)
DPM_PERIOD = 1e-4
FAST = on_lattice(one_way(N, LOW, HIGH, seed=5), LOW, LATTICE)
DPM = dict(
    low=LOW, high=HIGH, density=DENSITY, rate_low=2e3, rate_high=16e3, rates=8, change_low=-80.0, change_high=80.0, changes=9,
    mirror=MIRROR.ravel(), period=DPM_PERIOD,
)  # fmt: skip


def xi(d, p):
    return preisach.mirror(preisach.DPM_RATES, preisach.DPM_CHANGES, MIRROR)(1e-3 * d, p)


case(
    "dpm", "Dpm", DPM, FAST,
    lambda u: preisach.dpm(u, relays(density=DENSITY).simulate(u), xi, DPM_PERIOD, clock=True),
)  # fmt: skip
case(
    "dpm, drifting", "Dpm", dict(DPM, drifting=True), FAST,
    lambda u: preisach.dpm_recursive(u, relays(density=DENSITY).simulate(u), xi, DPM_PERIOD, clock=True),
)  # fmt: skip
# Continuous at closing loops and steep enough to rise at any rate, so that it has an inverse. While the input rests,
# its average rate falls and the output continues to change. An input found by a search rests only approximately and
# may reverse instead. So this drive never rests.
case(
    "dpm, faded", "Dpm", dict(DPM, density=DENSITY + 4.0 * (np.diff(np.tril_indices(CELLS), axis=0)[0] == 0), fade=20.0),
    one_way(N, LOW, HIGH, seed=5), None, inverse=dict(low=LOW, high=HIGH, tolerance=1e-12), inverse_tolerance=1e-8,
)  # fmt: skip

# --- linear stages

TAU, SHARES = [0.003, 0.05, 0.4, 3.0], [0.03, 0.02, 0.015, 0.01]
case("delay", "Delay", dict(seconds=3.4e-3, period=PERIOD), SWING, lambda u: linear.delay(u, 3.4e-3, PERIOD),
     inverse=dict(bandwidth_hz=40.0), finds="band")  # fmt: skip
case("delay of nothing", "Delay", dict(seconds=0.0, period=PERIOD), SWING, lambda u: u, inverse={})
case("lag", "Lag", dict(seconds=4e-3, period=PERIOD), SWING + 5, lambda u: linear.lag(u, 4e-3, PERIOD),
     inverse=dict(bandwidth_hz=40.0), finds="band")  # fmt: skip
# Accurate to first order in the overdrive where the rate changes.
case("rate", "Rate", dict(volts=1.5, exponent=0.4, reference_rate=100.0, period=PERIOD), SWING + 5,
     lambda u: linear.rate(u, 1.5, 0.4, 100.0, PERIOD), inverse={}, finds="nearly", inverse_tolerance=0.015)  # fmt: skip
case("rate that relaxes", "Rate", dict(volts=1.5, exponent=0.4, reference_rate=100.0, period=PERIOD, relaxes=True), SWING + 5,
     lambda u: linear.relaxing_rate(u, 1.5, 0.4, 100.0, PERIOD), inverse={})  # fmt: skip
case(
    "creep", "Creep", dict(seconds=TAU, shares=SHARES, period=PERIOD), SWING + 5,
    lambda u: linear.creep(u, TAU, SHARES, PERIOD), inverse={},
)  # fmt: skip
for label, gain in [("", 1.0), (" beside a stiff part", 0.4)]:
    case(
        f"resonance{label}", "Resonance", dict(hz=65.9, damping=0.047, gain=gain, period=PERIOD), SWING + 5,
        lambda u, gain=gain: linear.resonance(u, 65.9, 0.047, gain, PERIOD),
        inverse=dict(bandwidth_hz=40.0), finds="band",
    )  # fmt: skip
case(
    "temperature", "Temperature", dict(per_kelvin=0.005, reference_degc=23.0), SWING,
    lambda u: u * (1 + 0.005 * (TEMPERATURE - 23.0)), environment=dict(temperature=TEMPERATURE), inverse={},
)  # fmt: skip
case(
    "temperature with expansion behind a thermal lag", "Temperature",
    dict(per_kelvin=0.005, reference_degc=23.0, expansion=0.2, seconds=0.3, period=PERIOD), SWING,
    lambda u: u * (1 + 0.005 * linear.lag(TEMPERATURE - 23.0, 0.3, PERIOD))
    + 0.2 * linear.lag(TEMPERATURE - 23.0, 0.3, PERIOD),
    environment=dict(temperature=TEMPERATURE), inverse={},
)  # fmt: skip
TIME = 17.0 + PERIOD * np.arange(N)
case("drift", "Drift", dict(per_second=0.02), SWING, lambda u: u + 0.02 * TIME, environment=dict(time=TIME))
case(
    "drift that settles", "Drift", dict(per_second=0.02, settling=0.7, seconds=0.8, since_s=17.0), SWING,
    lambda u: u + 0.02 * TIME + 0.7 * (1 - np.exp(-(TIME - 17.0) / 0.8)), environment=dict(time=TIME),
)  # fmt: skip
case(
    "interference", "Interference", dict(hz=50.0, amplitude=0.3, phase=0.4), SWING,
    lambda u: u + 0.3 * np.sin(2 * np.pi * 50.0 * TIME + 0.4), environment=dict(time=TIME),
)  # fmt: skip

TD_EM_PERIOD = 2e-4
for label, stop in [("plays", False), ("stops", True)]:
    case(
        f"td-em, {label}", "TdEm",
        dict(linear.TD_EM, psi=list(reversed(linear.TD_EM_PSI)), widths=linear.TD_EM_WIDTHS, gains=linear.TD_EM_SLOPES,
             elasto_slip=stop, period=TD_EM_PERIOD),
        2 * SWING + 10,
        lambda u, stop=stop: 1e6 * linear.td_em(u, 33.0, TD_EM_PERIOD, linear.TD_EM_WIDTHS, linear.TD_EM_SLOPES, stop=stop,
                                                **linear.TD_EM),
        environment=dict(temperature=33.0), inverse=None if stop else dict(bandwidth_hz=400.0), finds="band",
    )  # fmt: skip

TD_EM_WARMING = np.repeat(np.linspace(23.0, 39.0, N // 20), 20)
case(
    "td-em, moving temperature", "TdEm",
    dict(linear.TD_EM, psi=list(reversed(linear.TD_EM_PSI)), widths=linear.TD_EM_WIDTHS, gains=linear.TD_EM_SLOPES,
         period=TD_EM_PERIOD),
    2 * SWING,
    lambda u: 1e6 * linear.td_em(u, TD_EM_WARMING, TD_EM_PERIOD, linear.TD_EM_WIDTHS, linear.TD_EM_SLOPES, **linear.TD_EM),
    environment=dict(temperature=TD_EM_WARMING), inverse=dict(bandwidth_hz=400.0), finds="band",
    # The temperature changes in steps of up to 0.24 % of the coupling, which excite the mode.
    inverse_tolerance=5e-3,
)  # fmt: skip

# --- curves after the hysteresis

case(
    "asymmetry", "Asymmetry", dict(thresholds=[4.0, 30.0, -3.0, -20.0], weights=[0.1, -0.05, 0.2, 0.1]), SWING,
    lambda u: u + 0.1 * np.maximum(u - 4, 0) - 0.05 * np.maximum(u - 30, 0) + 0.2 * np.minimum(u + 3, 0)
    + 0.1 * np.minimum(u + 20, 0), inverse={},
)  # fmt: skip
LOAD = 5.0 * np.cos(np.arange(N) * 7e-3)
case(
    "load", "Load", dict(per_newton=-0.02), SWING, lambda u: u - 0.02 * LOAD, environment=dict(load=LOAD), inverse={},
)  # fmt: skip


def soft_stop(u, low, high, knee):
    w = knee * (high - low)
    bend = np.clip(u, low + w, high - w)
    return bend + w * np.tanh((u - bend) / w)


case(
    "saturation", "Saturation", dict(low=-70.0, high=90.0, knee=0.2), SWING, lambda u: soft_stop(u, -70.0, 90.0, 0.2),
    inverse={},
)  # fmt: skip

# --- Bouc-Wen

SHORT = both_ways(400, 2.0)
PAPER_4 = dict(k0=0.15, alpha=0.05, beta=0.06, gamma=-0.02)
case(
    "bouc-wen, paper 3", "BoucWenClassic", bouc_wen.PAPER_3, SHORT, lambda u: bouc_wen.paper_3(u, **bouc_wen.PAPER_3),
    inverse=dict(low=-4.0, high=4.0, tolerance=1e-12), finds="reference",
)  # fmt: skip
case(
    "bouc-wen, paper 3, from an offset", "BoucWenClassic", dict(bouc_wen.PAPER_3, d=2.5), SHORT + 1.5,
    lambda u: bouc_wen.paper_3(u, **dict(bouc_wen.PAPER_3, d=2.5)), inverse=dict(low=-4.0, high=4.0, tolerance=1e-12),
)  # fmt: skip
# Exact branches for n = 1 and 2; for others the error of one sample is below 5e-6 of the largest g.
for n, tolerance in ((1.0, 1e-9), (2.0, 1e-9), (1.7, 1e-6)):
    case(
        f"bouc-wen, paper 4, n = {n}", "BoucWen", dict(PAPER_4, n=n), 20 * SHORT,
        lambda u, n=n: bouc_wen.paper_4(u, n=n, **PAPER_4), tolerance=tolerance,
        inverse=dict(low=-50.0, high=50.0, tolerance=1e-11),
    )  # fmt: skip
OSCILLATOR_PERIOD = 1 / 750
case("bouc-wen oscillator", "BoucWenOscillator", dict(bouc_wen.OSCILLATOR, period=OSCILLATOR_PERIOD),
     both_ways(400, 120.0), lambda u: bouc_wen.oscillator(u, OSCILLATOR_PERIOD, **bouc_wen.OSCILLATOR),
     tolerance=2e-6)  # fmt: skip

# --- fractional

FRACTIONAL_PERIOD = 1e-4
# The sum of exponentials is accurate to 3e-7 of each weight.
case("lfdm", "Lfdm", dict(fractional.LFDM, period=FRACTIONAL_PERIOD), 0.02 * SWING + 1.0,
     lambda u: fractional.lfdm(u, FRACTIONAL_PERIOD, **fractional.LFDM), tolerance=1e-8, inverse={})  # fmt: skip
case("ifm", "Ifm", dict(fractional.IFM, period=FRACTIONAL_PERIOD), 0.02 * SWING + 1.0,
     lambda u: fractional.ifm(u, FRACTIONAL_PERIOD, **fractional.IFM), tolerance=1e-8, inverse={})  # fmt: skip
for samples in (100, 1000):
    case(f"lfdm, {samples} samples of memory", "Lfdm",
         dict(fractional.LFDM, period=FRACTIONAL_PERIOD, memory=samples), 0.02 * SWING + 1.0,
         lambda u, m=samples: fractional.lfdm(u, FRACTIONAL_PERIOD, memory=m, **fractional.LFDM),
         inverse={})  # fmt: skip
case("ifm, 1000 samples of memory", "Ifm", dict(fractional.IFM, period=FRACTIONAL_PERIOD, memory=1000),
     0.02 * SWING + 1.0, lambda u: fractional.ifm(u, FRACTIONAL_PERIOD, memory=1000, **fractional.IFM),
     inverse={})  # fmt: skip

# --- activation functions

for name, printed in activation.PRINTED.items():
    case(name.lower(), name, dict(printed, period=PERIOD), one_way(N, 0.0, 40.0),
         lambda u, name=name, printed=printed: activation.activation(name, u, PERIOD, **printed),
         inverse=dict(tolerance=1e-9), finds="preview")  # fmt: skip
