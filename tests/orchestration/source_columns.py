"""Columns of the dbt source against docs/columns.md; with FREEPLAY_BLESS=1, writes them."""

import json
import os
import re
import sys
from pathlib import Path

PAGE = Path("docs/columns.md")
SOURCES = Path("docs/orchestration/dbt/models/sources.yml")
BEGIN, END = "          # columns of records, from docs/columns.md\n", "          # end\n"


def documented() -> str:
    """Columns of the records on the page, as YAML."""
    table = PAGE.read_text(encoding="utf-8").split("<!-- columns of records -->")[1].split("<!-- end -->")[0]
    rows = re.findall(r"^\| (`[^|]+`) \| [^|]+ \| (.+) \|$", table, re.MULTILINE)
    columns = [(name, meaning) for names, meaning in rows for name in re.findall(r"`(\w+)`", names)]
    text = "".join(
        f"          - name: {name}\n            description: {json.dumps(meaning, ensure_ascii=False)}\n"
        for name, meaning in columns
    )
    assert len(columns) > 30, f"{PAGE} has {len(columns)} columns of records"
    return text


def main() -> None:
    before, rest = SOURCES.read_text(encoding="utf-8").split(BEGIN)
    columns, after = rest.split(END)
    if os.environ.get("FREEPLAY_BLESS") == "1":
        SOURCES.write_text(before + BEGIN + documented() + END + after, encoding="utf-8")
    elif columns != documented():
        sys.exit(f"{SOURCES} differs from {PAGE}; write it again with FREEPLAY_BLESS=1 python3 {sys.argv[0]}")


if __name__ == "__main__":
    main()
