"""What a stranger's machine sees: a light import, ids that work from any folder and in workers, a clean wheel."""

from __future__ import annotations

import shutil
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import gymnasium
import llvmlite
import numba
import numpy
import pytest
import safetensors

import tagtrack
from tagtrack.envs.layout import action_names, feature_names
from tagtrack.envs.scenario import find_scenario
from tagtrack.policies.files import save_policy
from tagtrack.policies.network import NetworkPolicy, weight_shapes

IDS = ("TagTrack/LeopardShark-v0", "TagTrack/LeopardSharkStandoff-v0")
BUILD_FOLDERS = ("tagtrack", "envs", "policies", "baselines", "train", "eval", "live")
PACKAGES = ("tagtrack", *(f"tagtrack.{name}" for name in BUILD_FOLDERS[1:]))
BUILD_INPUTS = ("pyproject.toml", "README.md", "LICENSE")

# Takes a few steps in an environment, however it was made, and fails on anything that breaks Gymnasium's contract.
DRIVE = """
import gymnasium
env = gymnasium.make("tagtrack:TagTrack/LeopardShark-v0")
observation, info = env.reset(seed=1)
assert env.observation_space.contains(observation)
for _ in range(3):
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    assert env.observation_space.contains(observation)
env.close()
"""

# What a vehicle at sea needs, and all that it has installed beside the standard library.
ABOARD = (
    "tagtrack.envs.belief.filter", "tagtrack.envs.layout", "tagtrack.envs.observation", "tagtrack.envs.simulation",
    "tagtrack.policies.files", "tagtrack.policies.network", "tagtrack.baselines.registry", "tagtrack.live.tracker",
    "tagtrack.live.steer", "tagtrack.live.helm", "tagtrack.live.sources", "tagtrack.live.cli",
)  # fmt: skip
INSTALLED_ABOARD = (numpy, numba, llvmlite, safetensors)

# Loads the policy file of the first argument, hears one ping of one tag and chooses an action.
SAIL = """
import importlib, sys
import tagtrack
for name in sys.argv[2:]: importlib.import_module(name)
import numpy as np
from tagtrack.envs.belief.filter import ParticleFilter
from tagtrack.envs.measurement import measurement
from tagtrack.envs.scenario import find_scenario
from tagtrack.policies.files import load_policy
policy = load_policy(sys.argv[1])
belief = ParticleFilter(find_scenario("LeopardShark-v0").belief)
belief.begin(0.0, 0.0)
before = belief.covariance[0].trace()
belief.predict(2.0)
belief.correct(measurement(time=2.0, x=0.0, y=0.0, heading=0.0, readings=[0.0, 70.0]))
assert np.isfinite(belief.estimate).all() and belief.covariance[0].trace() != before
action, _ = policy.predict(np.zeros(len(policy.observation_features), np.float32))
assert action.shape == (len(policy.action_names),)
assert not {"gymnasium", "scipy", "torch", "matplotlib", "pettingzoo"} & {name for name in sys.modules if sys.modules[name]}
print("done")
"""

# Before that: whatever a vehicle lacks cannot be found, though it is installed here.
REFUSE = """
import sys
class Refuse:
    known = {*sys.stdlib_module_names, "tagtrack", "numpy", "numba", "llvmlite", "safetensors"}
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] not in self.known:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Refuse())
"""


@pytest.fixture(scope="module")
def policy_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A saved policy that always goes straight on."""
    scenario = find_scenario("LeopardShark-v0")
    names, actions = feature_names(scenario), action_names(scenario)
    shapes = weight_shapes(features=len(names), hidden=(), actions=len(actions), squash="clip")
    policy = NetworkPolicy(
        algorithm="ppo",
        env_id="TagTrack/LeopardShark-v0",
        observation_features=names,
        action_names=actions,
        hidden=(),
        activation="tanh",
        weights={name: numpy.zeros(shape, numpy.float32) for name, shape in shapes.items()},
    )
    folder = tmp_path_factory.mktemp("policy")
    save_policy(folder, policy)
    return folder


def test_import_loads_nothing_heavy(run_python: Callable[..., str]) -> None:
    loaded = set(run_python("import sys, tagtrack; print(*sys.modules)").split())
    assert "tagtrack" in loaded
    assert not loaded & {"torch", "numba", "scipy", "matplotlib", "pygame", "stable_baselines3"}
    assert not {name for name in loaded if name.startswith("tagtrack.")}


def test_environments_and_heuristics_need_no_torch(run_python: Callable[..., str]) -> None:
    code = "import sys, tagtrack.envs.single, tagtrack.envs.vector, tagtrack.baselines.registry; print(*sys.modules)"
    loaded = set(run_python(code).split())
    assert {"tagtrack.envs.single", "tagtrack.baselines.reading_tables"} <= loaded
    assert not loaded & {"torch", "stable_baselines3", "matplotlib", "pygame"}


def test_filter_and_policy_run_where_only_numpy_numba_and_safetensors_are(
    run_python: Callable[..., str], policy_folder: Path
) -> None:
    assert run_python(REFUSE + SAIL, str(policy_folder), *ABOARD).split()[-1] == "done"


def test_what_a_vehicle_needs_loads_nothing_else_though_it_is_there(run_python: Callable[..., str]) -> None:
    """The front door alone loads Gymnasium and PettingZoo, to tell them the ids; numba by itself loads scipy."""
    code = (
        "import importlib, sys, numba, tagtrack\n"
        "door = set(sys.modules)\n"
        "for name in sys.argv[1:]: importlib.import_module(name)\n"
        "print(*set(sys.modules) - door)"
    )
    loaded = {name.partition(".")[0] for name in run_python(code, *ABOARD).split()}
    assert "tagtrack" in loaded
    assert not loaded & {"gymnasium", "pettingzoo", "scipy", "torch", "matplotlib", "stable_baselines3", "tyro", "rich"}


def test_policies_and_heuristics_load_on_a_vehicle_without_scipy(run_python: Callable[..., str]) -> None:
    code = "import sys; sys.modules['scipy'] = None\nimport tagtrack.baselines.registry, tagtrack.policies.files, tagtrack.envs"
    assert run_python(code) == ""


@pytest.mark.parametrize("env_id", IDS)
def test_every_id_is_registered_with_both_entry_points(env_id: str) -> None:
    spec = gymnasium.spec(env_id)
    assert spec.entry_point == "tagtrack.envs.single:TagTrackEnv"
    assert spec.vector_entry_point == "tagtrack.envs.vector:TagTrackVectorEnv"
    assert spec.kwargs == {"env_id": env_id}
    assert spec.max_episode_steps is None  # episodes end by themselves


def test_importing_twice_registers_once(run_python: Callable[..., str]) -> None:
    code = "import importlib, warnings, tagtrack; warnings.simplefilter('error'); importlib.reload(tagtrack)"
    assert run_python(code) == ""


def test_make_works_beside_folders_of_the_same_names(run_python: Callable[..., str], tmp_path: Path) -> None:
    for name in ("envs/__init__.py", "eval/__init__.py", "train.py", "policies.py", "baselines.py"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("OWNER = 'somebody_else'\n")
    code = "import envs, eval, train, policies, baselines\n" + DRIVE + "print(envs.OWNER, eval.OWNER, train.OWNER)"
    assert run_python(code, cwd=tmp_path).split() == ["somebody_else"] * 3


def test_worker_processes_under_spawn_can_make_environments(tmp_path: Path) -> None:
    script = tmp_path / "workers.py"
    script.write_text(
        """
import gymnasium
import numpy

if __name__ == "__main__":
    envs = gymnasium.make_vec(
        "tagtrack:TagTrack/LeopardShark-v0",
        num_envs=2,
        vectorization_mode="async",
        vector_kwargs={"context": "spawn"},
        particles=64,
    )
    observations, _ = envs.reset(seed=3)
    assert envs.observation_space.contains(observations)
    observations, rewards, *_ = envs.step(envs.action_space.sample())
    assert envs.observation_space.contains(observations)
    assert numpy.isfinite(rewards).all()
    envs.close()
    print("done")
"""
    )
    done = subprocess.run([sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "done"


@pytest.fixture(scope="module")
def wheel(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel, built from a copy so that nothing stays in the repository, and with nothing that must be fetched."""
    source = tmp_path_factory.mktemp("source")
    for name in BUILD_INPUTS:
        shutil.copy2(repository / name, source / name)
    for name in BUILD_FOLDERS:
        shutil.copytree(repository / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    out = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--no-index"]
    done = subprocess.run([*command, "--wheel-dir", str(out), str(source)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    (built,) = out.glob("*.whl")
    return built


def make_venv(home: Path, wheel: Path) -> tuple[Path, Path]:
    """A new virtual environment that holds the wheel and nothing else: its interpreter and its folder of packages."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(home)], check=True, timeout=300)
    python = home / "bin" / "python"
    code = "import sysconfig; print(sysconfig.get_path('purelib'))"
    done = subprocess.run([str(python), "-c", code], capture_output=True, text=True, check=True, timeout=300)
    packages = Path(done.stdout.strip())
    command = [sys.executable, "-m", "pip", "install", "--no-deps", "--no-index", "--ignore-installed"]
    done = subprocess.run([*command, "--target", str(packages), str(wheel)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return python, packages


@pytest.fixture(scope="module")
def bare_python(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The interpreter of a new virtual environment that holds the wheel.

    The dependencies are lent by a .pth line. Python reads no .pth files in a folder lent like this, so the editable
    install of this repository does not come along.
    """
    python, packages = make_venv(tmp_path_factory.mktemp("bare") / "venv", wheel)
    paths = (sysconfig.get_path("purelib"), sysconfig.get_path("platlib"), *map(home_of, (gymnasium, numpy)))
    lent = dict.fromkeys(str(path) for path in paths)
    (packages / "lent.pth").write_text("\n".join(lent) + "\n")
    return python


def home_of(package: ModuleType) -> Path:
    """The folder that a package is installed in, which need not be the interpreter's own."""
    assert package.__file__ is not None
    return Path(package.__file__).parents[1]


@pytest.fixture(scope="module")
def vehicle_python(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The interpreter of one that holds the wheel, numpy, numba and safetensors, by links, and no other package."""
    python, packages = make_venv(tmp_path_factory.mktemp("vehicle") / "venv", wheel)
    for package in INSTALLED_ABOARD:
        for part in (package.__name__, f"{package.__name__}.libs"):  # compiled libraries that a wheel brings
            if (home_of(package) / part).exists():
                (packages / part).symlink_to(home_of(package) / part)
    return python


def test_wheel_installs_one_name_and_every_source_file(wheel: Path, repository: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    code = {name for name in names if ".dist-info/" not in name}
    assert {name.partition("/")[0] for name in code} == {"tagtrack"}
    expected = set()
    for folder in BUILD_FOLDERS:
        prefix = Path() if folder == "tagtrack" else Path("tagtrack")
        for path in (repository / folder).rglob("*.py"):
            expected.add((prefix / path.relative_to(repository)).as_posix())
    assert {name for name in code if name.endswith(".py")} == expected
    assert f"tagtrack-{tagtrack.__version__}.dist-info/licenses/LICENSE" in names


def test_wheel_in_a_bare_venv_serves_every_package(bare_python: Path, run_python: Callable[..., str], tmp_path: Path) -> None:
    code = (
        "import importlib, sys, gymnasium\n"
        "for name in sys.argv[1:]: print(importlib.import_module(name).__file__)\n"
        f"for env_id in {IDS!r}: gymnasium.spec(env_id)"
    )
    files = run_python(code, *PACKAGES, cwd=tmp_path, executable=bare_python).split()
    assert len(files) == len(PACKAGES)
    for file in files:
        assert Path(file).resolve().is_relative_to(bare_python.parents[1].resolve())


@pytest.mark.slow  # the new venv starts without compiled kernels, as the next
def test_wheel_on_a_vehicle_loads_a_policy_and_runs_a_filter(
    vehicle_python: Path, run_python: Callable[..., str], policy_folder: Path, tmp_path: Path
) -> None:
    done = run_python(SAIL, str(policy_folder), *ABOARD, cwd=tmp_path, executable=vehicle_python)
    assert done.split()[-1] == "done"


@pytest.mark.slow
def test_wheel_in_a_bare_venv_runs_an_environment(bare_python: Path, run_python: Callable[..., str], tmp_path: Path) -> None:
    assert run_python(DRIVE + "print('done')", cwd=tmp_path, executable=bare_python).strip() == "done"
