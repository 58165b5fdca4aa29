"""Models in python-control: the model as a ``NonlinearIOSystem``, its linear part as a ``StateSpace``.

::

    import control, hyst.control

    model = hyst.Model.load("extended.json")
    plant = hyst.control.system(model, period=1e-3)             # input voltage, output displacement
    t, y = control.input_output_response(plant, t, u)           # the same numbers as model.operator(1e-3).simulate(u)
    linear = hyst.control.linear_part(model)                    # lag, resonance, creep and gain, as a StateSpace
    control.bode_plot(linear)

Needs ``pip install control``.
"""

from __future__ import annotations

from collections import OrderedDict
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._errors import ParameterError
from ._hyst import Model, Operator, _History

__all__ = ["linear_part", "system"]

#: Number of stored histories of a system. A simulation forward in time needs only the last one.
MAX_HISTORIES = 4096


def _control() -> Any:
    try:
        return import_module("control")
    except ImportError:
        raise ImportError("hyst.control needs python-control: pip install control") from None


class _Histories:
    """An operator as a function of state and input.

    The memory of a hysteresis is not a vector of fixed length. Therefore the state is the number of a stored history.
    A stored history does not change: the same state and input always give the same next state and output.
    """

    def __init__(self, operator: Operator, temperature: float | None) -> None:
        self._operator = operator
        self._environment = {} if temperature is None else {"temperature": temperature}
        self._stored: OrderedDict[int, _History] = OrderedDict()
        self._after: OrderedDict[tuple[int, float], tuple[int, float]] = OrderedDict()
        self._next = 1

    def after(self, state: float, u: float) -> tuple[int, float]:
        """Returns the next state and the output for ``u`` in ``state``. State 0 is rest at the first input."""
        key = (round(state), u)
        if key not in self._after:
            self._after[key] = self._step(*key)
            if len(self._after) > MAX_HISTORIES:
                self._after.popitem(last=False)
        return self._after[key]

    def _step(self, state: int, u: float) -> tuple[int, float]:
        if state == 0:
            y = self._operator.reset(u, **self._environment)
        elif state in self._stored:
            self._operator._resume(self._stored[state])
            y = self._operator.step(u, **self._environment)
        else:
            raise ParameterError(f"state {state} is not one of the last {MAX_HISTORIES} states of this system: begin at 0")
        history, number = self._operator._history(), self._next
        assert history is not None
        self._stored[number] = history
        self._next += 1
        if len(self._stored) > MAX_HISTORIES:
            self._stored.popitem(last=False)
        return number, y


def system(model: Model | Operator, period: float | None = None, *, temperature: float | None = None, name: str = "actuator") -> Any:
    """Returns the model as a discrete-time ``control.NonlinearIOSystem`` with one input, one output and one state.

    Parameters
    ----------
    model : Model or Operator
        The model, or an operator (``hyst.Pi(…)``, ``model.operator(…).inverse()``), which has its own sample period.
    period : float
        Sample period [s].
    temperature : float, optional
        Constant temperature [°C], if the model needs it.
    name : str
        Name of the system; connections use the input ``name.u`` and the output ``name.y``.

    Notes
    -----
    The state is the number of a history, 0 at rest. It has no derivative, so ``linearize`` is not applicable; use
    ``linear_part``.
    """
    control = _control()
    if isinstance(model, Model):
        if period is None:
            raise ParameterError("a model needs the sample period: period= [s]")
        operator = model.operator(period)
    else:
        operator = model
    histories = _Histories(operator, temperature)

    def update(t: float, x: NDArray[np.float64], u: NDArray[np.float64], params: Any) -> list[float]:
        return [float(histories.after(x[0], float(u[0]))[0])]

    def output(t: float, x: NDArray[np.float64], u: NDArray[np.float64], params: Any) -> list[float]:
        return [histories.after(x[0], float(u[0]))[1]]

    return control.NonlinearIOSystem(
        update, output, inputs=["u"], outputs=["y"], states=["history"], dt=True if period is None else period, name=name
    )


def linear_part(model: Model, *, gain: float | None = None, pade: int = 2) -> Any:
    """Returns the linear stages of a model in series, as a continuous-time ``control.StateSpace`` from input to output.

    These are delay (Padé approximation), lag, resonance and creep, times the gain of the hysteresis.

    Parameters
    ----------
    model : Model
        The model.
    gain : float, optional
        Gain of the hysteresis [output unit/V]; default: slope of the line through the ends of ``input_range`` and
        ``output_range``.
    pade : int
        Order of the Padé approximation of a delay.
    """
    control = _control()
    if gain is None:
        (u0, u1), (y0, y1) = model.input_range, model.output_range
        gain = (y1 - y0) / (u1 - u0) * (-1.0 if model.falls else 1.0)
    chain = control.tf([gain], [1.0])
    for stage in model.to_dict()["stages"]:
        match stage["stage"]:
            case "delay":
                chain *= control.tf(*control.pade(stage["seconds"], pade))
            case "lag":
                chain *= control.tf([1.0], [stage["seconds"], 1.0])
            case "resonance":
                # y = v + g (x - v) with the mode x; the rest of the structure follows at once.
                w, g = 2 * np.pi * stage["hz"], stage["gain"]
                mode = control.tf([g * w * w], [1.0, 2 * stage["damping"] * w, w * w])
                chain *= mode + (1 - g) if g != 1 else mode
            case "creep":
                bank = control.tf([1.0], [1.0])
                for share, seconds in zip(stage["shares"], stage["seconds"]):
                    bank += control.tf([share], [seconds, 1.0])
                chain *= bank
    return control.ss(chain)
