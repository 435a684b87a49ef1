"""One structure: tied, around, reduced and damped against dense matrices written out apart; models made of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from tolerances import LAST_BIT, LAST_DIGITS, REPEATED, SOLVED

import fretwave as fw

N = 6
#: Springs of a sector between its dofs: hub to ground, hub to blade, hub to the next hub (its high face).
SPRINGS = [([0], 3.0), ([0, 1], 2.0), ([0, 2], 1.5)]
MASSES = [1.0, 0.4, 0.0]


def stiffness(springs: list) -> np.ndarray:
    K = np.zeros((3, 3))
    for dofs, k in springs:
        b = np.zeros(3)
        b[dofs] = [1.0, -1.0][: len(dofs)]
        K += k * np.outer(b, b)
    return K


def cut() -> fw.Structure:
    """Hub, blade, and the next hub as high face; a pair from the blade to the next hub."""
    shroud = fw.Pairs([[0.0, 1.0, -1.0]], 1, {"tangential_stiffness": 5.0, "friction_limit": 1.0}, areas=np.ones(1))
    return fw.Structure(
        np.diag(MASSES),
        stiffness(SPRINGS),
        0.01 * stiffness(SPRINGS[1:2]),
        dofs={"hub": 0, "blade": 1, "next": 2},
        pairs={"shroud": shroud},
        loads={"steady": np.array([0.0, 1.0, 2.0])},
        sectors=N,
        low=np.array([0]),
        high=np.array([2]),
        parts={"blade": stiffness(SPRINGS[1:2])},
    )


def places(j: int) -> list[int]:
    """Dofs of the wheel that are hub, blade and next hub of sector j."""
    return [2 * j, 2 * j + 1, 2 * ((j + 1) % N)]


def wheel_of(A: np.ndarray, factors: np.ndarray | float = 1.0) -> np.ndarray:
    """The wheel assembled sector by sector."""
    out = np.zeros((2 * N, 2 * N))
    for j, factor in enumerate(np.broadcast_to(factors, N)):
        out[np.ix_(places(j), places(j))] += factor * A
    return out


@pytest.mark.ranks(1)
def test_wheel_is_the_sum_of_its_sectors() -> None:
    deviations = np.array([0.1, -0.2, 0.05, 0.0, 0.3, -0.1])
    tied, given = cut().tied(), cut()
    whole = tied.around(deviations, "blade")
    expected = wheel_of(given.K) + wheel_of(given.parts["blade"], deviations)
    np.testing.assert_allclose(whole.own("K").toarray(), expected, rtol=0, atol=LAST_BIT)
    np.testing.assert_allclose(whole.own("M").toarray(), wheel_of(given.M), rtol=0, atol=LAST_BIT)
    np.testing.assert_allclose(whole.own("C").toarray(), wheel_of(given.C), rtol=0, atol=LAST_BIT)
    all_of_it = tied.around(deviations).own("K").toarray()
    np.testing.assert_allclose(all_of_it, wheel_of(given.K, 1 + deviations), rtol=0, atol=LAST_DIGITS)
    B = whole.pairs["shroud"].own.toarray()
    for j in range(N):
        row = np.zeros(2 * N)
        np.add.at(row, places(j), [0.0, 1.0, -1.0])
        np.testing.assert_array_equal(B[j], row)
    np.testing.assert_array_equal(whole.loads["steady"], np.tile([2.0, 1.0], N))
    assert whole.dof("blade", 4) == 9 == whole.places("blade")[4] and whole.unit == 2
    assert tied.dofs == {"hub": 0, "blade": 1} and tied.cut.dof("next") == 2


@pytest.mark.parametrize("contact", ["free", "stuck"])
def test_waves_of_the_sector_are_the_modes_of_the_wheel(comm, contact: str) -> None:
    """A script from builder to modes; the wheel's frequencies from its dense matrices."""
    tied = cut().tied()
    springs = wheel_of(5.0 * np.outer([0, 1, -1], [0, 1, -1])) if contact == "stuck" else 0.0
    exact = np.sqrt(scipy.linalg.eigh(wheel_of(cut().K) + springs, wheel_of(cut().M), eigvals_only=True))
    found = []
    for diameters in range(-(N // 2) + 1, N // 2 + 1):
        with tied.model([fw.Contact("jenkins", tied.pairs["shroud"])], comm, diameters) as model:
            found += [mode.omega for mode in fw.linear_modes(model, 2, contact)]
    np.testing.assert_allclose(np.sort(found), exact, rtol=SOLVED)
    whole = tied.around()
    with whole.model([fw.Contact("jenkins", whole.pairs["shroud"])], comm) as model:
        np.testing.assert_allclose([m.omega for m in fw.linear_modes(model, 2 * N, contact)], exact, rtol=SOLVED)
    sector = fw.Sector.of(tied, [fw.Contact("jenkins", tied.pairs["shroud"])])
    with sector.wheel(comm) as model:
        np.testing.assert_allclose([m.omega for m in fw.linear_modes(model, 2 * N, contact)], exact, rtol=SOLVED)


@pytest.mark.ranks(1)
def test_damping_has_shares_and_dampers() -> None:
    given = replace(cut(), stiffness_damping=1e-3, mass_damping=0.2)
    C = given.damped([(1, 0.7), (1, 0.1)]).own("C").toarray()
    np.testing.assert_allclose(C, given.C + 1e-3 * given.K + 0.2 * given.M + np.diag([0, 0.8, 0]), atol=1e-16)
    again = given.damped().damped()
    np.testing.assert_array_equal(again.own("C").toarray(), given.damped().own("C").toarray())
    tied = given.tied().damped()
    np.testing.assert_allclose(
        tied.around().own("C").toarray(), wheel_of(given.damped().own("C").toarray()), atol=LAST_BIT
    )
    assert replace(cut(), C=None).damped().C is None


def chain() -> fw.Structure:
    """Ten nodes of three dofs, sprung to each other and to ground, a pair of three components at the last."""
    rng = np.random.default_rng(4)
    A = rng.standard_normal((30, 30))
    B = np.zeros((3, 30))
    B[:, 27:] = np.eye(3)
    pads = fw.Pairs(
        B, parameters={"normal_stiffness": 10.0, "tangential_stiffness": 5.0, "normal_load": 1.0, "other": 3.0}
    )
    loads = {"pull": rng.standard_normal(30), "push": np.ones(30)}
    return fw.Structure(np.eye(30), A @ A.T + np.eye(30), dofs={"tip": 4}, pairs={"pads": pads}, loads=loads)


def test_reduced_to_all_its_modes_is_the_same(comm) -> None:
    """Frequencies with stuck contact, static displacement of the tip, and the loads' resultants."""
    full = chain()
    with fw.reduce(full.M, full.K, keep=full.kept, modes=26, comm=comm) as reduction:
        small = full.reduced(reduction)
    assert small.dof_names[small.dof("tip")] == "tip" and small.n_dof == 30 and small.names[-1] == "component_26"
    omegas = []
    for one in (full, small):
        contact = fw.Contact("coulomb_3d", one.pairs["pads"], {"friction_coefficient": 0.3})
        with one.model([contact], comm) as model:
            omegas.append([mode.omega for mode in fw.linear_modes(model, 8)])
    np.testing.assert_allclose(*omegas, rtol=REPEATED)
    x, x_r = (np.linalg.solve(one.own("K").toarray(), one.loads["pull"]) for one in (full, small))
    np.testing.assert_allclose(x_r[small.dof("tip")], x[4], rtol=SOLVED)
    expected = (full.loads["pull"] + full.loads["push"]).reshape(-1, 3).sum(axis=0)
    for one in (full, small):
        np.testing.assert_allclose(one.resultant(["pull", "push"]), expected, rtol=1e-13)


def test_reduction_without_a_dof_of_the_pairs_is_refused(comm) -> None:
    full = chain()
    with (
        fw.reduce(full.M, full.K, keep=full.kept[:-1], modes=3, comm=comm) as reduction,
        pytest.raises(fw.InputError, match="has not kept"),
    ):
        full.reduced(reduction)


@pytest.mark.ranks(1)
def test_resultants_of_a_mesh_with_held_nodes() -> None:
    """Dofs in any order, some held: each along its own axis. Of a builder's own coordinates nothing is said."""
    displacements = np.array([[-1, 2, 0], [1, -1, -1]])
    given = fw.Structure(np.eye(3), np.eye(3), loads={"f": np.array([1.0, 2.0, 4.0])}, displacements=displacements)
    assert given.resultant(["f"]).tolist() == [2.0, 4.0, 1.0]
    assert replace(given, expansion=np.eye(3)).resultant(["f"]) is None
    assert given.resultant([]) is None


@pytest.mark.ranks(1)
def test_contact_takes_what_the_pairs_bring() -> None:
    pads = replace(chain().pairs["pads"], points=np.zeros((1, 3)))
    contact = fw.Contact("coulomb_3d", pads, {"normal_load": 7.0}, name="pads")
    assert contact.parameters == {"normal_stiffness": 10.0, "tangential_stiffness": 5.0, "normal_load": 7.0}
    moved = replace(contact, pairs=replace(contact.pairs, B=2 * contact.B))
    assert moved.pairs.points is pads.points and moved.B[0, 27] == 2.0
    assert replace(contact, parameters={}).pairs is pads
    with pytest.raises(fw.InputError, match="does not fit the contact pairs"):
        fw.Contact("jenkins", pads)
    with pytest.raises(fw.InputError, match="no pairs"):
        fw.Contact("jenkins")
    plain = fw.Contact("coulomb_3d", np.zeros((6, 4)))
    assert (plain.n_pairs, plain.pairs.components) == (2, 3)


@pytest.mark.ranks(1)
def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(fw.InputError, match=r"(?s)not tied to its neighbours.*tied\(\)"):
        cut().model()
    with pytest.raises(fw.InputError, match="has no faces"):
        chain().tied()
    with pytest.raises(fw.InputError, match="two sectors or more"):
        replace(cut(), sectors=1).tied()
    with pytest.raises(fw.InputError, match="no sector of a wheel"):
        chain().around()
    with pytest.raises(fw.InputError, match="(?s)no such part.*blade, sector"):
        cut().tied().around(np.zeros(N), "blad")
    by_terms = replace(chain(), K={0: sp.identity(30), 1: sp.identity(30), -1: sp.identity(30)})
    assert "both its faces" in by_terms.complaint()
    ahead = fw.Pairs({0: np.ones((3, 30)), 1: np.ones((3, 30))})
    assert "both its faces" in replace(chain(), pairs={"shroud": ahead}).complaint()
    reaching = {0: np.array([[0.0, 1.0, 0.0]]), 1: np.array([[-1.0, 0.0, 0.0]])}
    assert replace(cut(), pairs={"shroud": fw.Pairs(reaching, 1)}).complaint() is None
    narrow = fw.Pairs({**reaching, 1: np.ones((1, 2))}, 1)
    assert "is 1 x 2, not" in replace(cut(), pairs={"shroud": narrow}).complaint()
    assert cut().complaint() is None


def test_dofs_by_their_names() -> None:
    """One dof may have several; Python's own error named the list and not the name."""
    given = fw.Structure(np.eye(3), np.eye(3), dofs={"tip": 1, "gauge": 1}, names=["root", "blade", "disk"])
    assert [given.dof(name) for name in ("root", "tip", "gauge", "disk")] == [0, 1, 1, 2]
    with pytest.raises(fw.InputError, match=r"no dof of this name[\s\S]*'rot'[\s\S]*did you mean `root`"):
        given.dof("rot")
