"""Tables held against each other bit by bit."""

from __future__ import annotations

import pyarrow as pa


def bits(column: pa.ChunkedArray) -> list[object]:
    """A column's values; numbers by their bits, so that neither rounding nor a NaN hides behind `==`."""
    if pa.types.is_floating(column.type):
        whole = column.combine_chunks()
        raw = whole.fill_null(0.0).to_numpy().view("int64")
        return [int(b) if valid else None for b, valid in zip(raw, whole.is_valid().to_pylist())]
    if pa.types.is_list(column.type):
        return [None if row is None else [repr(item) for item in row] for row in column.to_pylist()]
    return column.to_pylist()


def differing(one: pa.Table, other: pa.Table, without: set[str] = frozenset()) -> list[str]:
    """Names of columns that differ, in name, place, type or one bit."""
    if one.column_names != other.column_names or one.num_rows != other.num_rows:
        return [f"{one.column_names} {one.num_rows}", f"{other.column_names} {other.num_rows}"]
    names = [name for name in one.column_names if name not in without]
    return [
        name
        for name in names
        if str(one[name].type) != str(other[name].type) or bits(one[name]) != bits(other[name])
    ]
