"""What a table is to Arrow."""

from __future__ import annotations

from typing import Protocol


class ArrowStream(Protocol):
    """Any table of pyarrow, Polars, pandas, DuckDB or Freeplay: it gives its rows as an Arrow stream."""

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object: ...
