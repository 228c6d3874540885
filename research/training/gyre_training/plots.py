"""Plots as SVG."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("svg")
# Deterministic files.
matplotlib.rcParams |= {"svg.hashsalt": "gyre", "svg.fonttype": "none", "axes.grid": True, "grid.alpha": 0.3, "font.size": 9}

from matplotlib import pyplot  # noqa: E402
from matplotlib.ticker import LogLocator, NullFormatter  # noqa: E402

from .results import Candidate, Measurement  # noqa: E402
from .train import load  # noqa: E402

PANEL_INCHES = (4.6, 3.4)


def panels(count: int) -> tuple[pyplot.Figure, Sequence[pyplot.Axes]]:
    """Returns a figure with panels side by side."""
    width, height = PANEL_INCHES
    return pyplot.subplots(1, count, figsize=(count * width, height), layout="constrained")


def save(figure: pyplot.Figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={"Date": None})
    pyplot.close(figure)


def step_times(measurements: list[Measurement], limit_mib: float, path: Path) -> None:
    """Plots time and memory of a training step over batch size (Weston et al., Fig. 2); a cross marks a batch above the
    memory limit."""
    figure, (time, memory) = panels(2)
    for method in dict.fromkeys(one.method for one in measurements):
        ours = [one for one in measurements if one.method == method]
        timed = [one for one in ours if one.fits]
        (line,) = time.plot([one.batch for one in timed], [one.step_s for one in timed], "o-", label=method)
        known = [one for one in ours if one.memory_mib]
        memory.plot([one.batch for one in known], [one.memory_mib / 1024 for one in known], "-", color=line.get_color())
        for one in known:
            memory.plot(one.batch, one.memory_mib / 1024, "o" if one.fits else "x", color=line.get_color())
    memory.axhline(limit_mib / 1024, color="0.4", linestyle="--", linewidth=1)
    for axes, label in ((time, "training step, s"), (memory, "peak memory, GiB")):
        axes.set_xscale("log", base=2)
        axes.set_yscale("log")
        axes.xaxis.set_major_formatter(lambda batch, _: f"{batch:g}")
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.set_xlabel("batch")
        axes.set_ylabel(label)
    time.legend()
    save(figure, path)


def speed_and_drift(candidates: Sequence[Candidate], path: Path) -> None:
    """Plots drift over inference time: hollow markers in floats, filled ones in integers, a line for each network."""
    figure, axes = panels(2)
    for name in dict.fromkeys(one.name for one in candidates):
        ours = [one for one in candidates if one.name == name]
        for panel, error in zip(axes, ("translation_percent", "rotation_deg_per_100m")):
            places = [(one.pair_ms, getattr(one.drift, error)) for one in ours]
            (line,) = panel.plot(*zip(*places), "-", linewidth=1, label=name)
            for one, place in zip(ours, places):
                panel.plot(*place, "o", color=line.get_color(), fillstyle="full" if one.numbers == "integers" else "none")
    for panel, label in zip(axes, ("translation, %", "rotation, deg/100 m")):
        panel.set(xscale="log", yscale="log", xlabel="masks of a pair, ms on one thread", ylabel=label)
        for axis in (panel.xaxis, panel.yaxis):
            axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.set_major_formatter(lambda value, _: f"{value:g}")
            axis.set_minor_formatter(NullFormatter())
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right upper")
    save(figure, path)


def training_log(folder: Path) -> Path:
    """Plots `log.csv` of a run as `log.svg` (loss, validation drift and learning rate over epochs) and returns its path."""
    with (folder / "log.csv").open(newline="") as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    columns = {key: [row[key] for row in rows] for key in rows[0]}
    figure, (loss, drift, rate) = panels(3)
    epochs = columns["epoch"]
    loss.plot(epochs, columns["loss"], ".-")
    drift.plot(epochs, columns["translation_percent"], ".-", label="translation, %")
    drift.plot(epochs, columns["rotation_deg_per_100m"], ".-", label="rotation, deg/100 m")
    if (folder / "best.pt").exists():
        best = columns["step"].index(load(folder / "best.pt")["step"])
        kept = {"label": f"epoch {epochs[best]:.0f} is kept", "color": "black", "fillstyle": "none"}
        drift.plot(epochs[best], columns["translation_percent"][best], "o", **kept)
    drift.set_ylim(bottom=0)
    drift.legend()
    rate.plot(epochs, columns["learning_rate"], ".-")
    for axes, label in ((loss, "loss"), (drift, "validation drift"), (rate, "learning rate")):
        axes.set_xlabel("epoch")
        axes.set_ylabel(label)
        axes.xaxis.get_major_locator().set_params(integer=True)
    path = folder / "log.svg"
    save(figure, path)
    return path
