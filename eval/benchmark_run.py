"""What `tagtrack eval benchmark` does: check all that was asked for, compare, and write the folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tagtrack.envs.model import import_object
from tagtrack.envs.task import Task
from tagtrack.eval.benchmark import OWN_FILES, Benchmark
from tagtrack.eval.benchmark_logs import Makers, require_logs, write_logs
from tagtrack.eval.benchmark_pictures import draw_errors, draw_learning, draw_tracks, film_of, illustrations
from tagtrack.eval.cells.engine import Engine
from tagtrack.eval.command_line import command_line
from tagtrack.eval.comparison import Comparison, compare
from tagtrack.eval.contestants import each_run, make_groups, name_groups
from tagtrack.eval.html_report import html_report
from tagtrack.eval.metrics import Metric
from tagtrack.eval.plots import save_figure
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.report import console_table, show, write_benchmark, write_json, write_text
from tagtrack.eval.results_folder import default_folder, replace_results, require_replaceable
from tagtrack.eval.rivals import rivals_of
from tagtrack.eval.versions import collect_versions


def run_benchmark(asked: Benchmark) -> None:
    """Compare, print the table, write the folder."""
    asked.trial.check()
    asked.engine.check()
    task, env_id = asked.task.build(), asked.task.env_id
    specs = name_groups(asked.policies or rivals_of(task))
    metrics = {text.rpartition(":")[2]: import_object(text) for text in asked.metrics}
    if not 0 <= asked.record <= asked.trial.episodes:
        raise ValueError(f"--record must be from 0 to the {asked.trial.episodes} episodes, got {asked.record}")
    if asked.record and task.scenario.vehicles > 1:
        raise ValueError(f"--record writes missions of one vehicle, got vehicles={task.scenario.vehicles}; leave it out")
    makers = make_groups(specs, task, env_id, trust=asked.trust)
    out = asked.out or default_folder("benchmark", env_id)
    if asked.record:
        require_logs(out, makers)
    require_replaceable(out, OWN_FILES, "benchmark")
    with asked.engine.open() as engine:
        comparison = compare_all(asked, task, makers, metrics, engine)
        show(console_table(comparison.document({})))  # before it is written: a full disk must not cost the result
        write_results(out, asked, comparison, makers, specs)
        if asked.record:
            options = asked.task.make_options()
            write_logs(out, makers, task, episodes=asked.record, seed=asked.trial.seed, asked=options)
    print(f"written: {out}")


def compare_all(asked: Benchmark, task: Task, makers: Makers, metrics: dict[str, Metric], engine: Engine) -> Comparison:
    """All policies over the episodes, with a progress bar."""
    env_id, trial = asked.task.env_id, asked.trial
    with progress_bar(len(each_run(makers)) * trial.episodes * task.scenario.episode_steps) as advance:
        return compare(
            task,
            makers,
            episodes=trial.episodes,
            seed=trial.seed,
            threads=trial.threads,
            from_step=asked.from_step,
            metrics=metrics,
            env_id=f"{env_id} ({asked.task.preset})" if asked.task.preset else env_id,
            engine=engine,
            on_step=advance,
        )


def write_results(
    out: Path, asked: Benchmark, comparison: Comparison, makers: Makers, specs: dict[str, str | dict[str, str]]
) -> None:
    """All files of the folder, or none."""
    settings: dict[str, Any] = {
        **asked.task.describe(comparison.task),
        "replayed": comparison.task.describe_tracks(),
        "policies": specs,
        "episodes": asked.trial.episodes,
        "seed": asked.trial.seed,
        "from_step": asked.from_step,
        "metrics": asked.metrics,
    }
    film = film_of(comparison, makers) if asked.film else None  # before anything is written: Ctrl-C leaves no half
    document = comparison.document(collect_versions())
    with replace_results(out, OWN_FILES) as folder:
        write_benchmark(folder, document)
        write_json(folder / "config.json", settings)
        save_figure(folder / "errors.png", draw_errors(comparison))
        if learning := draw_learning(comparison, specs):
            save_figure(folder / "learning_curves.png", learning)
        draw_tracks(folder, comparison, makers)
        command = command_line("benchmark", asked)
        pictures = illustrations(folder, film)
        page = html_report(document, comparison, settings=settings, command=command, pictures=pictures)
        write_text(folder / "report.html", page)
