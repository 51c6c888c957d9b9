"""Compares docs/dashboards with the models of Grafana and Prometheus."""

import json
import re

import grafana_foundation_sdk.cog.plugins as plugins
import promql_parser
import yaml
from grafana_foundation_sdk.cog.encoder import JSONEncoder
from grafana_foundation_sdk.models.dashboard import Dashboard

FOLDER = "docs/dashboards"


def lost(given, kept, place: str = "") -> list[str]:
    """What Grafana's model does not keep as it is given."""
    if isinstance(given, dict) and isinstance(kept, dict):
        keys = [key for key in given if key not in kept]
        found = [f"{place}/{key} is not a key" for key in keys]
        return found + [text for key in given if key in kept for text in lost(given[key], kept[key], f"{place}/{key}")]
    if isinstance(given, list) and isinstance(kept, list) and len(given) == len(kept):
        return [text for at, pair in enumerate(zip(given, kept)) for text in lost(*pair, f"{place}[{at}]")]
    return [] if given == kept else [f"{place} is {given!r}, kept as {kept!r}"]


def check_panels(panels: list[dict]) -> None:
    """Identifiers are unique, no panel overlaps another on a grid of 24 columns, and each target asks for one metric of the
    chosen data source and machine."""
    assert len({panel["id"] for panel in panels}) == len(panels)
    taken: set[tuple[int, int]] = set()
    for panel in panels:
        x, y, w, h = (panel["gridPos"][key] for key in "xywh")
        cells = {(column, row) for column in range(x, x + w) for row in range(y, y + h)}
        assert cells and x + w <= 24 and not cells & taken, panel["title"]
        taken |= cells
        targets = panel["targets"]
        assert len({target["refId"] for target in targets}) == len(targets), panel["title"]
        for target in targets:
            assert target["datasource"]["uid"] == "${datasource}", panel["title"]
            assert len(re.findall(r'freeplay_\w+{instance=~"\$instance"}', target["expr"])) == 1, target["expr"]


def dashboard() -> list[str]:
    """The dashboard survives Grafana's model; its expressions."""
    plugins.register_default_plugins()
    with open(f"{FOLDER}/grafana.json") as file:
        given = json.load(file)
    kept = json.loads(json.dumps(Dashboard.from_json(given), cls=JSONEncoder))
    assert lost(given, kept) == [], lost(given, kept)
    assert [variable["name"] for variable in given["templating"]["list"]] == ["datasource", "instance"]
    check_panels(given["panels"])
    return [target["expr"].replace("$instance", ".*") for panel in given["panels"] for target in panel["targets"]]


def rules() -> list[str]:
    """The rules have the keys of Prometheus' rule files; their expressions."""
    with open(f"{FOLDER}/prometheus-rules.yml") as file:
        groups = yaml.safe_load(file)["groups"]
    found = [rule for group in groups for rule in group["rules"]]
    assert all(set(rule) <= {"alert", "expr", "for", "labels", "annotations"} for rule in found)
    assert all(set(rule["annotations"]) == {"summary", "remedy"} and rule["labels"].keys() == {"severity"} for rule in found)
    return [rule["expr"] for rule in found]


expressions = dashboard() + rules()
for expression in expressions:
    promql_parser.parse(expression)
print(f"{len(expressions)} expressions, and the dashboard as Grafana's model keeps it")
