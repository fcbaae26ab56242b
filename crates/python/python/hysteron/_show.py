"""Pages and pictures of answers: matplotlib where it is installed, pages elsewhere."""

from __future__ import annotations

import html
from pathlib import Path
from typing import Any

import numpy as np

# What a picture of a long record is drawn with at most.
MOST_POINTS = 20_000


class Page:
    """A self-contained HTML page. It shows itself in a notebook; `save` writes it."""

    def __init__(self, text: str) -> None:
        self.text = text

    def save(self, path: str | Path) -> None:
        """Writes the page."""
        Path(path).write_text(self.text, encoding="utf-8")

    def __repr__(self) -> str:
        return f"Page of {len(self.text)} characters; .save(path) writes it"

    def _repr_html_(self) -> str:
        # A frame of its own: the page's styles stay inside.
        return f'<iframe srcdoc="{html.escape(self.text)}" style="width:100%;height:600px;border:0"></iframe>'


def _pyplot() -> Any:
    try:
        from matplotlib import pyplot
    except ImportError:
        return None
    return pyplot


def dataset_html(dataset: Any) -> str:
    """A dataset as a table."""
    cells = [
        (r.name, r.role, str(len(r)), f"{r.fs:g}", f"{r.u.min():.3g} to {r.u.max():.3g}", f"{np.ptp(r.y):.4g}")
        for r in dataset
    ]
    head = ("record", "role", "samples", "fs, Hz", "u, V", "y, um peak to peak")
    rows = "".join(_table_row("td", row) for row in cells)
    return f"<table><caption>{html.escape(dataset.name)}</caption>{_table_row('th', head)}{rows}</table>"


def _table_row(tag: str, cells: tuple[str, ...]) -> str:
    return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"


def plot_dataset(dataset: Any) -> Any:
    """Position over voltage and over time, one row a record; without matplotlib a page with the table."""
    pyplot = _pyplot()
    if pyplot is None:
        return Page(f"<!doctype html><title>{html.escape(dataset.name)}</title>{dataset_html(dataset)}")
    figure, axes = pyplot.subplots(
        len(dataset), 2, squeeze=False, figsize=(9, 2.4 * len(dataset)), layout="constrained"
    )
    for record, (loop, time) in zip(dataset, axes):
        step = max(1, len(record) // MOST_POINTS)
        loop.plot(record.u[::step], record.y[::step], linewidth=0.8)
        loop.set(xlabel="voltage, V", ylabel="position, um", title=f"{record.name} ({record.role})")
        time.plot(record.time[::step], record.y[::step], linewidth=0.8)
        time.set(xlabel="time, s", ylabel="position, um")
    return figure


def plot_comparison(comparison: Any) -> Any:
    """Measured and modelled loop, and the error over time, one row a record; without matplotlib the page."""
    pyplot = _pyplot()
    if pyplot is None:
        return comparison.page()
    records, unit = comparison.records, comparison.to_dict()["output_unit"]
    figure, axes = pyplot.subplots(
        len(records), 2, squeeze=False, figsize=(9, 2.6 * len(records)), layout="constrained"
    )
    for record, series, (loop, error) in zip(records, comparison.series, axes):
        step = max(1, len(series["time"]) // MOST_POINTS)
        part = slice(None, None, step)
        loop.plot(series["input"][part], series["measured"][part], linewidth=0.8, label="measured")
        loop.plot(series["input"][part], series["modelled"][part], linewidth=0.8, label="model")
        loop.set(ylabel=unit, title=f"{record['file']} ({record['role']})")
        loop.legend()
        error.plot(series["time"][part], (series["measured"] - series["modelled"])[part], linewidth=0.8)
        error.set(xlabel="time, s", ylabel=f"error, {unit}", title=f"rms {record['rms_um']:.4g} {unit}")
    return figure


def plot_diagnosis(diagnosis: Any) -> Any:
    """What each candidate takes of the squared error; without matplotlib the page."""
    pyplot = _pyplot()
    if pyplot is None:
        return diagnosis.page()
    ranking = diagnosis.ranking[::-1]
    figure, axis = pyplot.subplots(figsize=(7, 1 + 0.3 * len(ranking)), layout="constrained")
    colours = ["tab:red" if effect["significant"] else "lightgrey" for effect in ranking]
    axis.barh([effect["effect"] for effect in ranking], [100 * effect["share"] for effect in ranking], color=colours)
    axis.set(xlabel="share of the squared error, %", title=f"verdict: {diagnosis.verdict}")
    return figure


def plot_ladder(ladder: Any) -> Any:
    """The error of each step above the noise; without matplotlib the page."""
    pyplot = _pyplot()
    if pyplot is None:
        return ladder.page()
    answer = ladder.to_dict()
    judged = [step.get("validate_percent", step.get("identify_percent")) for step in answer["steps"]]
    sign = {"fitted": "", "added": "+ ", "removed": "- "}
    names = [
        "moved by hand" if step["change"] == "moved" else sign[step["change"]] + step["what"]
        for step in answer["steps"]
    ]
    figure, axis = pyplot.subplots(figsize=(7, 1.2 + 0.4 * len(names)), layout="constrained")
    axis.barh(range(len(names)), judged)
    axis.set_yticks(range(len(names)), names)
    axis.invert_yaxis()
    noise = answer["noise_validate_percent"] or answer["noise_identify_percent"]
    if noise:
        axis.axvline(noise, color="tab:red", linestyle="--", label="noise floor")
        axis.legend()
    axis.set(xlabel="error, % of peak to peak", title=answer["dataset"])
    return figure


def plot_learned(learned: Any) -> Any:
    """The ladder; the last diagnosis where no step was kept."""
    return plot_diagnosis(learned.diagnosis) if learned.ladder is None else plot_ladder(learned.ladder)
