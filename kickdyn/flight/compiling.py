"""A ball's equations of motion in machine code, plug-in coefficients included.

numba compiles a Python function only if all it calls is compiled too. Equations with coefficients
of kickdyn's own are kept on the disk; a user's functions are compiled in each process.
"""

import builtins
import copy
import hashlib
import math
import types
import uuid
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numba
from llvmlite import ir
from numba.core.dispatcher import Dispatcher
from numba.extending import intrinsic

from kickdyn.aerodynamics.coefficient_model import (
    CoefficientModel,
    ConstantCoefficient,
    ScaledCoefficient,
    is_known,
    name_of,
)
from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.core.compilation import WITHIN, cache_folder, compiled, is_on_disk, uncollected
from kickdyn.errors import InvalidInput
from kickdyn.flight.events import NUMBERS, EventFunction
from kickdyn.flight.follow import rolling_acceleration, rolling_share
from kickdyn.flight.forces import Acceleration, Reynolds, acceleration_function, reynolds_number

LANES = 24
"""How many flights are computed side by side."""

OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}}
"""Options of numba: a division by zero gives a number that is not finite, which spoils one lane and
stops none; a product and a sum may be one instruction."""

inlined: Any = numba.njit(**OPTIONS, **WITHIN, forceinline=True)  # a call would break up vectors
_intrinsic: Any = intrinsic

SIZE = 7 * LANES

X, Y, Z, U, V, W, LEFT = (row * LANES for row in range(7))
"""Rows of a state: displacement, velocity, spin over the launch's. Rows of its rate are alike."""

HEIGHT, SPIN_X, SPIN_Y, SPIN_Z, DECAYS = (row * LANES for row in range(5))
"""Rows of a scene: of the launch, the height and the spin; 1 where the spin decays, else 0."""

ALONG_X, ALONG_Y = SPIN_X, SPIN_Y
"""Rows of the direction at the start, of a ball that rolls."""

_vector = numba.float64[::1]
SIGNATURE: Any = numba.void(_vector, _vector, _vector)
"""Signature of `side_by_side`'s result, one for every ball and air: one integrator serves all."""

_ON_DISK = 200
"""Files of equations that are kept on the disk, two for a ball and its air."""

Callees = Sequence[tuple[Callable[..., Any], Any, str]]
"""Functions, the types of their arguments, and what an error calls them."""

_acceleration = lru_cache(maxsize=16)(acceleration_function)
"""The same function for flying and rolling, which is compiled once."""

WRAPPED = (CoefficientModel, ConstantCoefficient, ScaledCoefficient)
"""Types whose `function` is what gets compiled."""


_INTEGER = 1.5 * 2.0**52
"""A number this large has no digits behind the point: adding it rounds, to the nearest."""
_LN2_HIGH, _LN2_LOW = 0.693147180369123816490, 1.90821492927058770002e-10


@_intrinsic  # type: ignore[untyped-decorator]
def _power_of_two(typing_context: Any, shifted: Any) -> Any:
    """Return 2 to the power of a whole number to which `_INTEGER` is added."""
    whole, real = ir.IntType(64), ir.DoubleType()

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        biased = builder.add(builder.bitcast(arguments[0], whole), whole(1023))
        return builder.bitcast(builder.shl(biased, whole(52)), real)

    return numba.float64(numba.float64), generate


@inlined  # type: ignore[untyped-decorator]
def exp(x: float) -> float:
    """Return e to the x without branches, within 3e-16; 0 below -708, inf above 709."""
    within = min(max(x, -708.0), 709.0)
    shifted = within * 1.4426950408889634 + _INTEGER
    count = shifted - _INTEGER
    r = (within - count * _LN2_HIGH) - count * _LN2_LOW  # |r| < 0.35: Taylor's series
    p = 1 / 479001600 + r * (1 / 6227020800)
    p = 1 / 3628800 + r * (1 / 39916800 + r * p)
    p = 1 / 40320 + r * (1 / 362880 + r * p)
    p = 1 / 720 + r * (1 / 5040 + r * p)
    p = 1 / 24 + r * (1 / 120 + r * p)
    p = 1 / 2 + r * (1 / 6 + r * p)
    p = (1 + r * (1 + r * p)) * _power_of_two(shifted)
    p = p if x >= -708.0 else 0.0
    p = p if x <= 709.0 else math.inf
    return p if x == x else x


_HALF_ROOT = 0x3FE6A09E667F3BCD
"""The bits of the square root of 1/2."""


@_intrinsic  # type: ignore[untyped-decorator]
def _significand_and_exponent(typing_context: Any, x: Any) -> Any:
    """Return a normal number as a significand from 0.707 to 1.414 and a power of two."""
    whole, real = ir.IntType(64), ir.DoubleType()

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        bits = builder.sub(builder.bitcast(arguments[0], whole), whole(_HALF_ROOT))
        shifted = builder.lshr(builder.add(bits, whole(1 << 62)), whole(52))
        count = builder.bitcast(builder.or_(shifted, whole(0x433 << 52)), real)
        power = builder.shl(builder.ashr(bits, whole(52)), whole(52))
        significand = builder.sub(builder.bitcast(arguments[0], whole), power)
        count = builder.fsub(count, real(2.0**52 + 1024.0))
        return context.make_tuple(
            builder, signature.return_type, (builder.bitcast(significand, real), count)
        )

    pair: Any = numba.types.UniTuple
    return pair(numba.float64, 2)(numba.float64), generate


@inlined  # type: ignore[untyped-decorator]
def log(x: float) -> float:
    """Return the natural logarithm without branches, within 3e-16 of it; nan below 0."""
    tiny = x < 1e-300
    m, count = _significand_and_exponent(x * 2.0**54 if tiny else x)
    count = count - 54.0 if tiny else count
    f = m - 1.0
    s = f / (2.0 + f)
    z = s * s  # log(1 + f) is 2 artanh s: fdlibm's polynomial
    p = 1.531383769920937332e-01 + z * 1.479819860511658591e-01
    p = 2.222219843214978396e-01 + z * (1.818357216161805012e-01 + z * p)
    p = z * (
        6.666666666666735130e-01
        + z * (3.999999999940941908e-01 + z * (2.857142874366239149e-01 + z * p))
    )
    half = 0.5 * f * f
    result = count * _LN2_HIGH - ((half - (s * (half + p) + count * _LN2_LOW)) - f)
    result = result if x > 0.0 else (-math.inf if x == 0.0 else math.nan)
    return result if x < math.inf else x + x


mathematics = types.ModuleType("math")
"""The module `math` with `exp` and `log` for vectors; all else it has calls the C library."""

mathematics.__dict__.update({**vars(math), "exp": exp, "log": log})


@lru_cache(maxsize=16)
def compiled_rates(ball: Ball, air: Air) -> Any:
    """Return the rates of many flights side by side, `side_by_side`, as machine code.

    A wind or a coefficient that numba cannot compile raises `InvalidInput`.
    """
    straight, bound = copy.copy(air), 0.0
    for name in ("drag", "lift", "torque"):
        model = getattr(air, name)
        if isinstance(model, CoefficientModel) and model.branch_free is not None:
            object.__setattr__(straight, name, model.branch_free[1])
            bound = max(bound, model.branch_free[0])
    rates = side_by_side(
        _acceleration(ball, air),
        acceleration_function(ball, straight),
        reynolds_number(ball, air),
        bound,
    )
    key = _constants(ball, air)
    return _from_disk(rates, _callees(air), "the equations of motion of a ball in its air", key)


def _constants(ball: Ball, air: Air) -> str | None:
    """Return the constants of the equations of motion as text; None if a user wrote a model."""
    models = air.drag, air.lift, air.torque
    if callable(air.wind) or not all(model is None or is_known(model) for model in models):
        return None
    numbers = ball.mass, ball.radius, ball.inertia, air.density, air.viscosity, air.buoyancy
    return repr((numbers, air.wind.tolist(), [name_of(model) for model in models]))


def _callees(air: Air) -> Callees:
    """Return the functions of an air that a user wrote."""
    callees: list[tuple[Any, Any, str]] = []
    for name in ("wind", "drag", "lift", "torque"):
        model = getattr(air, name)
        known = model is None or (name != "wind" and is_known(model))
        model = model.function if isinstance(model, WRAPPED) else model
        if callable(model) and not known:
            arguments = (numba.float64,) * (1 if name == "wind" else 2)
            callees.append((model, arguments, f"the air's {name}"))
    return callees


@lru_cache(maxsize=16)
def compiled_rolling(ball: Ball, air: Air, resistance: float, straight: bool) -> Any:
    """Return the rates of many balls that roll, `rolling_acceleration`, as machine code.

    The resistance of the surface is a deceleration [m/s2].
    """
    acting, share = _acceleration(ball, air), rolling_share(ball)
    acceleration = rolling_acceleration(acting, share, resistance, straight)

    def rates(scene: Any, state: Any, rate: Any) -> None:
        for i in range(LANES):
            u, v = state[U + i], state[V + i]
            ax, ay = acceleration(scene[HEIGHT + i], u, v, scene[ALONG_X + i], scene[ALONG_Y + i])
            rate[X + i], rate[Y + i], rate[Z + i] = u, v, 0.0
            rate[U + i], rate[V + i] = ax, ay
            rate[W + i], rate[LEFT + i] = 0.0, 0.0

    key = _constants(ball, air)
    key = key and f"{key} {resistance!r} {straight}"
    return _from_disk(rates, _callees(air), "the equations of motion of a ball that rolls", key)


@lru_cache(maxsize=16)
def compiled_ends(functions: tuple[EventFunction, ...], names: tuple[str, ...]) -> Any:
    """Return the functions of events, with their names, for many flights side by side.

    The machine code fills in the values of all events from their numbers and from the states. A
    function that numba cannot compile raises `InvalidInput`.
    """
    values: Callable[[Any, Any, Any], None] = _no_values
    for k, function in enumerate(functions):
        values = _with_values(values, function, k)
    floats: Any = numba.types.UniTuple
    arguments = floats(numba.float64, 7), floats(numba.float64, NUMBERS)
    callees = [(function, arguments, f"the end {name!r}")
               for function, name in zip(functions, names, strict=True)]  # fmt: skip
    own = all(function.__module__.startswith("kickdyn.") for function in functions)
    key = repr([function.__qualname__ for function in functions]) if own else None
    return _from_disk(values, callees, "the events that end a flight", key)


def _no_values(numbers: Any, state: Any, value: Any) -> None:
    """Fill in the values of no event."""


def _with_values(
    previous: Callable[[Any, Any, Any], None], function: EventFunction, k: int
) -> Callable[[Any, Any, Any], None]:
    """Return a function that fills in the values of k events, and of another one after them."""
    row, first = k * LANES, k * NUMBERS * LANES

    def values(numbers: Any, state: Any, value: Any) -> None:
        previous(numbers, state, value)
        for i in range(LANES):
            moved = state[X + i], state[Y + i], state[Z + i]
            motion = state[U + i], state[V + i], state[W + i], state[LEFT + i]
            a, b = numbers[first + i], numbers[first + LANES + i]
            c, d = numbers[first + 2 * LANES + i], numbers[first + 3 * LANES + i]
            value[row + i] = function(moved + motion, (a, b, c, d))

    return values


def side_by_side(
    acting: Acceleration, straight: Acceleration, reynolds: Reynolds, bound: float
) -> Callable[[Any, Any, Any], None]:
    """Return a function of scene and state that fills in the rates of `LANES` states.

    From the Reynolds number `bound` on, `straight` is the same as the accelerations `acting`, but
    without branches; where they are the same everywhere, the bound is 0.
    """

    def rates(scene: Any, state: Any, rate: Any) -> None:
        for i in range(LANES):
            left = state[LEFT + i]
            ax, ay, az, k = straight(
                scene[HEIGHT + i] + state[Z + i], state[U + i], state[V + i], state[W + i],
                left * scene[SPIN_X + i], left * scene[SPIN_Y + i], left * scene[SPIN_Z + i],
            )  # fmt: skip
            rate[X + i], rate[Y + i] = state[U + i], state[V + i]
            rate[Z + i], rate[U + i] = state[W + i], ax
            rate[V + i], rate[W + i] = ay, az
            rate[LEFT + i] = -k * left * scene[DECAYS + i]
        slow = 0
        for i in range(LANES):
            z = scene[HEIGHT + i] + state[Z + i]
            slow += reynolds(z, state[U + i], state[V + i], state[W + i]) < bound
        if slow == 0:
            return
        for i in range(LANES):
            z, left = scene[HEIGHT + i] + state[Z + i], state[LEFT + i]
            u, v, w = state[U + i], state[V + i], state[W + i]
            is_slow = reynolds(z, u, v, w) < bound
            ax, ay, az, k = acting(
                z, u, v, w,
                left * scene[SPIN_X + i], left * scene[SPIN_Y + i], left * scene[SPIN_Z + i],
            )  # fmt: skip
            rate[U + i] = ax if is_slow else rate[U + i]
            rate[V + i] = ay if is_slow else rate[V + i]
            rate[W + i] = az if is_slow else rate[W + i]
            rate[LEFT + i] = -k * left * scene[DECAYS + i] if is_slow else rate[LEFT + i]

    return rates


def _from_disk(function: Callable[..., Any], callees: Callees, what: str, key: str | None) -> Any:
    """Return a function of three vectors as machine code, read from the disk if it is there.

    The log calls it `what`. Its callees are compiled first, so that errors name them. It is kept on
    the disk if a key says which of kickdyn's own functions and constants it is made of.
    """
    # numba keeps a function by its name and what it closes over: the name says all, and what is
    # called is left out, so that nothing is compiled if the disk has it
    called: dict[str, Any] = {"__builtins__": builtins, "__name__": __name__}
    digest = hashlib.sha256(_sources() + str(key).encode()).hexdigest()[:32]
    twin = types.FunctionType(_call.__code__, called, f"equations_{digest}")
    twin.__qualname__ = twin.__name__
    if key is not None and is_on_disk(twin):
        with suppress(numba.TypingError):  # its files are of no use
            return compiled(twin, SIGNATURE, what, **OPTIONS)
    with uncollected():
        for callee, arguments, callee_name in callees:
            _compile(callee, arguments, callee_name)
        called["function"] = dispatcher = _compile(function, SIGNATURE, what)
    if key is not None:
        dispatcher = compiled(twin, SIGNATURE, what, **OPTIONS)
        if folder := cache_folder(twin):
            with suppress(FileNotFoundError):  # another process was faster
                files = sorted(folder.glob("*.equations_*"), key=lambda file: file.stat().st_mtime)
                for file in files[:-_ON_DISK]:
                    file.unlink()
    return dispatcher


@cache
def _sources() -> bytes:
    """Return the contents of all files that equations are made of, and numba's version."""
    package = Path(__file__).parents[1]
    files = [path for pattern in ("*.py", "aerodynamics/*.py", "flight/*.py", "core/*.py")
             for path in sorted(package.glob(pattern))]  # fmt: skip
    return b"".join([numba.__version__.encode(), *(path.read_bytes() for path in files)])


def _call(scene: Any, state: Any, rate: Any) -> None:
    """Call the global `function` of whatever module this code is put into."""
    function(scene, state, rate)  # noqa: F821


def _compile(function: Callable[..., Any], signature: Any, name: str) -> Any:
    """Return a compiled function; an error shows here, under its name."""
    try:
        if signature is SIGNATURE:
            return numba.njit(signature, **OPTIONS)(_twin(function))
        dispatcher = _callee(function)
        python = dispatcher.py_func
        more = max(python.__code__.co_argcount - len(signature), 0)  # which have defaults
        omitted = (python.__defaults__ or ())[-more:] if more else ()
        dispatcher.compile((*signature, *map(numba.types.Omitted, omitted)))
    except Exception as error:  # numba has no common base for what it cannot do
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        reasons = [line for line in lines if not line.startswith(("Failed in", "During:", "File "))]
        reason = reasons[0] if reasons else type(error).__name__
        raise InvalidInput(
            f"{name} {getattr(function, '__name__', function)!r} cannot be compiled by numba "
            f"({reason}): write it with floats and math only, or call fly for each flight"
        ) from error
    return dispatcher


@lru_cache(maxsize=200)
def _callee(function: Any) -> Any:
    """Return a function that machine code can call."""
    return function if isinstance(function, Dispatcher) else inlined(_twin(function))


def _twin(function: Any) -> types.FunctionType:
    """Return a copy of a Python function for numba, which calls compiled functions only."""
    if not isinstance(function, types.FunctionType):
        raise TypeError(f"a {type(function).__name__} is not a function written in Python")
    cells = (types.CellType(_compilable(cell.cell_contents)) for cell in function.__closure__ or ())
    used = _names(function.__code__) & function.__globals__.keys()
    twin = types.FunctionType(
        function.__code__,
        {"__builtins__": builtins, "__name__": function.__module__}
        | {name: _compilable(function.__globals__[name]) for name in used},
        function.__name__,
        function.__defaults__,
        tuple(cells) or None,
    )
    twin.__kwdefaults__ = function.__kwdefaults__
    # the linker goes by names: of two that are the same, one of them kept by another process, it
    # would take either
    twin.__qualname__ = f"{function.__name__}_{uuid.uuid4().hex}"
    return twin


def _compilable(value: Any) -> Any:
    """Return a constant as it is, and a function compiled, whether kickdyn's or the user's."""
    if value is math:
        return mathematics
    value = value.function if isinstance(value, WRAPPED) else value
    ours = isinstance(value, types.FunctionType) and not value.__module__.startswith("numpy")
    return _callee(value) if ours else value


def _names(code: types.CodeType) -> set[str]:
    inner = (constant for constant in code.co_consts if isinstance(constant, types.CodeType))
    return set(code.co_names).union(*(_names(function) for function in inner))
