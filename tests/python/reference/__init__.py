"""Reference implementations of the papers' models in NumPy and SciPy, only for the tests.

They follow the papers' equations, with other algorithms than the package where possible, and for clarity, not speed.

Conventions, as in the package:

- the drive is linear between samples;
- linear systems start settled at ``u[0]``; memory operators start virgin, then receive ``u[0]``;
- ``u̇`` in the activation models is the backward difference, 0 at the first sample;
- fractional derivatives act on the deviation from the first sample.

Papers: 1 Chen et al. (dynamic Preisach), 2 Schirrer et al. (Everett surfaces), 3 the fractional-order force observer,
4 Xie et al. (activation functions), 5 the temperature-dependent Prandtl-Ishlinskii and electromechanical models.
"""
