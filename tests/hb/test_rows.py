"""Normalised and observed by a row of displacements or a linear mode's coordinate in place of one dof."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import chain, dense, friction, options, unknowns, whole
from tolerances import ROUNDING, SOLVED, TIGHT

import fretwave as fw

N, STEP = 6, 1e-3
ROW = np.array([0.5, 0.0, -1.0, 2.0, 0.0, 0.3])


def model_of(comm):
    return fw.Model(np.diag(np.arange(1.0, N + 1)), chain(N), None, [friction(np.eye(N)[[1, 4]], 1.0, 0.5)], comm)


def mode_of(model, dof, **options):
    return fw.NonlinearMode(model, fw.Harmonics([1, 3], 64), dof=dof, start=fw.linear_modes(model, 1)[0], **options)


def response_of(model, dof):
    return fw.ForcedResponse(model, fw.Harmonics([1, 3], 64), {1: np.eye(N)[0]}, 0.5, dof, fw.linear_modes(model, 1)[0])


@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_a_unit_row_is_its_dof_to_the_last_digit(comm, method):
    with model_of(comm) as model:
        found = [fw.follow(mode_of(model, dof, method=method), 0.05, 3.0) for dof in (3, np.eye(N)[3])]
    for name in ("amplitude", "omega", "zeta", "slip", "residual"):
        np.testing.assert_array_equal(found[1][name], found[0][name])


def test_a_unit_row_observes_as_its_dof(comm):
    with model_of(comm) as model:
        found = [fw.follow(response_of(model, dof), 0.2, 0.5) for dof in (4, np.eye(N)[4])]
    for name in ("omega", "amplitude", "phase"):
        np.testing.assert_array_equal(found[1][name], found[0][name])


def test_a_row_gives_the_same_mode_over_another_amplitude(comm):
    """At a point of the branch over dof 3, that over the row has omega and zeta there, at the row's own amplitude."""
    with model_of(comm) as model:
        over_dof = fw.follow(mode_of(model, 3), 0.05, 3.0, report_at=[0.8])
        shape = over_dof.shape(over_dof.met("report")[0])
        over_row = fw.follow(mode_of(model, ROW), 0.05, 6.0, report_at=[abs(ROW @ shape)])
        one, other = (branch[branch.met("report")[0]] for branch in (over_dof, over_row))
        q = over_row.shape(over_row.met("report")[0])
    assert other["omega"] == pytest.approx(one["omega"], rel=SOLVED)
    assert other["zeta"] == pytest.approx(one["zeta"], rel=1e-7)
    assert ROW @ q == pytest.approx(other["amplitude"], rel=SOLVED), "(a, 0): real"


def test_a_row_is_observed_in_a_response(comm):
    with model_of(comm) as model:
        branch = fw.follow(response_of(model, ROW), 0.2, 0.5)
        q = branch.shape(len(branch) // 2)
    assert abs(ROW @ q) == pytest.approx(branch["amplitude"][len(branch) // 2], rel=TIGHT)


def test_a_modal_coordinate_is_that_of_unit_modal_mass(comm, shared_tmp):
    """Of the linear mode itself phi^T M (a phi) = a: omega as without contact, motion a phi."""
    with fw.Model(np.diag(np.arange(1.0, N + 1)), chain(N), comm=comm) as model:
        second = fw.linear_modes(model, 2)[1]
        mode = fw.NonlinearMode(model, fw.Harmonics([1], 16), dof=second, start=second)
        branch = fw.follow(mode, 0.1, 1.0)
        np.testing.assert_allclose(branch["omega"], second.omega, rtol=TIGHT)
        np.testing.assert_allclose(branch.shape(0), 0.1 * second.shape, atol=TIGHT)
        assert "coordinate" in repr(mode)
        branch.save(shared_tmp / "branch.h5")
    comm.barrier()
    for one in (branch, branch.at(0.5), fw.Branch.load(shared_tmp / "branch.h5")):
        assert one.units["amplitude"] == "sqrt(kg) m" and one.units["omega"] == "rad/s"
    assert branch.plot().axes[1].get_xlabel() == "Amplitude [sqrt(kg) m]"


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_derivatives_with_a_row(comm, method):
    """Assembled and matrix-free Jacobian against fourth-order differences."""
    with model_of(comm) as model:
        mode = mode_of(model, ROW, method=method)
        rng = np.random.default_rng(3)
        y = np.concatenate([0.5 * rng.standard_normal(N * 4), [0.06, 1.1, -0.4]])
        weights = {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}

        def residual(at):
            return whole(mode.residual(unknowns(mode, at)))

        differences = [sum(w * residual(y + k * STEP * e) for k, w in weights.items()) / STEP for e in np.eye(len(y))]
        J, expected = dense(mode.jacobian(unknowns(mode, y))), np.column_stack(differences)
        assert np.allclose(J, expected, rtol=0, atol=SOLVED * np.abs(expected).max())
        dy = rng.standard_normal(len(y))
        product = whole(mode.jacobian_product(unknowns(mode, y), unknowns(mode, dy)))
        assert np.allclose(product, J @ dy, rtol=0, atol=ROUNDING * np.abs(J @ dy).max())


@pytest.mark.parametrize("blocks", ["dense", "sparse"])
def test_both_preconditioners_take_a_row(comm, blocks):
    """The same branch by GMRES as by factorisation, in few iterations."""
    with model_of(comm) as model:
        direct = fw.follow(mode_of(model, ROW), 0.05, 3.0, report_at=[1.0])
        with options(row_route="krylov", row_blocks=blocks):
            krylov = fw.follow(mode_of(model, ROW, prefix="row_"), 0.05, 3.0, report_at=[1.0])
    one, other = (branch[branch.met("report")[0]] for branch in (direct, krylov))
    assert other["omega"] == pytest.approx(one["omega"], rel=SOLVED)
    assert krylov["linear"].sum() <= 12 * krylov["newton"].sum()


@pytest.mark.parametrize(
    "dof, words",
    [(np.zeros(N), "is zero"), (np.ones(N + 1), "does not fit"), (N, "does not exist"), (np.full(N, np.nan), "fit")],
)
def test_rows_that_do_not_fit_are_refused(comm, dof, words):
    with model_of(comm) as model, pytest.raises(fw.InputError, match=words):
        mode_of(model, dof)


def test_a_row_that_the_mode_does_not_move_is_refused(comm):
    model = fw.Model(np.eye(2), [[2.0, -1.0], [-1.0, 2.0]], comm=comm)
    start = fw.linear_modes(model, 1)[0]
    with pytest.raises(fw.InputError, match="does not move"):
        fw.NonlinearMode(model, fw.Harmonics([1], 16), dof=[1.0, -1.0], start=start)


def test_observed_columns_are_those_of_the_motion(comm, tmp_path):
    """A dof, a row and a coordinate, from the coefficients; kept by a file."""
    with model_of(comm) as model:
        first = fw.linear_modes(model, 1)[0]
        observe = {"tip": 5, "relative": ROW, "first": first, "energy": "energy"}
        branch = fw.follow(mode_of(model, 3), 0.05, 3.0, observe=observe)
        q = branch.shape(len(branch) - 1)
        coordinate = model.inertia(first.shape) @ q
    last = branch[len(branch) - 1]
    assert last["tip"] == pytest.approx(abs(q[5]), rel=ROUNDING)
    assert last["relative"] == pytest.approx(abs(ROW @ q), rel=ROUNDING)
    assert last["first"] == pytest.approx(abs(coordinate), rel=ROUNDING)
    assert branch.units["energy"] == "J" and branch.names[-4:] == ["tip", "relative", "first", "energy"]
    path = comm.bcast(tmp_path) / "branch.h5"
    branch.save(path)
    comm.barrier()
    np.testing.assert_array_equal(fw.Branch.load(path)["relative"], branch["relative"])


def test_energy_of_a_linear_mode_is_half_k_a_squared(comm):
    """Of the coordinate a of unit modal mass omega^2 a^2 / 2; a response far from resonance (m w^2 + k) a^2 / 4."""
    with fw.Model(np.diag(np.arange(1.0, N + 1)), chain(N), comm=comm) as model:
        second = fw.linear_modes(model, 2)[1]
        mode = fw.NonlinearMode(model, fw.Harmonics([1, 3], 16), dof=second, start=second)
        branch = fw.follow(mode, 0.1, 1.0, observe={"energy": "energy"})
    np.testing.assert_allclose(branch["energy"], second.omega**2 * branch["amplitude"] ** 2 / 2, rtol=SOLVED)
    with fw.Model([[2.0]], [[8.0]], comm=comm) as model:
        start = fw.linear_modes(model, 1)[0]
        response = fw.ForcedResponse(model, fw.Harmonics([1], 16), {1: [1.0]}, 1.0, 0, start)
        branch = fw.follow(response, 0.5, 1.0, observe={"energy": "energy"})
    wanted = (2 * branch["omega"] ** 2 + 8) * branch["amplitude"] ** 2 / 4
    np.testing.assert_allclose(branch["energy"], wanted, rtol=TIGHT)


@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_energy_of_all_harmonics_of_a_damped_motion(comm, method):
    """sum_n>0 (|s_n|^2 q^H M q + q^H K q) / 4, damping in proportion to M and K left out."""
    M, K = np.diag(np.arange(1.0, N + 1)), chain(N)
    for C in (0.02 * M, 0.03 * K, 0.05 * np.outer(ROW, ROW)):
        with fw.Model(M, K, C, [friction(np.eye(N)[[1, 4]], 1.0, 0.5)], comm) as model:
            branch = fw.follow(mode_of(model, 3, method=method), 0.5, 3.0, observe={"energy": "energy"}, unknowns=True)
        row = branch[len(branch) - 1]
        Q = comm.bcast(branch.coefficients(len(branch) - 1))
        s = -row["beta"] + 1j * row["omega"] if method == "CNM" else 1j * row["omega0"]
        amplitudes = {1: Q[:, 0] - 1j * Q[:, 1], 3: Q[:, 2] - 1j * Q[:, 3]}
        assert row["zeta"] > 1e-3 and np.linalg.norm(amplitudes[3]) > 1e-3 * np.linalg.norm(amplitudes[1])
        parts = [abs(n * s) ** 2 * np.vdot(q, M @ q) + np.vdot(q, K @ q) for n, q in amplitudes.items()]
        assert row["energy"] == pytest.approx(sum(parts).real / 4, rel=ROUNDING)


def test_energy_of_a_sectors_wave_is_that_of_the_wheel_over_its_sectors(comm):
    ties = {0: [[1.6]], 1: [[-0.3]], -1: [[-0.3]]}
    sector = fw.Sector([[1.0]], {k: np.array(A) for k, A in ties.items()}, 12)
    with sector.model(2, comm) as model, sector.wheel(comm) as wheel:
        one = fw.linear_modes(model, 1, "free")[0]
        start, other = fw.travelling_wave(one, 2, 12)
        modes = [
            fw.NonlinearMode(model, fw.Harmonics([1], 24), start=one),
            fw.NonlinearMode(wheel, fw.Harmonics([1], 24), start=start, avoid=other),
        ]
        energy = [fw.follow(mode, 0.5, 1.0, observe={"energy": "energy"})["energy"][0] for mode in modes]
    assert energy[0] == pytest.approx(one.omega**2 * 0.5**2 / 2, rel=SOLVED)
    assert energy[1] == pytest.approx(12 * energy[0], rel=SOLVED)


@pytest.mark.parametrize(
    "observe, words", [({"zeta": 0}, "there already"), ({"e": "power"}, "cannot be observed"), ({"r": [1.0]}, "fit")]
)
def test_what_cannot_be_observed_is_refused(comm, observe, words):
    with model_of(comm) as model, pytest.raises(fw.InputError, match=words):
        fw.follow(mode_of(model, 3), 0.05, 3.0, observe=observe)
