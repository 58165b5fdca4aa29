"""The references, against closed forms and the figures of the papers."""

from math import gamma as gamma_function

import numpy as np
import pytest
from drives import both_ways, on_lattice, one_way
from reference import activation, bouc_wen, fractional, linear, plays, preisach

TEMPERATURES = [23.0, 29.0, 33.0, 35.0, 39.0]
MEASURED = [0.1509, 0.1523, 0.1606, 0.1627, 0.1735]  # um/V, paper 5, section 2.2


def tube_drive(period):
    """Paper 5: returns two cycles of 200 sin(2 pi 0.1 t) V, and the rows of the second cycle."""
    t = np.arange(int(round(20 / period)) + 1) * period
    return 200 * np.sin(2 * np.pi * 0.1 * t), t >= 10


# --- paper 5: TD-PI


@pytest.mark.parametrize(
    "temperature, slope, measured", list(zip(TEMPERATURES, [0.1475, 0.1558, 0.1615, 0.1645, 0.1706], MEASURED))
)
def test_td_pi_slopes(temperature, slope, measured):
    u, second = tube_drive(2e-4)
    y = plays.td_pi(u, temperature, **plays.TD_PI)
    fitted = np.polyfit(u[second], y[second], 1)[0]
    assert fitted == pytest.approx(slope, abs=5e-5)
    assert fitted == pytest.approx(measured, rel=0.024)


def test_td_pi_amplitude_with_and_without_the_envelope_of_the_identity():
    u, _ = tube_drive(2e-4)
    assert np.abs(plays.td_pi(u, 23.0, **plays.TD_PI)).max() == pytest.approx(28.5, abs=0.05)
    assert np.abs(plays.td_pi_as_printed(u, 23.0, **plays.TD_PI)).max() == pytest.approx(212, abs=0.5)


def test_td_pi_first_weights():
    own = {k: plays.TD_PI[k] for k in ("alpha", "epsilon", "tau", "eta", "n", "t0")}
    p0 = plays.td_pi_weights(TEMPERATURES, **own)[1][:, 0]
    assert p0 == pytest.approx([0.977, 1.032, 1.070, 1.090, 1.130], abs=5e-4)


def test_td_pi_inverse_jumps_at_reversals():
    p = plays.TD_PI
    # At a reversal of the output, the inverse of the other envelope applies.
    assert (p["b1"] - p["a1"]) / 0.06 == pytest.approx(7.35, abs=5e-3)
    assert -p["a1"] / p["a0"] + p["b1"] / p["b0"] == pytest.approx(7.35, abs=0.05)


# --- paper 5: TD-EM


def tube(temperature, **more):
    u, second = tube_drive(1e-3)
    y = linear.td_em(u, temperature, 1e-3, linear.TD_EM_WIDTHS, linear.TD_EM_SLOPES, **linear.TD_EM, **more)
    return u[second], 1e6 * y[second]


@pytest.mark.parametrize(
    "temperature, slope, measured", list(zip(TEMPERATURES, [0.1484, 0.1526, 0.1582, 0.1619, 0.1709], MEASURED))
)
def test_td_em_slopes(temperature, slope, measured):
    u, y = tube(temperature)
    fitted = np.polyfit(u, y, 1)[0]
    assert fitted == pytest.approx(slope, abs=6e-5)
    assert fitted == pytest.approx(measured, rel=0.024)


def test_td_em_amplitude_of_plays_and_of_stops():
    assert np.abs(tube(23.0)[1]).max() == pytest.approx(28.7, abs=0.05)
    assert np.abs(tube(23.0, stop=True)[1]).max() == pytest.approx(4, abs=0.5)


def test_td_em_coupling():
    assert linear.coupling(np.array([23.0, 33.0, 39.0])) == pytest.approx([7.2971e-4, 7.7782e-4, 8.4007e-4], rel=2e-4)


def test_td_em_transfer_function():
    """Eq. 8 at 50 Hz with a linear current: no play operator in the bank."""
    period, hz, psi = 1e-4, 50.0, linear.coupling(23.0)
    t = np.arange(20000) * period
    y = linear.td_em(np.sin(2 * np.pi * hz * t), 23.0, period, [0.0], [1.0], **linear.TD_EM)[10000:]
    c, r, m, k, b = linear.TD_EM.values()
    s = 2j * np.pi * hz
    g = psi / (m * c * s**3 + (b * c + m / r) * s**2 + (k * c + b / r + psi**2) * s + k / r)
    response = 2 * np.mean(y * np.exp(-s * t[10000:])) * 1j
    # A sine of 200 linear pieces per period is too small by 1.6e-4.
    assert response == pytest.approx(g, rel=5e-4)


# --- play, stop, linear stages


def test_play_describing_function():
    """k = 1 - 2r/A: Re N = (1/2 + (asin k + k sqrt(1 - k^2))/pi), Im N = -(1 - k^2)/pi (Gelb and Vander Velde)."""
    angle = 2 * np.pi * np.arange(40000) / 20000
    p = plays.plays(np.sin(angle), 0.3)[20000:, 0]
    k = 1 - 2 * 0.3
    n = 2 * np.mean(p * np.exp(-1j * angle[20000:])) * 1j
    assert n.real == pytest.approx(0.5 + (np.arcsin(k) + k * np.sqrt(1 - k * k)) / np.pi, abs=1e-6)
    assert n.imag == pytest.approx(-(1 - k * k) / np.pi, abs=1e-6)


def test_play_and_stop_add_up():
    u = both_ways(500, 10.0)
    assert plays.plays(u, [1.0, 4.0]) + plays.stops(u, [1.0, 4.0]) == pytest.approx(np.stack([u, u], axis=1), abs=1e-12)


def test_resonance_from_a_ramp():
    """Closed form of an undamped mode driven by u = t: x = t - sin(w t)/w."""
    t = np.arange(500) * 1e-3
    x = linear.resonance(t, 30.0, 0.0, 1.0, 1e-3)
    w = 2 * np.pi * 30.0
    assert x == pytest.approx(t - np.sin(w * t) / w, abs=1e-12)


# --- paper 1


LOW, HIGH, CELLS, REFINE = 0.0, 80.0, 4, 10
STEP = (HIGH - LOW) / (CELLS * REFINE)


def test_everett_sum_is_the_sum_of_relays():
    density = np.random.default_rng(0).uniform(0.1, 1, CELLS * (CELLS + 1) // 2)
    relays = preisach.Relays(LOW, HIGH, density, refine=REFINE)
    u = on_lattice(one_way(600, LOW, HIGH), LOW, STEP)
    everett = preisach.everett_of_relays(relays)
    assert preisach.everett_sum(u, LOW, everett) == pytest.approx(relays.simulate(u), abs=1e-12)


def test_dominating_extrema():
    assert preisach.dominating([0, 5, 2, 4, 3]) == [1, 2, 3, 4]
    assert preisach.dominating([0, 5, 2, 4, 3, 4.5]) == [1, 2, 5]
    assert preisach.dominating([0, 5, 2, 4, 1]) == [1, 4]
    assert preisach.dominating([0, 5, 2, 6]) == [3]


def sawtooth_forces(model, clock, cycles=4):
    """Returns the forces at the minima of an 80 V sawtooth on N = 0.18 u; the mirror function is 1 up and 0.8 down."""
    up = np.linspace(0.0, 80.0, 41)
    u = np.concatenate([[0.0]] + [np.concatenate([up[1:], up[-2::-1]])] * cycles)
    y = model(u, 0.18 * u, lambda d, p: 1.0 if p > 0 else 0.8, 1e-4, clock)
    return y[:: 2 * 40]


@pytest.mark.parametrize("clock", [False, True])
def test_eq_17_drifts_and_eq_6_does_not(clock):
    assert np.diff(sawtooth_forces(preisach.dpm_recursive, clock)) == pytest.approx(2.9, abs=0.05)
    stack = sawtooth_forces(preisach.dpm, clock)
    assert stack[0] == 0.0 and np.ptp(stack[1:]) < 1e-12


def test_dpm_without_rate_dependence_is_the_classical_model():
    relays = preisach.Relays(LOW, HIGH, np.ones(CELLS * (CELLS + 1) // 2), refine=REFINE)
    u = on_lattice(one_way(400, LOW, HIGH), LOW, STEP)
    y = relays.simulate(u)
    for model in (preisach.dpm, preisach.dpm_recursive):
        assert model(u, y, lambda d, p: 1.0, 1e-3) == pytest.approx(y, abs=1e-12)


def test_mirror_function():
    nodes = 1 - 0.03 * preisach.DPM_RATES[:, None] + 0.001 * preisach.DPM_CHANGES[None, :]
    xi = preisach.mirror(preisach.DPM_RATES, preisach.DPM_CHANGES, nodes)
    assert xi(0.0, 30.0) == 1.0
    assert xi(1.0, 20.0) == pytest.approx((1.0 + nodes[0, 5]) / 2)
    assert xi(5.0, 30.0) == pytest.approx(1 - 0.03 * 5.0 + 0.001 * 30.0)
    assert xi(99.0, -99.0) == pytest.approx(nodes[-1, 0])


# --- paper 2


def test_inverse_surface_is_exact_on_first_order_curves_only():
    """Relays of density a + b and a reversible slope, on 0 ... 1."""

    def everett(a, b):
        return (a - b) ** 2 * (a + b) / 2 + (a - b) / 5

    grid = np.linspace(0.0, 1.0, 2001)

    def top(high):
        return np.interp(high, everett(grid, 0.0), grid)

    def below(alpha, drop):
        b = np.linspace(alpha, 0.0, 2001)
        return np.interp(drop, everett(alpha, b), b)

    first_order = np.concatenate([np.linspace(0.0, 0.9, 50), np.linspace(0.88, 0.1, 40)])
    f = preisach.everett_sum(first_order, 0.0, everett)
    assert preisach.inverse_surface(f, top, below) == pytest.approx(first_order, abs=1e-6)
    minor = np.concatenate([np.linspace(0.0, 1.0, 100), 0.6 + 0.3 * np.cos(np.linspace(0.0, 4 * np.pi, 200))])
    f = preisach.everett_sum(minor, 0.0, everett)
    error = np.sqrt(np.mean((preisach.inverse_surface(f, top, below) - minor) ** 2))
    assert 0.005 < error < 0.02


# --- paper 3


def test_gains_over_the_test_band():
    hz = np.array([5.0, 10.0, 15.0, 20.0, 30.0])
    lfdm, ifm = np.abs(fractional.lfdm_response(hz, **fractional.LFDM)), np.abs(fractional.ifm_response(hz, **fractional.IFM))
    assert lfdm[[0, -1]] == pytest.approx([4.9, 3.3], abs=0.05) and np.all(np.diff(lfdm) < 0)
    assert ifm[[0, -1]] == pytest.approx([1.70, 1.54], abs=0.005) and np.all(np.diff(ifm) < 0)


@pytest.mark.parametrize("model", ["lfdm", "ifm"])
def test_sums_follow_the_response(model):
    """First order in the period: at 10 kHz within 1 % of the closed form."""
    period, hz = 1e-4, 20.0
    t = np.arange(4000) * period
    simulate, response = getattr(fractional, model), getattr(fractional, f"{model}_response")
    parameters = getattr(fractional, model.upper())
    y = simulate(np.sin(2 * np.pi * hz * t), period, **parameters)[-1000:]
    basis = np.stack([np.sin(2 * np.pi * hz * t), np.cos(2 * np.pi * hz * t), np.ones_like(t)], axis=1)[-1000:]
    a, b, _ = np.linalg.lstsq(basis, y, rcond=None)[0]
    assert a + 1j * b == pytest.approx(complex(response(hz, **parameters)), rel=0.01)


def test_derivative_of_a_power():
    """D^mu t^p = Gamma(p + 1) / Gamma(p + 1 - mu) t^(p - mu)."""
    t = np.arange(2001) * 1e-3
    exact = gamma_function(3) / gamma_function(3 - 0.4) * 2.0**1.6
    assert fractional.derivative(t**2, 0.4, 1e-3)[-1] == pytest.approx(exact, rel=1e-3)


def test_bouc_wen_first_branch_and_reversal():
    p = bouc_wen.PAPER_3
    u = np.concatenate([np.linspace(0.0, 3.0, 31), [3.0 - 1e-4]])
    x = bouc_wen.paper_3(u, **p)
    h = (p["a"] / p["b"]) * (1 - np.exp(-p["b"] * u[:31]))
    assert x[:31] == pytest.approx(p["d"] * u[:31] - h, abs=1e-6)
    # With the printed numbers 2A > d: directly after a reversal the slope is negative.
    assert 2 * p["a"] > p["d"]
    after_saturation = bouc_wen.paper_3(np.array([0.0, 30.0, 30.0 - 1e-4]), **p)
    assert (after_saturation[2] - after_saturation[1]) / -1e-4 == pytest.approx(p["d"] - 2 * p["a"], abs=1e-3)


def test_both_bouc_wen_forms_agree_for_n_1():
    """n = 1: paper 4 with g = -h, its beta = paper 3's B and its gamma = -Gamma, alpha = -A, k0 = d."""
    u = both_ways(80, 2.0)
    x = bouc_wen.paper_3(u, a=0.9, b=1.4, gamma=0.3, d=1.9)
    z = bouc_wen.paper_4(u, k0=1.9, alpha=-0.9, beta=1.4, gamma=-0.3, n=1.0)
    assert x == pytest.approx(z, abs=1e-10)


def test_oscillator_without_hysteresis_is_linear():
    u = both_ways(100, 100.0)
    own = dict(bouc_wen.OSCILLATOR, beta=0.0)
    y = bouc_wen.oscillator(u, 1 / 750, **own)
    m, c, k = own["mass"], own["damping"], own["stiffness"] + own["alpha"]
    x = linear.settled([[0.0, 1.0], [-k / m, -c / m]], [0.0, 1 / m], [1.0, 0.0], 0.0, u, 1 / 750)
    assert y == pytest.approx(x, abs=1e-9 * np.ptp(x))


# --- paper 4


def test_activation_zero_in_the_right_half_plane():
    p = activation.PRINTED["Atan"]
    assert p["k0"] / abs(p["alpha"]) == pytest.approx(892, abs=0.5)


def test_printed_softsign_is_divided_by_gamma():
    p, u = activation.PRINTED["Softsign"], np.linspace(-40, 40, 81)
    as_printed = 100 * u / (1 + 318.2799 * np.abs(u))
    assert p["beta"] * activation.FUNCTIONS["Softsign"](318.2799 * u) == pytest.approx(as_printed, rel=1e-12)
    assert p["beta"] == pytest.approx(activation.PRINTED["Tanh"]["beta"], rel=0.01)
