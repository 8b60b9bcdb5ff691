"""Rows of a chart: CSV in and out, verdicts from their bounds, and the front of error over time."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

from sim.checkpoint import write_text
from sim.errors import RunError

Row = dict[str, str]
"""Column -> text as the CSV has it; what was not measured is empty."""

FIRST = (
    "id case method spacing dt error bounds seconds_per_simulated_second ok message failure particles steps iterations "
    "peak_memory role report front best precision scene overrides reference version recipe"
).split()
"""Columns of every chart [SI]; figures of the cases follow in the order of their appearance.

bounds   figure<=bound, ...; spread(figure)<=bound is of all rows of the case: its largest value over its least, less 1
failure  why a run ended early; message: that, or what lies beyond its bound; ok: 1 if there is neither
role     check (held to its bounds), sweep (on the chart of error over time)
front    1: nothing else of its case is as right in less time; best: the levels at which it is the cheapest
"""


def blank() -> Row:
    """A row that says nothing yet."""
    return dict.fromkeys(FIRST, "")


def cell(value: float | int) -> str:
    """A number with six digits; what is no number is empty."""
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else ""
    return str(value)


def number(row: Row, column: str) -> float:
    """The number in a cell; nan if it is empty."""
    return float(row[column]) if row.get(column) else math.nan


def read(path: Path) -> list[Row]:
    """Rows of a CSV. RunError if it cannot be read or is no chart."""
    try:
        with open(path, newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, csv.Error) as error:
        raise RunError(f"{path}: cannot read: {error}") from error
    if rows and not set(FIRST) <= set(rows[0]):
        raise RunError(f"{path}: not a chart of this version; remove it, or name another place with --out")
    return rows


def write(path: Path, rows: list[Row]) -> None:
    """All rows, whole or not at all."""
    columns = list(dict.fromkeys([*FIRST, *(name for row in rows for name in row)]))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text.getvalue())


def bounds(row: Row) -> dict[str, float]:
    """figure -> bound."""
    pairs = (text.split("<=") for text in row["bounds"].split())
    return {figure: float(bound) for figure, bound in pairs}


def missed(row: Row) -> list[str]:
    """What lies beyond its bound: "error = 0.13 passes 0.04"; a figure that is no number does too."""
    return [
        f"{figure} = {row.get(figure) or 'nothing'} passes {bound:g}"
        for figure, bound in bounds(row).items()
        if not abs(number(row, figure)) <= bound
    ]


def marked(rows: list[Row], levels: tuple[float, ...]) -> list[Row]:
    """The rows with what follows from them together filled in: spreads, verdicts, `front` and `best`, by case."""
    for case in dict.fromkeys(row["case"] for row in rows):
        of_case = [row for row in rows if row["case"] == case]
        _spread([row for row in of_case if row["bounds"] and not row["failure"]])
        for row in of_case:
            row["message"] = row["failure"] or "; ".join(missed(row))
            row["ok"] = "0" if row["message"] else "1"
            row["front"] = row["best"] = ""
        _front([r for r in of_case if "sweep" in r["role"] and not r["failure"] and r["error"]], levels)
    return rows


def _spread(rows: list[Row]) -> None:
    for name in {name for row in rows for name in bounds(row) if name.startswith("spread(")}:
        values = [number(row, name[7:-1]) for row in rows]
        for row in rows:
            row[name] = cell(max(values) / min(values) - 1.0)


def _front(points: list[Row], levels: tuple[float, ...]) -> None:
    points.sort(key=lambda r: (number(r, "seconds_per_simulated_second"), number(r, "error")))
    least = math.inf
    for row in points:
        if number(row, "error") < least:
            row["front"], least = "1", number(row, "error")
    for level in levels:
        row = next((r for r in points if number(r, "error") <= level), None)
        if row:
            row["best"] = f"{row['best']} {100 * level:g}%".strip()
