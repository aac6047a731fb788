"""How the sweep's kernels calculate: as it is written, without fused multiply-adds.

Which of those the compiler finds depends on what it inlines where: a kernel that was just compiled
would differ in its last bits from the same one read from the disk, and what was resumed from what
ran at once.
"""

from __future__ import annotations

from typing import Any

import numba

from kickdyn.flight.lanes import WITHIN

HOW: dict[str, Any] = {"error_model": "numpy"}

njit: Any = numba.njit(**HOW, **WITHIN)
