"""`tagtrack eval array simulate`: the estimators on simulated pings beside the bound (Masmitja et al. 2020, Figs. 2, S1, S2)."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import tyro

from tagtrack.eval.field.array.monte_carlo import PLACES, repeat, summarize
from tagtrack.eval.field.array.plots import plot_bound, plot_rmse, plot_rmse_over_time, plot_time
from tagtrack.eval.field.array.scene import PAPER_DELAY, PAPER_STEP, Noise, Scene, paper_path, place_receivers, swim
from tagtrack.eval.field.static_array.maximum_likelihood import maximum_likelihood
from tagtrack.eval.field.static_array.model import ArraySetting
from tagtrack.eval.field.static_array.printed_filter import printed_particle_filter
from tagtrack.eval.field.static_array.registry import METHODS, Estimator
from tagtrack.eval.plots import save_figure
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.report import as_console_table, as_markdown, interval_cell, show, write_json, write_text
from tagtrack.eval.results_folder import default_folder, replace_results, require_replaceable
from tagtrack.eval.versions import collect_versions

# As the paper has them: its ML descends from one start and is caught at receivers, its particle filter has 6,000 particles and no
# way to reach a likelihood narrower than they stand. Those of METHODS mend both.
CONTESTANTS: Mapping[str, Estimator] = {
    **METHODS,
    "ml_one_start": partial(maximum_likelihood, starts=1),
    "pf_printed": printed_particle_filter,
}

OWN_FILES = ("simulation.json", "table.md", "rmse.png", "rmse_over_time.png", "bound.png", "time.png")


@dataclass(frozen=True, kw_only=True)
class Simulate:
    """Compare the estimators on simulated pings, and with the bound.

    Four receivers in a square, a target that moves among and around them; every method gets the same pings. Writes
    simulation.json, table.md and pictures of the RMSE by noise and over time, of the bound and of the time per position.
    """

    methods: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...", help_behavior_hint="(all)")] = ()
    """Which estimators."""
    runs: int = 100
    """Passages with other noise, for each noise."""
    sigma: Annotated[tuple[float, ...], tyro.conf.arg(metavar="S ...")] = (0.5e-3, 1e-3, 1.5e-3)
    """Deviations of an arrival time [s]."""
    outliers: float = 0.05
    """Share of arrivals whose way takes four times too long, in one more comparison at the last sigma; 0: none."""
    late: float = 0.0
    """Instead: one arrival of each passage comes so late [s]; 0.1 in the authors' own simulation."""
    paper_path: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """The path of the authors' own simulation: 19 points, 60 m apart, with a ping at each, once a minute."""
    speed: float = 0.2
    """Of the target [m/s]."""
    delay: float = 120.0
    """Of the tag, from ping to ping [s]."""
    random_delay: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Each delay up to 20 % shorter or longer, as those of the tags in the field."""
    baseline: float = 200.0
    """Side of the square [m]."""
    sound_speed: float = 1500.0
    """Speed of sound [m/s]."""
    acceleration_sigma: Annotated[float | None, tyro.conf.arg(metavar="X", help_behavior_hint="(as the track bends)")] = None
    """Random acceleration [m/s^1.5] that the methods with a motion model are told."""
    seed: int = 0
    """Of the noise."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(runs/simulate-array-TIME)")] = None
    """Folder to write; earlier results of this command are replaced."""

    def check(self) -> None:
        """Raise ValueError that names what cannot be simulated."""
        unknown = [name for name in self.methods if name not in CONTESTANTS]
        if unknown:
            raise ValueError(f"unknown method {unknown[0]!r}; known: {', '.join(CONTESTANTS)}")
        if self.runs < 1:
            raise ValueError(f"--runs must be at least 1, got {self.runs}")
        if not self.sigma:
            raise ValueError("--sigma needs at least one value")
        if not 0 <= self.outliers < 1:
            raise ValueError(f"--outliers must be a share in [0, 1), got {self.outliers}")
        if not 0 <= self.late <= 10:
            raise ValueError(f"--late must be from 0 to 10 s, got {self.late}")
        if self.paper_path and (self.speed, self.delay) != (0.2, 120.0):
            raise ValueError("--paper-path has a speed and a delay of its own, 1 m/s and 60 s; drop --speed and --delay")
        for name in ("speed", "delay", "baseline"):
            if not getattr(self, name) > 0:
                raise ValueError(f"--{name} must be positive, got {getattr(self, name)}")
        if self.seed < 0:
            raise ValueError(f"--seed must not be negative, got {self.seed}")

    def run(self) -> None:
        """Run it."""
        self.check()
        out = self.out or default_folder("simulate", "array")
        require_replaceable(out, OWN_FILES, "simulation")
        scene, noises = self.make_scene(), self.list_noises()
        settings = {noise: self.make_setting(scene, noise) for noise in noises}
        methods = {name: CONTESTANTS[name] for name in self.methods or CONTESTANTS}
        with progress_bar(len(noises) * self.runs * len(methods) * len(scene.position)) as advance:
            found = repeat(scene, noises, methods, settings, runs=self.runs, seed=self.seed, advance=advance)
        document = {
            **self.describe(),
            "acceleration_sigma_m_s15": settings[noises[0]].acceleration_sigma,
            **summarize(scene, found),
            "versions": collect_versions(),
        }
        for place in PLACES:
            show(as_console_table(*table_of(document, place), note_of(document, place)))
        with replace_results(out, OWN_FILES) as folder:
            write_json(folder / "simulation.json", document)
            write_text(folder / "table.md", as_page(document))
            save_figure(folder / "rmse.png", plot_rmse(document))
            save_figure(folder / "rmse_over_time.png", plot_rmse_over_time(scene, found))
            save_figure(folder / "bound.png", plot_bound(scene, self.baseline, self.sigma[len(self.sigma) // 2]))
            save_figure(folder / "time.png", plot_time(document["seconds_per_position"]))
        print(f"written: {out}")

    def make_scene(self) -> Scene:
        """The square array and the trajectory."""
        return Scene(
            receivers=place_receivers("square", self.baseline),
            position=paper_path() if self.paper_path else swim(self.baseline, self.speed * self.delay),
            delay=PAPER_DELAY if self.paper_path else self.delay,
            random_delay=self.random_delay,
            sound_speed=self.sound_speed,
        )

    def list_noises(self) -> list[Noise]:
        """Each sigma, then the last with outliers."""
        noises = [Noise(sigma=sigma) for sigma in self.sigma]
        if self.late:
            return [*noises, Noise(sigma=self.sigma[-1], late=self.late)]
        return [*noises, Noise(sigma=self.sigma[-1], outliers=self.outliers)] if self.outliers else noises

    def make_setting(self, scene: Scene, noise: Noise) -> ArraySetting:
        """What the methods are told: the true sigma, the true speed, and how much the track bends."""
        return ArraySetting(
            sound_speed=self.sound_speed,
            sigma=noise.sigma,
            acceleration_sigma=self.acceleration_sigma or scene.acceleration_sigma,
            first_speed_sigma=PAPER_STEP / PAPER_DELAY if self.paper_path else self.speed,
        )

    def describe(self) -> dict[str, Any]:
        """The choices as JSON has them."""
        chosen = dataclasses.asdict(self)
        told = ("runs", "seed", "speed", "delay", "random_delay", "baseline", "sound_speed", "late", "paper_path")
        return {name: chosen[name] for name in told}


def table_of(document: Mapping[str, Any], place: str) -> tuple[list[str], list[list[str]]]:
    """Header and rows, the bound first: RMSE [m] by noise, inside or outside the array, and the time per position."""
    noises = document["noises"]
    header = ["method", *(noise["label"] for noise in noises), "time"]
    bounds = [noise[f"bound_{place}_m"] for noise in noises]
    rows = [["bound", *("-" if bound is None else f"{bound:.2f}" for bound in bounds), ""]]
    for name, seconds in document["seconds_per_position"].items():
        cells = [interval_cell(noise["methods"][name][f"rmse_{place}_m"]) for noise in noises]
        rows.append([name, *cells, f"{1e3 * seconds:.2g} ms"])
    return header, rows


def note_of(document: Mapping[str, Any], place: str) -> str:
    """What stands below a table."""
    count = document["pings_inside"] if place == "inside" else document["pings"] - document["pings_inside"]
    missing = [
        f"{name} {100 * (1 - figures['located']):.1f} % ({noise['label']})"
        for noise in document["noises"]
        for name, figures in noise["methods"].items()
        if figures["located"] < 1
    ]
    note = (
        f"RMSE [m] {place} the array, {count} of {document['pings']} pings: median [5 %, 95 %] of {document['runs']} runs. "
        "bound: of one ping alone, without outliers; methods with a motion model may pass below it."
    )
    return note + (f" Without a position, left out: {', '.join(missing)}." if missing else "")


def as_page(document: Mapping[str, Any]) -> str:
    """table.md."""
    lines = ["# Estimators of a moored array, simulated", ""]
    for place in PLACES:
        lines += [f"## {place.capitalize()}", "", as_markdown(*table_of(document, place), note_of(document, place))]
    return "\n".join(lines)
