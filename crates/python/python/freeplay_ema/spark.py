"""The nightly run with its logs done on a Spark cluster.

Only the DataFrame API of Spark Connect is used (``spark.range`` and ``mapInArrow``), so that classic Spark,
Databricks serverless and Sail work the same way: no jar, no SparkContext, no RDD. The driver plans and stores, a worker
does one log for each task with one thread; a failed log has a result with its error.

Spark runs a task at least once. An answer counts once, whichever copy arrives; records take the place of those of the
same flight, and a log whose settings are unchanged is known and not done again. Only the driver writes.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import freeplay_ema as fp
from freeplay_ema import Config, RunError, RunSummary, Settings, _freeplay

if TYPE_CHECKING:
    import pyarrow as pa
    from pyspark.sql import SparkSession

__all__ = ["run"]


def run(
    spark: SparkSession,
    logs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None,
    config: Settings,
    output: str | os.PathLike[str] | None = None,
    *,
    logs_per_job: int = 1000,
    redo: bool = False,
    retry: bool = False,
    wait_s: float | None = None,
) -> RunSummary:
    """Does every log that is not accounted for yet, one task for each, and stores what comes of it.

    ``logs`` are patterns that take the place of ``[logs] files``, ``output`` is the store and takes the place of
    ``[store] path``; None leaves the configuration's. The configuration, the tables it names and the logs must be
    readable on driver and workers under the same paths; workers refuse a configuration that differs.

    Up to ``logs_per_job`` logs make one Spark job, and what they gave is stored before the next begins: a driver that
    dies loses at most that, and the next run does it. The summary is that of ``freeplay run --json``.
    """
    settings = fp.load(config)
    if not settings.files:
        raise ValueError("workers read the configuration themselves: give its file, not a text")
    # Absolute paths mean the same to workers; logs below the configuration keep their short names.
    settings = Config(settings.files)
    settings = settings.replaced(_patterns(logs), None if output is None else os.path.abspath(output))
    engine = _engine(spark, settings)
    summary = _freeplay.run_distributed(settings, engine, logs_per_job, redo, retry, wait_s)
    return RunSummary.from_json(summary)


def _patterns(
    logs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None,
) -> list[str] | None:
    if logs is None:
        return None
    several = [logs] if isinstance(logs, (str, os.PathLike)) else logs
    return [os.path.abspath(pattern) for pattern in several]


def _engine(spark: SparkSession, settings: Config) -> Callable[[list[str]], list[str]]:
    """What answers tasks by a Spark job of as many partitions: one log for each task of Spark's."""
    files, digest = tuple(str(file) for file in settings.files), settings.digest()

    def answers(tasks: list[str]) -> list[str]:
        # range() makes exactly one row for each partition; repartition() would put several into some.
        count = len(tasks)
        rows = spark.range(0, count, 1, count).mapInArrow(_worker(files, digest, tasks), "result string")
        results: list[str] = rows.toArrow().column("result").to_pylist()
        return results

    return answers


def _worker(
    files: tuple[str, ...], digest: str, tasks: list[str]
) -> Callable[[Iterable[pa.RecordBatch]], Iterator[pa.RecordBatch]]:
    def work(batches: Iterable[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
        import pyarrow as pa

        from freeplay_ema import _freeplay, spark

        config = spark._same(files, digest)
        for batch in batches:
            results = [_freeplay.process_task(config, tasks[number]) for number in batch.column(0).to_pylist()]
            yield pa.RecordBatch.from_pydict({"result": pa.array(results, pa.string())})

    return work


@lru_cache(maxsize=4)
def _same(files: tuple[str, ...], digest: str) -> Config:
    """The configuration as a worker reads it, which must be the driver's."""
    config = fp.load(files)
    if config.digest() != digest:
        diagnostic = {
            "code": "worker_differs",
            "what": "this worker's configuration, tables or version of Freeplay differ from the driver's",
            "file": files[0],
            "hint": "give driver and workers the same files and the same wheel, then run again",
        }
        text = f"error[{diagnostic['code']}]: {diagnostic['what']}\n  file    {files[0]}\nhint: {diagnostic['hint']}"
        raise RunError(text, json.dumps([diagnostic]))
    return config
