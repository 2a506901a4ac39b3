"""`tagtrack eval messages`: what talking is worth to a fleet, by how much is lost, how seldom and how often vehicles talk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.sim.modem import TdmaModem
from tagtrack.envs.task import Task
from tagtrack.eval.cells.engine import Engine
from tagtrack.eval.cells.options import EngineOptions
from tagtrack.eval.comparison import compare
from tagtrack.eval.options import EpisodeOptions, TaskOptions
from tagtrack.eval.plots import empty_figure, error_bars, save_figure
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.report import as_console_table, as_markdown, interval_cell, show, write_json, write_text
from tagtrack.eval.results_folder import default_folder, replace_results, require_replaceable
from tagtrack.eval.statistics.estimate import Interval
from tagtrack.eval.versions import collect_versions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OWN_FILES = ("messages.json", "messages.md", "messages.png")
BOUNDS = ("none", "perfect")
Points = dict[str, Mapping[str, Interval]]  # label -> figures


@dataclass(frozen=True, kw_only=True)
class Messages:
    """Draw the error of a fleet that talks in slots (modem tdma) against message loss, slot length and number of messages.

    Beside it stand the same fleet with no modem at all and with a perfect one.
    """

    task: TaskOptions = field(default_factory=lambda: TaskOptions(env="TagTrack/RangeOnly-v0", vehicles=3, modem="tdma"))
    policy: str = "circle"
    """Baseline or folder of a run that steers."""
    losses: Annotated[tuple[float, ...], tyro.conf.arg(metavar="X ...")] = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9)
    """Chances that a packet is lost, at any distance."""
    slots: Annotated[tuple[float, ...], tyro.conf.arg(metavar="X ...")] = (1, 2, 5, 10, 20, 60)
    """Lengths of a slot [s]."""
    trial: EpisodeOptions = field(default_factory=lambda: EpisodeOptions(episodes=128))
    engine: EngineOptions = field(default_factory=EngineOptions)
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(runs/messages-ID-TIME)")] = None
    """Folder to write; an earlier one of this command is replaced."""

    def run(self) -> None:
        """Run it."""
        self.trial.check()
        self.engine.check()
        if not (self.losses and self.slots):
            raise ValueError("name at least one of --losses and one of --slots")
        task, env_id = self.task.build(), self.task.env_id
        if not isinstance(task.scenario.modem, TdmaModem):
            raise ValueError(f"--modem {self.task.modem} talks in no slots, which this command varies; drop it")
        if task.scenario.vehicles < 2:
            raise ValueError(f"a vehicle alone has nobody to talk to, got --vehicles {task.scenario.vehicles}; take 2 to 20")
        out = self.out or default_folder("messages", env_id)
        require_replaceable(out, OWN_FILES, "sweep of messages")
        variants = self.variants()
        with self.engine.open() as engine:
            found = self.sweep(task, variants, engine)
            fleet = {"vehicles": task.scenario.vehicles, "tags": task.scenario.targets}
            document = self.document(found, {**self.task.describe(task), **fleet, "versions": collect_versions()})
            table = message_rows(document)
            show(as_console_table(*table))
            with replace_results(out, OWN_FILES) as folder:
                write_json(folder / "messages.json", document)
                write_text(folder / "messages.md", as_markdown(*table))
                save_figure(folder / "messages.png", plot_messages(found, self.losses, self.slots))
        print(f"written: {out}")

    def sweep(self, task: Task, variants: Mapping[str, Mapping[str, Any]], engine: Engine) -> Points:
        """The figures of each fleet."""
        found: Points = {}
        trial = self.trial
        with progress_bar(len(variants) * trial.episodes * task.scenario.episode_steps) as advance:
            for label, changes in variants.items():
                comparison = compare(
                    task._replace(scenario=with_overrides(task.scenario, changes)),
                    {label: self.policy},
                    episodes=trial.episodes,
                    seed=trial.seed,
                    threads=trial.threads,
                    env_id=self.task.env_id,
                    engine=engine,
                    on_step=advance,
                )
                found[label] = comparison.summaries[label]
        return found

    def variants(self) -> dict[str, dict[str, Any]]:
        """The fleets to compare, as overrides by their labels."""
        loss = {f"loss {x:g}": {"modem.loss": x, "modem.loss_at_range": x} for x in self.losses}
        slot = {f"slot {x:g} s": {"modem.slot": x} for x in self.slots}
        return {**{name: {"modem": name} for name in BOUNDS}, **loss, **slot}

    def document(self, found: Points, asked: Mapping[str, Any]) -> dict[str, Any]:
        """What messages.json holds."""
        figures = {label: {name: figure.to_json() for name, figure in each.items()} for label, each in found.items()}
        return {**asked, "policy": self.policy, "episodes": self.trial.episodes, "seed": self.trial.seed, "fleets": figures}


def message_rows(document: Mapping[str, Any]) -> tuple[list[str], list[list[str]], str]:
    """Header, rows and note of the table."""
    header = ["modem", "mean error [m]", "messages [1/h]"]
    rows = [
        [label, interval_cell(each["mean_error_m"]), f"{each['messages_per_hour']['value']:.0f}"]
        for label, each in document["fleets"].items()
    ]
    note = (
        f"{document['policy']} on {document['episodes']} paired episodes of {document['env']}, {document['vehicles']} vehicles, "
        f"{document['tags']} tags, seed {document['seed']}, {document['particles']} particles; in brackets 95 % bootstrap "
        "intervals over episodes. Unless it is varied, a slot lasts 10 s and 10 to 50 % of the packets are lost, by distance."
    )
    return header, rows, note


def plot_messages(found: Points, losses: tuple[float, ...], slots: tuple[float, ...]) -> Figure:
    """Mean error against loss, slot length and number of messages, with no modem and a perfect one as lines across."""
    figure, all_axes = empty_figure(width=11.0, height=3.8, columns=3)
    by_loss = [found[f"loss {x:g}"] for x in losses]
    by_slot = [found[f"slot {x:g} s"] for x in slots]
    sent = [each["messages_per_hour"].value for each in by_slot]
    panels = ((losses, by_loss, "packets lost, share"), (slots, by_slot, "slot [s]"), (sent, by_slot, "messages [1/h]"))
    for axes, (places, points, title) in zip(all_axes, panels, strict=True):
        error, reach = error_bars([each["mean_error_m"] for each in points])
        axes.errorbar(places, error, reach, marker="o", ms=5, lw=1.4, elinewidth=0.8, label="in slots")
        for name, style in zip(BOUNDS, (":", "--"), strict=True):
            axes.axhline(found[name]["mean_error_m"].value, ls=style, color="0.4", lw=1.2, label=f"modem {name}")
        axes.set(xlabel=title, ylim=(0, None))
        if "share" not in title:
            axes.set_xscale("log")
    all_axes[0].set(ylabel="mean localization error [m]")
    all_axes[0].legend(frameon=False, fontsize=8)
    return figure
