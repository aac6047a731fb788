r"""Torque of muscles, which falls with the speed at which they shorten, in the form of Hill.

.. math:: \frac{\tau(\omega)}{\tau_0} = \frac{1 - u}{1 + u / k}, \qquad u = \frac{\omega}{\omega_0}

with the torque :math:`\tau_0` of a joint at rest and the speed :math:`\omega_0` at which its
muscles have none. :math:`k = a / F_0` is 0.25 (Hill 1938, Proc. R. Soc. Lond. B 126:136). Muscles
that lengthen count as at rest, although they are stronger.
"""

from typing import Any

HILL = 0.25
"""k of Hill's measurements, of muscles of frogs."""


def muscle_share(u: Any) -> Any:
    """Return the torque over that at rest, at a speed over that without torque, 0 to 1."""
    return (1.0 - u) / (1.0 + u / HILL)


def muscle_share_slope(u: Any) -> Any:
    """Return the derivative of `muscle_share`."""
    return -(1.0 + 1.0 / HILL) / (1.0 + u / HILL) ** 2
