"""Machine code on disk is never stale, and not needed."""

import logging
import math
import os
import pathlib
import pickle
import shutil
import subprocess
import sys
import threading

import numba
import numba.core.dispatcher
import numpy as np
import pytest

from ikgym.kernels import compilation, jit
from ikgym.kernels.jit import inner, kernel, uncounted

CALLEE = "from {jit}\nSCALE = {scale}\n@kernel\ndef scaled(x):\n    return SCALE * x\n"
CALLER = (
    "from {jit}\nfrom constants import SHIFT\nfrom callee import scaled\n"
    "@kernel\ndef f(x):\n    return scaled(x) + SHIFT\n"
)
OURS = "ikgym.kernels.jit import kernel"
NUMBAS = "numba import njit\nkernel = njit(cache=True)"


def answer(folder, jit, scale, shift):
    """What a fresh process works out."""
    for name, text in {
        "constants": f"SHIFT = {shift}\n",
        "callee": CALLEE.format(jit=jit, scale=scale),
        "caller": CALLER.format(jit=jit),
    }.items():
        file = folder / f"{name}.py"
        if not file.exists() or file.read_text() != text:
            file.write_text(text)
    return float(
        subprocess.run(
            [sys.executable, "-c", "from caller import f; print(f(1.0))"],
            cwd=folder,
            env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
    )


def test_a_changed_callee_or_constant_is_noticed(tmp_path):
    assert answer(tmp_path, OURS, scale=2.0, shift=0.0) == 2.0
    assert list(tmp_path.glob("__pycache__/caller.f-*.nbc"))
    assert answer(tmp_path, OURS, scale=3.0, shift=0.0) == 3.0
    assert answer(tmp_path, OURS, scale=3.0, shift=10.0) == 13.0


def test_a_change_of_how_kernels_are_compiled_is_noticed(tmp_path, monkeypatch):
    """Every stamp has the file that compiles them in it."""

    def stamp():
        monkeypatch.setattr(jit, "_stamps", {})
        return jit._stamp("ikgym.kernels.rotations")

    before, changed = stamp(), tmp_path / "jit.py"
    assert stamp() == before
    changed.write_text(pathlib.Path(jit.__file__).read_text() + "# changed\n")
    monkeypatch.setattr(jit, "__file__", str(changed))
    assert stamp() != before


def test_numba_alone_would_not_notice(tmp_path):
    """If this fails numba has learned it, and the stamp can go."""
    assert answer(tmp_path, NUMBAS, scale=2.0, shift=0.0) == 2.0
    assert answer(tmp_path, NUMBAS, scale=3.0, shift=10.0) == 2.0


@pytest.fixture
def no_folder(monkeypatch):
    """Kernels that are defined in the test are compiled in it."""

    def no_locator(self, function):
        raise RuntimeError("cannot cache function: no locator available")

    monkeypatch.setattr(numba.core.dispatcher.FunctionCache, "__init__", no_locator)
    monkeypatch.setattr(jit, "_not_kept", set())


LARGE = (
    "from ikgym.kernels.jit import kernel\nSCALE = {scale}\n@kernel\ndef scaled(x):\n    total = 0.0\n"
    + "".join(f"    total += np.sin(x[{i}]) * x[{i + 1}]\n" for i in range(40))
    + "    return SCALE * total\n"
).replace("SCALE =", "import numpy as np\nSCALE =", 1)
MIDDLE = (
    "from ikgym.kernels.jit import kernel\nfrom callee import scaled\n@kernel\ndef middle(x):\n    return scaled(x)\n"
)
OUTER = (
    "from ikgym.kernels.jit import kernel\nfrom middle import middle\n"
    "@kernel\ndef outer(x):\n    return 1.0 + middle(x)\n"
)
LINKED = """
import numpy as np
from caller import outer
from callee import scaled
from middle import middle
print(outer(np.ones(99)), *(sum(kernel.stats.cache_misses.values()) for kernel in (outer, middle, scaled)))
modules = [result.library._final_module for kernel in (outer, middle) for result in kernel.overloads.values()]
copies = [f.name for module in modules for f in module.functions if "scaled" in f.name and not f.is_declaration]
print(len(copies))
"""


def linked(folder, scale):
    """What a fresh process gets from a small kernel that calls a large one, and how many it has compiled."""
    for name, text in {"callee": LARGE.format(scale=scale), "middle": MIDDLE, "caller": OUTER, "run": LINKED}.items():
        (folder / f"{name}.py").write_text(text)
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    line = [sys.executable, "run.py"]
    done = subprocess.run(line, cwd=folder, env=environment, capture_output=True, text=True, check=True)
    (total, *missed), (copies,) = map(str.split, done.stdout.splitlines())
    assert copies == "0"
    return round(float(total), 6), list(map(int, missed))


def test_a_large_callee_is_compiled_once_and_its_name_linked(tmp_path):
    one, two = 1.0 + 40.0 * math.sin(1.0), 1.0 + 80.0 * math.sin(1.0)
    assert linked(tmp_path, scale=1.0) == (round(one, 6), [1, 1, 1])
    assert linked(tmp_path, scale=1.0) == (round(one, 6), [0, 0, 0])
    # A callee that is missing is compiled under the same name: its callers are as good as before.
    for file in tmp_path.glob("__pycache__/callee.*"):
        file.unlink()
    assert linked(tmp_path, scale=1.0) == (round(one, 6), [0, 0, 1])
    # One of another process, or from another source, has another.
    assert linked(tmp_path, scale=2.0) == (round(two, 6), [1, 1, 1])


def test_a_kernel_is_compiled_once_for_all_constants(no_folder):
    @kernel
    def power(x, k):
        return x**k

    @kernel
    def sums(x):
        return power(x, 2) + power(x, 3)

    assert sums(2.0) == 12.0
    assert len(power.signatures) == 1


def test_python_calls_an_inner_kernel_through_another_kernel(no_folder):
    @inner
    def scaled(x, factor):
        return x * factor

    assert (scaled(np.ones(3), 2.0) == 2.0).all()
    assert scaled(1.0, 3.0) == 3.0
    assert not any(scaled.inspect_llvm(kinds).count("@_ZN7cpython") for kinds in scaled.signatures)


@pytest.mark.parametrize("policy", ["dls", "qp", "mfac", "rhc_foresight", "calibrated", "agent_alone"])
def test_no_policy_calls_an_inner_kernel_from_python(policy):
    """It would be compiled in each process."""
    code = (
        "import baselines, ikgym.kernels.jit as jit\n"
        f"baselines.track('varga7-fast', {policy!r}, steps=2)\n"
        "print(jit._entry.cache_info().currsize)"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "0\n"


def test_an_uncounted_kernel_returns_no_array(no_folder):
    @uncounted
    def itself(x):
        return x, 1.0

    with pytest.raises(TypeError, match="itself does not count references, and returns an array"):
        itself(np.ones(3))


@pytest.mark.parametrize("symbol", ["another", None])
def test_a_callee_of_another_name_or_none_is_refused(symbol):
    """Its caller is compiled anew then: see what reading the cache may raise."""
    name = "geodesic_angle" if symbol else "no_such_kernel"
    rotation = numba.typeof(np.eye(3))
    with pytest.raises(jit.UNREADABLE):
        jit._Callee("ikgym.kernels.rotations", name, (rotation, rotation), symbol or "any")()


def test_without_a_folder_to_write_to(no_folder, caplog):
    assert jit.kept_on_disk()
    with caplog.at_level(logging.INFO, logger="ikgym"):

        @kernel
        def double(x):
            return 2 * x

    assert double(4) == 8
    assert "compiled anew in each process" in caplog.text
    assert not jit.kept_on_disk()
    with compilation.announced("the test", patience=0.01):
        threading.Event().wait(0.2)
    assert "Compiling the test; this happens once in each process, since there is no folder" in caplog.text
    assert "kept on disk" not in caplog.text


def test_an_uncounted_kernel_allocates_nothing_itself():
    @uncounted
    def allocating(n):
        return np.empty(n).sum()

    with pytest.raises(numba.core.errors.NumbaError, match="Only accept returning of array passed into the function"):
        allocating(3)


def test_what_an_uncounted_kernel_calls_may_allocate(no_folder):
    """Without a word of its own a kernel would be compiled as its first caller is."""

    @kernel
    def allocating(n):
        return np.ones(n).sum()

    @uncounted
    def calling(n):
        return allocating(n)

    assert calling(3) == 3.0


CACHE = """
import sys
from ikgym.kernels.jit import kept_on_disk
if sys.argv[1:] == ["full"]:
    import resource, signal
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
from callee import scaled
print(scaled(1.0), kept_on_disk())
"""


def with_cache(folder, *arguments):
    """What a fresh process prints."""
    (folder / "callee.py").write_text(CALLEE.format(jit=OURS, scale=2.0))
    (folder / "run.py").write_text(CACHE)
    sources = {"PYTHONPATH": str(pathlib.Path(jit.__file__).parents[2]), "PYTHONDONTWRITEBYTECODE": "1"}
    line = [sys.executable, "run.py", *arguments]
    done = subprocess.run(line, cwd=folder, env={**os.environ, **sources}, capture_output=True, text=True, check=False)
    return done.stdout.strip(), done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="no limits there that stand in for a full disk")
def test_a_full_disk_is_said_once_and_hinders_nothing(tmp_path):
    out, said = with_cache(tmp_path, "full")
    assert out == "2.0 False"
    assert said.startswith("Machine code cannot be kept on disk, and is compiled anew in each process: ")
    assert "Traceback" not in said
    assert with_cache(tmp_path) == ("2.0 True", "")


@pytest.fixture(scope="module")
def first_run(tmp_path_factory):
    """A folder in which a kernel has been compiled, which each test has a copy of."""
    folder = tmp_path_factory.mktemp("first_run")
    assert with_cache(folder) == ("2.0 True", "")
    return folder


@pytest.fixture
def compiled(first_run, tmp_path):
    return shutil.copytree(first_run, tmp_path, dirs_exist_ok=True)


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_damaged_machine_code_is_made_anew(compiled, suffix):
    (file,) = compiled.glob(f"__pycache__/*.{suffix}")
    file.write_bytes(file.read_bytes()[:20])
    assert with_cache(compiled) == ("2.0 True", "")


def test_machine_code_of_a_version_with_other_types_is_made_anew(compiled):
    (index,) = compiled.glob("__pycache__/*.nbi")
    stamped = index.read_bytes()
    index.write_bytes(pickle.dumps(numba.__version__) + b"cno_such_module\nTuple\n.")
    assert with_cache(compiled) == ("2.0 True", "")
    assert index.read_bytes() == stamped


def test_plain_python_still_works():
    code = (
        "import warnings; warnings.simplefilter('ignore')\n"
        "import ikgym, baselines, numpy as np\n"
        "print(ikgym.arms.get('varga7').forward(np.zeros(7))[1][0])"
    )
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    out = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "5.5"
