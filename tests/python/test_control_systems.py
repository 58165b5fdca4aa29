"""Models in python-control give the same numbers as the models themselves."""

import numpy as np
import pytest

import hyst

control = pytest.importorskip("control")
import hyst.control  # noqa: E402

PERIOD = 1e-3
T = np.arange(1500) * PERIOD
U = 40 - 40 * np.cos(2 * np.pi * 3 * T) * (1 - 0.3 * T)


def test_a_system_gives_the_outputs_of_the_model():
    pi = hyst.Pi(gain=0.05, thresholds=[4.0, 12.0], weights=[0.02, 0.015])
    plant = hyst.control.system(pi, PERIOD)
    answer = control.input_output_response(plant, T, U)
    np.testing.assert_array_equal(answer.outputs, pi.simulate(U))


def test_an_inverse_in_series_with_its_model_is_the_identity():
    model = hyst.fit(timepts=T, inputs=U, outputs=hyst.Pi(gain=0.05, thresholds=[4.0], weights=[0.03]).simulate(U))
    plant = hyst.control.system(model, PERIOD)
    inverse = hyst.control.system(model.operator(PERIOD).inverse(), PERIOD, name="inverse")
    both = control.interconnect(
        [inverse, plant], connections=[["actuator.u", "inverse.y"]], inplist=["inverse.u"], outlist=["actuator.y"]
    )
    wanted = 1.5 - 1.2 * np.cos(2 * np.pi * 2 * T)
    answer = control.input_output_response(both, T, wanted)
    np.testing.assert_allclose(answer.outputs, wanted, atol=1e-6)


def test_a_state_can_be_used_again():
    pi = hyst.Pi(gain=0.05, thresholds=[4.0], weights=[0.03])
    plant = hyst.control.system(pi, PERIOD)
    up = plant._rhs(0, np.array([0.0]), np.array([0.0]))
    top = plant._rhs(0, up, np.array([50.0]))
    first = [plant._out(0, top, np.array([volts]))[0] for volts in (30.0, 60.0, 30.0)]
    assert first[0] == first[2] == pi.simulate([0.0, 50.0, 30.0])[-1]
    with pytest.raises(hyst.ParameterError, match="begin at 0"):
        plant._rhs(0, np.array([1e6]), np.array([1.0]))


@pytest.mark.parametrize(
    ("stage", "answer"),
    [
        (hyst.Lag(seconds=0.01, period=PERIOD), lambda s: 1 / (0.01 * s + 1)),
        (
            hyst.Resonance(hz=80, damping=0.05, gain=0.6, period=PERIOD),
            lambda s: 0.4 + 0.6 * (160 * np.pi) ** 2 / (s**2 + 0.1 * 160 * np.pi * s + (160 * np.pi) ** 2),
        ),
        (hyst.Creep(seconds=[0.1, 1.0], shares=[0.03, 0.02], period=PERIOD), lambda s: 1 + 0.03 / (0.1 * s + 1) + 0.02 / (s + 1)),
    ],
)
def test_the_linear_part_has_the_response_of_the_stage(stage, answer):
    model = hyst.Model.loads(stage.to_json(input_range=(0.0, 100.0)))
    linear = hyst.control.linear_part(model, gain=1.0)
    for hz in (0.5, 5.0, 50.0, 200.0):
        s = 2j * np.pi * hz
        assert abs(linear(s) - answer(s)) < 1e-9 * abs(answer(s)) + 1e-12
    gain = hyst.control.linear_part(model).dcgain()
    assert gain == pytest.approx(answer(0) * (model.output_range[1] - model.output_range[0]) / 100.0)
