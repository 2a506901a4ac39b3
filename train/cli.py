"""`tagtrack train`: parse, make or reopen the run's folder, train, and compare the policy with the paper's controller."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable

from tagtrack.command import tagtrack_here
from tagtrack.eval.parsing import parse_options
from tagtrack.train.config import TrainConfig, from_json, merge_texts


def main(arguments: list[str] | None = None) -> int:
    """Exit status: 0 when trained, 130 after Ctrl-C (what was saved stays), 2 for a mistake on the command line or in a file."""
    arguments = sys.argv[1:] if arguments is None else arguments
    return guarded(lambda: run(parse(arguments)))


def guarded(action: Callable[[], int]) -> int:
    """The exit status of what is done, and a line on what went wrong."""
    try:
        return action()
    except KeyboardInterrupt:
        print("\nbroken off; what was saved stays", file=sys.stderr)
        return 130
    except MemoryError:
        print("error: there is not enough memory; lower --num-envs or --particles", file=sys.stderr)
        return 2
    except BrokenPipeError:  # whoever read it has seen enough
        return 1
    except (ValueError, OSError, ImportError) as error:
        print(f"error: {' '.join(str(error).split()) or type(error).__name__}", file=sys.stderr)
        return 2


def parse(arguments: list[str]) -> TrainConfig:
    """The command line over the defaults, or over the file that --config names."""
    program = f"{tagtrack_here()} train"
    config: TrainConfig = parse_options(TrainConfig, arguments, prog=program)
    if config.config is None or config.resume is not None:
        return config
    file = from_json(config.config)
    default = dataclasses.replace(file, config=config.config, out=None, resume=None, set=(), hyper=())
    config = parse_options(TrainConfig, arguments, prog=program, default=default)
    return dataclasses.replace(config, set=merge_texts(file.set, config.set), hyper=merge_texts(file.hyper, config.hyper))


def run(config: TrainConfig) -> int:
    """What a command line asks for: one run, or one for each of several seeds."""
    if config.seeds:
        from tagtrack.train.several import train_several

        return train_several(config)
    from tagtrack.train.runs import run as run_one

    config.engine.require_default()
    return run_one(config)
