"""The doctor's checks on the values of other machines, and its report on this one."""

from __future__ import annotations

import numpy as np
import pytest

from fretwave.commands import doctor
from fretwave.errors import InputError

pytestmark = pytest.mark.ranks(1)

MAPS = """\
7f00 r-xp 00000000 fe:00 1 /usr/lib/x86_64-linux-gnu/libmpi.so.40.30.4
7f01 r--p 00001000 fe:00 1 /usr/lib/x86_64-linux-gnu/libmpi.so.40.30.4
7f02 r-xp 00000000 fe:00 2 /usr/lib/x86_64-linux-gnu/libmpi_mpifh.so.40.30.0
7f03 r-xp 00000000 fe:00 3 /opt/mpich/lib/libmpi.so.12.2.0
7f04 rw-p 00000000 00:00 0
"""


@pytest.mark.parametrize(
    "well, ill",
    [
        (doctor.check_python((3, 11, 2), "python3"), doctor.check_python((3, 8, 1), "python3")),
        (doctor.check_petsc_version((3, 18, 5)), doctor.check_petsc_version((3, 17, 4))),
        (doctor.check_petsc_version((4, 0, 0)), doctor.check_petsc_version((2, 99, 0))),
        (doctor.check_scalar_type(np.float64), doctor.check_scalar_type(np.complex128)),
        (doctor.check_scalar_type(np.float64), doctor.check_scalar_type(np.float32)),
        (doctor.check_int_size(8), doctor.check_int_size(2)),
        (doctor.check_slepc((3, 18, 2), (3, 18, 5)), doctor.check_slepc((3, 17, 2), (3, 18, 5))),
        (doctor.check_mumps(""), doctor.check_mumps("PETSc error 92")),
        (doctor.check_one_mpi(["libmpi.so.40"], "Open MPI"), doctor.check_one_mpi(["a", "b"], "Open MPI")),
        (
            doctor.check_h5py("3.7.0", True, ["/usr/lib/x86_64-linux-gnu/libhdf5_openmpi.so.103.3.0"]),
            doctor.check_h5py("3.16.0", False, ["site-packages/h5py.libs/libhdf5-9e18f0c6.so.320.0.0"]),
        ),
        (doctor.check_numpy("1.24.2", {}), doctor.check_numpy("2.1.0", {"h5py": "numpy.dtype size changed"})),
        (doctor.check_extension("", ["libfftw3.so.3"]), doctor.check_extension("No module", [])),
        (
            doctor.check_extension("", [], ["libpetsc.so.3.26"]),
            doctor.check_extension("", [], ["libpetsc.so.3.26", "libpetsc_real.so.3.18"]),
        ),
        (doctor.check_launch("2\n"), doctor.check_launch("1\n1\n")),
    ],
)
def test_check_tells_well_from_ill(well: doctor.Check, ill: doctor.Check) -> None:
    assert well.ok and well.needed and str(well).startswith("OK")
    assert not ill.ok and str(ill).startswith("PROBLEM")
    assert ill.expected in str(ill) and f"fix: {ill.fix}" in str(ill) and ill.fix


@pytest.mark.parametrize(
    "well, ill",
    [
        (
            doctor.check_blas(["/usr/lib/openblas-serial/libblas.so.3"], 30),
            doctor.check_blas(["/usr/lib/blas/libblas.so.3"], 2.4),
        ),
        (doctor.check_blas(["/opt/vendor/libblas.so.3"], 30.0), doctor.check_blas([], 2.4)),
        (doctor.check_threads({"OMP_NUM_THREADS": "1"}), doctor.check_threads({})),
        (doctor.check_root(1000, "Open MPI", {}), doctor.check_root(0, "Open MPI", {"OMPI_ALLOW_RUN_AS_ROOT": "1"})),
        (doctor.check_root(0, "MPICH", {}), doctor.check_root(0, "Open MPI", {})),
    ],
)
def test_what_only_costs_time_is_a_note(well: doctor.Check, ill: doctor.Check) -> None:
    assert well.ok
    assert not ill.ok and str(ill).startswith("note") and "fix: " in str(ill)


def test_two_mpi_libraries_are_seen() -> None:
    libraries = doctor.mapped_libraries(r"libmpi\.so", MAPS)
    assert libraries == ["/opt/mpich/lib/libmpi.so.12.2.0", "/usr/lib/x86_64-linux-gnu/libmpi.so.40.30.4"]
    assert "/opt/mpich" in str(doctor.check_one_mpi(libraries, "Open MPI 4.1.4"))


def test_complex_petsc_is_refused_with_numbers_and_fix() -> None:
    with pytest.raises(InputError) as caught:
        doctor.check_runtime(np.complex128)
    error = caught.value
    assert error.measured == "complex128" and "float64" in str(error.expected)
    assert "PETSC_DIR" in str(error.fix)


def test_this_petsc_is_accepted() -> None:
    doctor.check_runtime()


def test_probe_that_fails_is_reported() -> None:
    def find() -> list[doctor.Check]:
        raise ImportError("libpetsc_real.so: cannot open shared object file\nmore")

    (check,) = doctor.guarded("PETSc", find)
    assert not check.ok and "cannot open shared object file" in check.found and "more" not in check.found


def test_unimportable_module_is_named() -> None:
    assert list(doctor.import_errors(["json", "no_such_module_here"])) == ["no_such_module_here"]


def test_exit_code_counts_only_what_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    lines: list[str] = []
    note, problem = doctor.check_threads({}), doctor.check_petsc_version((3, 17, 0))
    monkeypatch.setattr(doctor, "examine", lambda: iter([note]))
    assert doctor.main([], lines.append) == 0
    monkeypatch.setattr(doctor, "examine", lambda: iter([note, problem]))
    assert doctor.main([], lines.append) == 1
    assert lines[-1] == "1 problem" and str(problem) in lines


def test_arguments_are_refused() -> None:
    lines: list[str] = []
    assert doctor.main(["--verbose"], lines.append) == 2
    assert lines == ["error: `fretwave doctor` takes --constants alone\nfix: fretwave doctor"]


def test_help_says_what_it_does() -> None:
    lines: list[str] = []
    assert doctor.main(["--help"], lines.append) == 0
    assert "usage: fretwave doctor" in lines[0] and "PROBLEM" in lines[0]


def test_report_on_this_machine(launch) -> None:
    """Where the tests run, nothing that fretwave needs is missing, mpirun included."""
    done = launch(1, "-m", "fretwave.commands.doctor")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "PROBLEM" not in done.stdout
    for name in (
        "Python",
        "numpy",
        "PETSc scalars",
        "MUMPS",
        "SLEPc",
        "MPI",
        "mpirun",
        "h5py",
        "fretwave core",
        "BLAS",
    ):
        assert f"OK       {name} " in done.stdout
