"""A chart's rows as text: the table with verdicts, the best choices, a row beside its old self."""

from __future__ import annotations

from sim.errors import MissedError
from sim.studies.table import Row, bounds, number


def text(rows: list[Row]) -> str:
    """The rows as a table, a line each with its verdict."""
    head = ("", "row", "method", "spacing", "dt", "error", "s/s", "")
    lines = [head, *(_line(row) for row in rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(head) - 1)]
    return "\n".join("  ".join([*(c.ljust(w) for c, w in zip(line, widths)), line[-1]]).rstrip() for line in lines)


def verdict(row: Row) -> str:
    """holds (its bounds), MISSED, failed (diverged, or did not fit), or ran (nothing is asked of it)."""
    if row["failure"]:
        return "failed"
    return "MISSED" if row["message"] else "holds" if row["bounds"] else "ran"


def _line(row: Row) -> tuple[str, ...]:
    held = ", ".join(f"{f} {row.get(f) or 'none'} (<= {b:g})" for f, b in bounds(row).items() if f != "error")
    bound = bounds(row).get("error")
    error = _percent(number(row, "error")) if row["error"] else ""
    return (
        verdict(row),
        row["id"],
        row["method"] + (" (the report's)" if row["report"] else ""),
        f"{1e3 * number(row, 'spacing'):.3g} mm" if row["spacing"] else "",
        f"{1e3 * number(row, 'dt'):.3g} ms" if row["dt"] else "",
        error + (f" (<= {_percent(bound)})" if bound is not None else ""),
        f"{number(row, 'seconds_per_simulated_second'):.3g}" if row["seconds_per_simulated_second"] else "",
        row["failure"] or held,
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g}%"


def hold(topic: str, rows: list[Row]) -> None:
    """MissedError that names row, figure, value and bound, if a row that has bounds does not hold."""
    wrong = [row for row in rows if row["bounds"] and row["ok"] != "1"]
    if wrong:
        more = f" (and {len(wrong) - 1} more rows)" if len(wrong) > 1 else ""
        raise MissedError(f"chart {topic}: {wrong[0]['id']}: {wrong[0]['message']}{more}")


def choices(rows: list[Row], levels: tuple[float, ...]) -> str:
    """The best choice of each swept case at each level, a line each."""
    lines = []
    for case in dict.fromkeys(row["case"] for row in rows if "sweep" in row["role"]):
        for level in levels:
            mark = f"{100 * level:g}%"
            best = next((r for r in rows if r["case"] == case and mark in r["best"].split()), None)
            lines.append(f"{case} to {mark}: {_choice(best) if best else 'none of these'}")
    return "\n".join(lines)


def _choice(row: Row) -> str:
    dt, seconds = number(row, "dt"), number(row, "seconds_per_simulated_second")
    return (
        f"{row['method']}, spacing {1e3 * number(row, 'spacing'):.3g} mm, dt {1e3 * dt:.3g} ms, {seconds:.3g} s per "
        f"simulated second (error {number(row, 'error'):.2%}; {row['id']})"
    )


def compared(old: Row | None, new: Row) -> str:
    """Every number of a row that was run again, beside the one in the CSV."""
    names = [n for n in new if n not in ("spacing", "report", "front", "best") and _is_number(new[n])]
    lines = [("", "now", "in the CSV", "")]
    for name in names:
        before = (old or {}).get(name, "")
        change = ""
        if before and float(before):
            change = f"{float(new[name]) / float(before) - 1.0:+.1%}"
        lines.append((name, new[name], before, change))
    widths = [max(len(line[k]) for line in lines) for k in range(4)]
    return "\n".join("  ".join(c.ljust(w) for c, w in zip(line, widths)).rstrip() for line in lines)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
