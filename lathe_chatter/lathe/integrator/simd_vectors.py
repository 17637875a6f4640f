"""Eight steps at once: eight numbers that a processor adds or multiplies as one.

Steps in which nothing happens are alike, so all but their recursion is done for a block of them:
step k of the block is lane k. Each lane has the bits that its step would have by itself, hence
it does not matter how a run is cut into blocks.

`fma` is a b + c rounded once, by the processor or by the C library, with the same bits from both.

These are LLVM's vectors, so nothing depends on what a compiler makes of a loop. What each function
does stands in simd_vectors_in_python.py.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

from lathe_chatter.lathe.integrator import simd_vectors_in_python as plain

LANES = plain.LANES
_DOUBLE, _INT = ir.DoubleType(), ir.IntType(64)
_UNALIGNED = 8
_EMPTY = ir.Constant(ir.VectorType(_DOUBLE, LANES), ir.Undefined)


class _Vector(types.Type):  # type: ignore[misc]  # Numba has no types
    """Numbers, or whether something is so, in eight lanes."""

    def __init__(self, name: str, part: ir.Type) -> None:
        super().__init__(name)
        self.vector = ir.VectorType(part, LANES)


_NUMBERS, _MASK = _Vector('Lanes', _DOUBLE), _Vector('Mask', ir.IntType(1))


@register_model(_Vector)
class _Model(models.PrimitiveModel):  # type: ignore[misc]  # Numba has no types
    def __init__(self, manager: Any, numba_type: _Vector) -> None:
        super().__init__(manager, numba_type, numba_type.vector)


def _constant(values: Any) -> ir.Constant:
    return ir.Constant(ir.VectorType(_DOUBLE, LANES), [ir.Constant(_DOUBLE, v) for v in values])


def _shuffled(builder: Any, one: Any, other: Any, places: Any) -> Any:
    mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), list(places))
    return builder.shuffle_vector(one, other, mask)


def _part(builder: Any, lanes: Any, k: int) -> Any:
    return builder.extract_element(lanes, ir.Constant(ir.IntType(32), k))


def _with_part(builder: Any, lanes: Any, value: Any, k: int) -> Any:
    return builder.insert_element(lanes, value, ir.Constant(ir.IntType(32), k))


def _in_all(builder: Any, kind: Any, value: Any) -> Any:
    """A value of a Numba type as lanes."""
    if kind is _NUMBERS or kind is _MASK:
        return value
    first = _with_part(builder, _EMPTY, value, 0)
    return _shuffled(builder, first, _EMPTY, [0] * LANES)


def _lanes_of(builder: Any, signature: Any, values: Any) -> list[Any]:
    """All arguments of a function as lanes."""
    return [_in_all(builder, k, value) for k, value in zip(signature.args, values, strict=True)]


def _called(builder: Any, name: str, values: Any) -> Any:
    """What a function of LLVM makes of lanes, or of numbers."""
    kind = values[0].type
    name = f'llvm.{name}.{f"v{LANES}f64" if isinstance(kind, ir.VectorType) else "f64"}'
    of = ir.FunctionType(kind, [kind] * len(values))
    return builder.call(cgutils.get_or_insert_function(builder.module, of, name), values)


def _fma(builder: Any, a: Any, b: Any, c: Any) -> Any:
    return _called(builder, 'fma', [a, b, c])


def _row(context: Any, builder: Any, kind: Any, array: Any, row: Any) -> Any:
    """A pointer to the first number of a row."""
    parts = context.make_array(kind)(context, builder, array)
    stride = cgutils.unpack_tuple(builder, parts.strides, kind.ndim)[0]
    return cgutils.pointer_add(builder, parts.data, builder.mul(row, stride))


def _place(context: Any, builder: Any, kind: Any, array: Any, row: Any, column: Any) -> Any:
    """A pointer to eight numbers of a row."""
    pointer = builder.gep(_row(context, builder, kind, array, row), [column])
    return builder.bitcast(pointer, ir.VectorType(_DOUBLE, LANES).as_pointer())


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _load(_typing: Any, rows: Any, row: Any, column: Any) -> Any:  # noqa: ARG001
    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pointer = _place(context, builder, signature.args[0], *values)
        return builder.load(pointer, align=_UNALIGNED)

    return _NUMBERS(rows, types.intp, types.intp), emit


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _store(_typing: Any, rows: Any, row: Any, column: Any, value: Any) -> Any:  # noqa: ARG001
    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pointer = _place(context, builder, signature.args[0], *values[:3])
        stored = _in_all(builder, signature.args[3], values[3])
        builder.store(stored, pointer, align=_UNALIGNED)
        return context.get_dummy_value()

    kept = _NUMBERS if value is _NUMBERS else types.float64
    return types.void(rows, types.intp, types.intp, kept), emit


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _store_samples(_typing: Any, rows: Any, row: Any, values: Any) -> Any:  # noqa: ARG001
    def emit(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        lines = cgutils.unpack_tuple(builder, given[2], LANES)
        # A transposition: pairs of lines exchange halves, quarters and eighths.
        for width in (1, 2, 4):
            turned = list(lines)
            for k in range(LANES):
                if k & width:
                    continue
                one, other = lines[k], lines[k | width]
                places = range(LANES)
                turned[k] = _shuffled(
                    builder, one, other,
                    [p if not p & width else LANES + (p ^ width) for p in places],
                )  # fmt: skip
                turned[k | width] = _shuffled(
                    builder, one, other,
                    [p ^ width if not p & width else LANES + p for p in places],
                )  # fmt: skip
            lines = turned
        column = ir.Constant(_INT, 0)
        for k, line in enumerate(lines):
            row = builder.add(given[1], ir.Constant(_INT, k))
            pointer = _place(context, builder, signature.args[0], given[0], row, column)
            builder.store(line, pointer, align=_UNALIGNED)
        return context.get_dummy_value()

    return types.void(rows, types.intp, types.UniTuple(_NUMBERS, LANES)), emit


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _spread(_typing: Any, value: Any) -> Any:  # noqa: ARG001
    def emit(_context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return _in_all(builder, signature.args[0], values[0])

    return _NUMBERS(types.float64), emit


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _six(
    _typing: Any, a: Any, b: Any, c: Any, d: Any, e: Any, f: Any  # noqa: ARG001
) -> Any:  # fmt: skip
    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        lanes = _constant([0.0] * LANES)
        for k, value in enumerate(values):
            lanes = _with_part(builder, lanes, value, k)
        return lanes

    return _NUMBERS(*[types.float64] * 6), emit


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _floored(_typing: Any, value: Any) -> Any:
    kind = value if value is _NUMBERS else types.float64

    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return _called(builder, 'floor', values)

    return kind(kind), emit


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _chosen(_typing: Any, which: Any, a: Any, b: Any) -> Any:
    result = _NUMBERS if which is _MASK else types.float64
    kinds = [kind if kind is _NUMBERS else types.float64 for kind in (a, b)]

    def emit(_context: Any, builder: Any, signature: Any, values: Any) -> Any:
        if result is _NUMBERS:
            values = _lanes_of(builder, signature, values)
        return builder.select(*values)

    return result(_MASK if which is _MASK else types.boolean, *kinds), emit


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _gathered(_typing: Any, rows: Any, row: Any, columns: Any) -> Any:  # noqa: ARG001
    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        array, row, columns = values
        lanes = _EMPTY
        begin = _row(context, builder, signature.args[0], array, row)
        for k in range(LANES):
            column = builder.fptosi(_part(builder, columns, k), _INT)
            value = builder.load(builder.gep(begin, [column]))
            lanes = _with_part(builder, lanes, value, k)
        return lanes

    return _NUMBERS(rows, types.intp, _NUMBERS), emit


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _counted(_typing: Any, first: Any) -> Any:  # noqa: ARG001
    def emit(_context: Any, builder: Any, signature: Any, values: Any) -> Any:
        every = _in_all(builder, signature.args[0], values[0])
        return builder.fadd(every, _constant(map(float, range(LANES))))

    return _NUMBERS(types.float64), emit


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _after(_typing: Any, first: Any, lanes: Any) -> Any:  # noqa: ARG001
    def emit(_context: Any, builder: Any, signature: Any, values: Any) -> Any:
        every = _in_all(builder, signature.args[0], values[0])
        return _shuffled(builder, values[1], every, [LANES, *range(LANES - 1)])

    return _NUMBERS(types.float64, _NUMBERS), emit


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _before(_typing: Any, lanes: Any) -> Any:  # noqa: ARG001
    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return _shuffled(builder, values[0], values[0], [*range(1, LANES), LANES - 1])

    return _NUMBERS(_NUMBERS), emit


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _lane(_typing: Any, lanes: Any, k: Any) -> Any:  # noqa: ARG001
    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return builder.extract_element(*values)

    return types.float64(_NUMBERS, types.intp), emit


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _fused(_typing: Any, a: Any, b: Any, c: Any) -> Any:
    kinds = [kind if kind is _NUMBERS else types.float64 for kind in (a, b, c)]
    result = _NUMBERS if _NUMBERS in kinds else types.float64

    def emit(_context: Any, builder: Any, signature: Any, values: Any) -> Any:
        if result is _NUMBERS:
            values = _lanes_of(builder, signature, values)
        return _fma(builder, *values)

    return result(*kinds), emit


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _first_of(_typing: Any, mask: Any) -> Any:  # noqa: ARG001
    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        bits = builder.zext(builder.bitcast(values[0], ir.IntType(LANES)), _INT)
        ended = builder.or_(bits, ir.Constant(_INT, 1 << LANES))
        return builder.cttz(ended, ir.Constant(ir.IntType(1), 1))

    return types.intp(_MASK), emit


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _total(_typing: Any, lanes: Any) -> Any:  # noqa: ARG001
    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        lanes = values[0]
        for width in (4, 2, 1):
            lanes = builder.fadd(lanes, _shuffled(builder, lanes, lanes, [
                (k + width) % LANES for k in range(LANES)
            ]))  # fmt: skip
        return _part(builder, lanes, 0)

    return types.float64(_NUMBERS), emit


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _powers(_typing: Any, x: Any) -> Any:  # noqa: ARG001
    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        x = values[0]
        square = builder.fmul(x, x)
        fourth = builder.fmul(square, square)
        low = [x, square, builder.fmul(square, x), fourth]
        lanes = _EMPTY
        for k in range(LANES):
            value = low[k] if k < 4 else builder.fmul(low[k - 4], fourth)
            lanes = _with_part(builder, lanes, value, k)
        return lanes

    return _NUMBERS(types.float64), emit


@intrinsic  # type: ignore[untyped-decorator]  # Numba
def _turned_on(
    _typing: Any, own: Any, partner: Any, back: Any, own_of_partner: Any, pushes: Any,  # noqa: ARG001
    others: Any, x: Any, y: Any,  # noqa: ARG001
) -> Any:  # fmt: skip
    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        own, partner, back, other_own, pushes, others, x, y = values
        xs = ys = _EMPTY
        for k in range(LANES):
            push, other = _part(builder, pushes, k), _part(builder, others, k)
            moved = _fma(builder, partner, y, _fma(builder, own, x, push))
            y = _fma(builder, back, x, _fma(builder, other_own, y, other))
            x = moved
            xs, ys = _with_part(builder, xs, x, k), _with_part(builder, ys, y, k)
        return cgutils.pack_array(builder, [xs, ys])

    numbers = [types.float64] * 4 + [_NUMBERS] * 2 + [types.float64] * 2
    return types.UniTuple(_NUMBERS, 2)(*numbers), emit


def _choice(sign: str) -> Any:
    """The one of two that compares so to the other: of two lanes, or of lanes and a number."""

    @intrinsic  # type: ignore[untyped-decorator]  # Numba
    def code(_typing: Any, a: Any, b: Any) -> Any:
        kinds = [kind if isinstance(kind, _Vector) else types.float64 for kind in (a, b)]

        def emit(_context: Any, builder: Any, signature: Any, values: Any) -> Any:
            one, other = _lanes_of(builder, signature, values)
            return builder.select(builder.fcmp_ordered(sign, one, other), one, other)

        return _NUMBERS(*kinds), emit

    return code


_OPERATORS = {
    operator.add: (lambda builder, a, b: builder.fadd(a, b), _NUMBERS),
    operator.sub: (lambda builder, a, b: builder.fsub(a, b), _NUMBERS),
    operator.mul: (lambda builder, a, b: builder.fmul(a, b), _NUMBERS),
    operator.truediv: (lambda builder, a, b: builder.fdiv(a, b), _NUMBERS),
    operator.lt: (lambda builder, a, b: builder.fcmp_ordered('<', a, b), _MASK),
    operator.gt: (lambda builder, a, b: builder.fcmp_ordered('>', a, b), _MASK),
    operator.le: (lambda builder, a, b: builder.fcmp_ordered('<=', a, b), _MASK),
    operator.eq: (lambda builder, a, b: builder.fcmp_ordered('==', a, b), _MASK),
    operator.and_: (lambda builder, a, b: builder.and_(a, b), _MASK),
    operator.or_: (lambda builder, a, b: builder.or_(a, b), _MASK),
}


def _give_operator(function: Any, emit: Callable[[Any, Any, Any], Any], result: Any) -> None:
    """Let an operator take two lanes, or lanes and a number; as `overload`, at no compilation."""

    @type_callable(function)  # type: ignore[untyped-decorator]  # Numba
    def _typed(_context: Any) -> Any:
        def kind(a: Any, b: Any) -> Any:
            return result if isinstance(a, _Vector) or isinstance(b, _Vector) else None

        return kind

    def lowered(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        given = [
            value
            if isinstance(kind, _Vector)
            else context.cast(builder, value, kind, types.float64)
            for kind, value in zip(signature.args, values, strict=True)
        ]
        return emit(builder, *_lanes_of(builder, signature, given))

    for kinds in ((_Vector, _Vector), (_Vector, types.Number), (types.Number, _Vector)):
        lower_builtin(function, *kinds)(lowered)


for _operator, (_emit, _result) in _OPERATORS.items():
    _give_operator(_operator, _emit, _result)


@type_callable(operator.neg)  # type: ignore[untyped-decorator]  # Numba
def _negative(_context: Any) -> Any:
    def kind(a: Any) -> Any:
        return a if a is _NUMBERS else None

    return kind


@lower_builtin(operator.neg, _Vector)  # type: ignore[untyped-decorator]  # Numba
def _negated(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
    return builder.fmul(values[0], _constant([-1.0] * LANES))


lanes_at, put, put_samples = _load, _store, _store_samples
spread, six, counted, after, before = _spread, _six, _counted, _after, _before
lane, fma, first_of, turned_on = _lane, _fused, _first_of, _turned_on
total, powers, floored, chosen, gathered = _total, _powers, _floored, _chosen, _gathered
smaller, larger = _choice('<'), _choice('>')
if numba.config.DISABLE_JIT:
    globals().update((name, each) for name, each in vars(plain).items() if callable(each))
