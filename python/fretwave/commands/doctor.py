"""What is installed, whether it fits together, and what to do where it does not.

Each check is a pure function of values found elsewhere, so that a test can feed it another machine's. This file imports
nothing of the package: ``python python/fretwave/commands/doctor.py`` answers also where fretwave cannot be imported.
"""

from __future__ import annotations

import importlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

OLDEST_PYTHON = (3, 9)
OLDEST_PETSC = (3, 18)
#: Reference BLAS gives 2.4 GFlop/s on one core of 2020s hardware, an optimised one more than 20.
SLOW_BLAS = 5.0
SET_UP_AGAIN = "rm -rf .venv && .ci/setup"
HELP = """usage: fretwave doctor [-h] [--constants]

Says what is installed (Python, PETSc, SLEPc, MUMPS, MPI, HDF5, BLAS, the core), whether it fits together,
and of each PROBLEM what to do about it. --constants: tuned constants of the core, which --petsc takes in their place.

exit codes: 0 fretwave can run, 1 it cannot"""


@dataclass(frozen=True)
class Check:
    """One line of the report; `fix` is shown when not `ok`. Without `needed`, fretwave works all the same."""

    name: str
    ok: bool
    found: str
    expected: str
    fix: str
    needed: bool = True

    def __str__(self) -> str:
        word = "OK" if self.ok else "PROBLEM" if self.needed else "note"
        line = f"{word:<8} {self.name:<18} {self.found}"
        return line if self.ok else f"{line}\n         expected: {self.expected}\n         fix: {self.fix}"


def dotted(version: Sequence[int]) -> str:
    return ".".join(str(number) for number in version)


def check_python(version: Sequence[int], executable: str) -> Check:
    fix = "use the system's interpreter: " + SET_UP_AGAIN
    ok = tuple(version[:2]) >= OLDEST_PYTHON
    return Check("Python", ok, f"{dotted(version[:3])} ({executable})", f">= {dotted(OLDEST_PYTHON)}", fix)


def check_petsc_version(version: Sequence[int], folder: str = "") -> Check:
    """`folder`: where petsc4py has it from."""
    fix = "apt-get install petsc-dev python3-petsc4py (Debian 12 has 3.18.5)"
    ok = tuple(version[:2]) >= OLDEST_PETSC
    found = dotted(version) + (f" ({folder})" if folder else "")
    return Check("PETSc", ok, found, f">= {dotted(OLDEST_PETSC)}", fix)


def check_scalar_type(scalar: object) -> Check:
    """fretwave's unknowns are (cos, sin) pairs of real numbers: a complex PETSc cannot hold them."""
    name = getattr(scalar, "__name__", str(scalar))
    fix = "unset PETSC_DIR PETSC_ARCH; if it stays complex: apt-get install petsc-dev python3-petsc4py"
    return Check("PETSc scalars", name == "float64", name, "float64 (a PETSc built with real scalars)", fix)


def check_int_size(bytes_per_int: int) -> Check:
    fix = "install a PETSc with 32- or 64-bit indices"
    return Check("PETSc indices", bytes_per_int in (4, 8), f"{8 * bytes_per_int}-bit", "32-bit or 64-bit", fix)


def check_slepc(version: Sequence[int], petsc: Sequence[int]) -> Check:
    fix = "install SLEPc and PETSc from one source: apt-get install slepc-dev python3-slepc4py"
    ok = tuple(version[:2]) == tuple(petsc[:2])
    return Check("SLEPc", ok, dotted(version), f"{dotted(petsc[:2])}, as PETSc", fix)


def check_mumps(error: str) -> Check:
    """`error` is what PETSc said to a MUMPS factorisation, "" when it worked."""
    fix = "use a PETSc configured with MUMPS: apt-get install petsc-dev libmumps-dev"
    return Check("MUMPS", not error, error or "factorises", "a PETSc that knows MUMPS", fix)


def check_one_mpi(libraries: Sequence[str], vendor: str) -> Check:
    """mpi4py, petsc4py and fretwave must share one MPI library; `libraries` are those in this process."""
    fix = (
        "install mpi4py and petsc4py against one MPI: apt-get install python3-mpi4py python3-petsc4py; " + SET_UP_AGAIN
    )
    found = f"{vendor} ({', '.join(libraries) or 'no MPI library loaded'})"
    return Check("MPI", len(libraries) == 1, found, "one MPI library for mpi4py and petsc4py", fix)


def check_numpy(version: str, broken: Mapping[str, str]) -> Check:
    """`broken`: modules that do not import with this numpy, and what they said."""
    found = version + "".join(f"; {module}: {error}" for module, error in broken.items())
    fix = f"let Debian's numpy show through (pip install 'numpy<1.25' in the venv, or {SET_UP_AGAIN})"
    return Check("numpy", not broken, found, "a numpy that petsc4py and h5py were built for (1.x on Debian 12)", fix)


def check_h5py(version: str, parallel: bool, libraries: Sequence[str]) -> Check:
    """`libraries`: HDF5 in this process. A wheel of h5py brings its own, which crashes at writes beside PETSc's."""
    own = [path for path in libraries if "h5py.libs" in path]
    found = f"{version}, {'parallel' if parallel else 'serial'} (rank 0 alone writes: both serve){''.join(own)}"
    fix = "pip uninstall h5py in the environment, so that Debian's python3-h5py-mpi shows through"
    return Check(
        "h5py", not own, found, "one of the system's HDF5: pip's own, beside PETSc's, crashes the process", fix
    )


def check_extension(error: str, fftw: Sequence[str], petsc: Sequence[str] = ()) -> Check:
    """`petsc`: what is loaded with the core and petsc4py; two of them are two memories of what is initialised."""
    fix = "build it: .ci/setup (log in .build/build.log)"
    if not error and len(petsc) > 1:
        fix = "build it again with the PKG_CONFIG_PATH of petsc4py's own PETSc (src/CONTRIBUTING.md)"
        return Check("fretwave core", False, f"built for another PETSc: {', '.join(petsc)}", "petsc4py's own", fix)
    return Check("fretwave core", not error, error or f"built, with {', '.join(fftw) or 'FFTW'}", "fretwave._core", fix)


def check_blas(libraries: Sequence[str], rate: float, kernels: str = "") -> Check:
    """BLAS that PETSc uses, by its path, its kernels and the measured rate of a dgemm [GFlop/s]."""
    known = any(word in path for path in libraries for word in ("openblas", "mkl", "blis", "atlas"))
    of_kernels = f" with kernels for {kernels}" if kernels else ""
    found = f"{', '.join(libraries) or 'not found'}{of_kernels}, dgemm {rate:.1f} GFlop/s"
    fix = "apt-get install libopenblas0-serial (it becomes the active BLAS; factorisations are 7 times as fast)"
    return Check("BLAS", known or rate > SLOW_BLAS, found, "OpenBLAS or another optimised BLAS", fix, needed=False)


def check_threads(environment: Mapping[str, str]) -> Check:
    value = environment.get("OMP_NUM_THREADS", "")
    fix = "export OMP_NUM_THREADS=1 (cases/run does): threads on top of MPI ranks fight for the cores"
    return Check("OMP_NUM_THREADS", value == "1", value or "not set", "1", fix, needed=False)


def check_root(user: int, vendor: str, environment: Mapping[str, str]) -> Check:
    names = ("OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM")
    ok = user != 0 or vendor != "Open MPI" or all(environment.get(name) == "1" for name in names)
    found = "not root" if user else "root, allowed" if ok else "root, which Open MPI's mpirun refuses"
    fix = "export " + " ".join(f"{name}=1" for name in names) + " (cases/run does)"
    return Check("user", ok, found, "an ordinary user, or root with Open MPI's consent", fix, needed=False)


def check_launch(output: str) -> Check:
    """`output`: communicator size that rank 0 of two printed; "1" twice is the mpirun of another MPI."""
    fix = "use the mpirun of the MPI above: apt-get install openmpi-bin; see also OMPI_ALLOW_RUN_AS_ROOT"
    ok = output.split() == ["2"]
    found = "mpirun starts 2 ranks" if ok else "mpirun -n 2: " + (" ".join(output.split())[:160] or "no output")
    return Check("mpirun", ok, found, "two processes in one communicator of size 2", fix)


def mapped_libraries(pattern: str, maps: str | None = None) -> list[str]:
    """Shared libraries in this process whose file name matches; `maps` is /proc/self/maps."""
    if maps is None:
        if not os.path.exists("/proc/self/maps"):
            return []
        with open("/proc/self/maps", encoding="utf-8") as file:
            maps = file.read()
    paths = {line.split()[-1] for line in maps.splitlines() if "/" in line}
    return sorted(path for path in paths if re.match(pattern, os.path.basename(path)))


def import_errors(modules: Sequence[str]) -> dict[str, str]:
    errors = {}
    for module in modules:
        try:
            importlib.import_module(module)
        except Exception as error:  # a numpy of another ABI raises whatever it likes
            errors[module] = (str(error).strip().splitlines() or [type(error).__name__])[0]
    return errors


def mumps_error() -> str:
    """What PETSc says to a MUMPS factorisation of a 1 x 1 matrix."""
    from petsc4py import PETSc

    matrix = PETSc.Mat().createAIJ((1, 1), nnz=1, comm=PETSc.COMM_SELF)
    matrix[0, 0] = 2.0
    matrix.assemble()
    factors = PETSc.PC().create(PETSc.COMM_SELF)
    factors.setOperators(matrix)
    factors.setType("lu")
    try:
        factors.setFactorSolverType("mumps")
        factors.setUp()
        return ""
    except PETSc.Error as error:
        return f"PETSc error {error.ierr}"
    finally:
        factors.destroy()
        matrix.destroy()


def dgemm_rate(n: int = 400) -> float:
    """Best of three products of two n x n matrices [GFlop/s]."""
    import numpy as np

    a = np.full((n, n), 1.0 + 1e-9)
    best = float("inf")
    for _ in range(3):
        start = time.perf_counter()
        a @ a
        best = min(best, time.perf_counter() - start)
    return 2e-9 * n**3 / best


def launch_two_ranks() -> str:
    """What `mpirun -n 2` prints for the size of the world."""
    mpirun = shutil.which("mpirun")
    if mpirun is None:
        return "not on PATH"
    # An MPI already running in this process leaves marks that a second mpirun would follow.
    allowed = ("OMPI_ALLOW", "OMPI_MCA_rmaps")
    marks = ("OMPI_", "PMIX_", "PMI_", "HYDRA_")
    environment = {k: v for k, v in os.environ.items() if k.startswith(allowed) or not k.startswith(marks)}
    environment.setdefault("OMPI_MCA_rmaps_base_oversubscribe", "1")
    code = "from mpi4py import MPI; MPI.COMM_WORLD.rank == 0 and print(MPI.COMM_WORLD.size)"
    try:
        done = subprocess.run(
            [mpirun, "-n", "2", sys.executable, "-c", code],
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=60,
        )
    except subprocess.TimeoutExpired:
        return "no end after 60 s"
    return done.stdout if done.returncode == 0 else done.stdout + done.stderr


def guarded(name: str, find: Callable[[], list[Check]]) -> list[Check]:
    """A probe that fails is a problem to report, not the end of the report."""
    try:
        return find()
    except Exception as error:
        first = (str(error).strip().splitlines() or [""])[0]
        return [Check(name, False, f"{type(error).__name__}: {first}", "installed and importable", ".ci/setup")]


def find_numpy() -> list[Check]:
    import numpy

    return [check_numpy(numpy.__version__, import_errors(["petsc4py.PETSc", "h5py"]))]


def find_petsc() -> list[Check]:
    import numpy
    import petsc4py
    from petsc4py import PETSc

    version = PETSc.Sys.getVersion()
    integer = numpy.dtype(PETSc.IntType).itemsize
    return [
        check_petsc_version(version, petsc4py.get_config().get("PETSC_DIR", "")),
        check_scalar_type(PETSc.ScalarType),
        check_int_size(integer),
        check_mumps(mumps_error()),
    ]


def find_slepc() -> list[Check]:
    from petsc4py import PETSc
    from slepc4py import SLEPc

    return [check_slepc(SLEPc.Sys.getVersion(), PETSc.Sys.getVersion())]


def find_mpi() -> list[Check]:
    from mpi4py import MPI

    vendor, version = MPI.get_vendor()
    libraries = mapped_libraries(r"lib(mpi|mpich|mpi_[a-z]*mpich)\.so")
    root = check_root(os.geteuid(), vendor, os.environ)
    checks = [check_one_mpi(libraries, f"{vendor} {dotted(version)}"), root]
    # Inside an MPI run the launcher has shown that it works.
    return checks if MPI.COMM_WORLD.size > 1 or not root.ok else [*checks, check_launch(launch_two_ranks())]


def find_h5py() -> list[Check]:
    import h5py

    return [check_h5py(h5py.version.version, bool(h5py.get_config().mpi), mapped_libraries(r"libhdf5[^/]*\.so"))]


def find_core() -> list[Check]:
    error = import_errors(["fretwave._core"]).get("fretwave._core", "")
    libraries = [mapped_libraries(pattern) for pattern in (r"libfftw3\.so", r"libpetsc[^/]*\.so")]
    return [check_extension(error, *libraries)]


def find_blas() -> list[Check]:
    kernels = ""
    if not import_errors(["fretwave._core"]):
        from fretwave import _core

        kernels = _core.blas_kernels()
    libraries = mapped_libraries(r"lib(blas|openblas|mkl_core|blis)[^/]*\.so")
    return [check_blas(libraries, dgemm_rate(), kernels), check_threads(os.environ)]


def examine() -> Iterator[Check]:
    """All checks of this machine; PETSc comes before what needs it loaded."""
    yield check_python(sys.version_info[:3], sys.executable)
    probes: dict[str, Callable[[], list[Check]]] = {
        "numpy": find_numpy,
        "PETSc": find_petsc,
        "SLEPc": find_slepc,
        "MPI": find_mpi,
        "h5py": find_h5py,
        "fretwave core": find_core,
        "BLAS": find_blas,
    }
    for name, find in probes.items():
        yield from guarded(name, find)


def check_runtime(scalar: object = None) -> None:
    """Refuse a complex PETSc before anything of fretwave touches it; cheap, for the start of the package.

    Raises
    ------
    InputError
        PETSc's scalars are not real. `scalar` stands in for PETSc's own type in tests.
    """
    from ..errors import InputError

    if scalar is None:
        from petsc4py import PETSc

        scalar = PETSc.ScalarType
    check = check_scalar_type(scalar)
    if not check.ok:
        what = "this PETSc has complex scalars; fretwave needs one with real scalars"
        raise InputError(what, where="petsc4py", measured=check.found, expected=check.expected, fix=check.fix)


def tuned_constants() -> str:
    """A line each: option of PETSc, value without it, meaning."""
    from fretwave import _core

    rows = [(f"-{option}", f"{value:g}", meaning) for option, value, meaning in _core.tuned_constants()]
    widths = [max(map(len, column)) for column in zip(*rows)]
    return "\n".join(f"{a:<{widths[0]}}  {b:>{widths[1]}}  {c}" for a, b, c in rows)


def main(argv: Sequence[str] | None = None, write: Callable[[str], object] = print) -> int:
    """Print the report; 0 when fretwave can run, 1 otherwise."""
    if argv and argv[0] in ("-h", "--help"):
        write(HELP)
        return 0
    if argv == ["--constants"]:
        write(tuned_constants())
        return 0
    if argv:
        write("error: `fretwave doctor` takes --constants alone\nfix: fretwave doctor")
        return 2
    problems = 0
    for check in examine():
        write(str(check))
        problems += not check.ok and check.needed
    write(f"{problems} problem{'' if problems == 1 else 's'}" if problems else "everything fretwave needs is here")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.path.pop(0)  # this folder: its modules are the package's, not top-level ones
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGPIPE})  # PETSc takes a reader who has left for a fault
    sys.exit(main(sys.argv[1:]))
