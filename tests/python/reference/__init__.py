"""Reference implementations of the papers' models, in NumPy and SciPy, for the tests alone.

Written from the papers' equations, by other algorithms than the package's where there are any, and for clarity, not speed.

Conventions, the same as the package's:

- the drive is linear between samples;
- linear systems start settled at ``u[0]``; memory operators start virgin and then see ``u[0]``;
- ``u̇`` in the activation models is the backward difference, 0 at the first sample;
- fractional derivatives act on the deviation from the first sample.

Papers: 1 Chen et al. (dynamic Preisach), 2 Schirrer et al. (Everett surfaces), 3 the fractional-order force observer,
4 Xie et al. (activation functions), 5 the temperature-dependent Prandtl-Ishlinskii and electromechanical models.
"""
