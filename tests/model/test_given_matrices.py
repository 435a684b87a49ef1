"""Matrices as users have them, of every kind that NumPy and SciPy know: the same modes, or one sentence."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from tolerances import TIGHT

import fretwave as fw

pytestmark = pytest.mark.ranks(1, 2)

M = np.diag([1.0, 0.02])
K = np.array([[640.0, -40.0], [-40.0, 40.0]])
#: Of M and K, and with 40 N/m more on the second dof.
OMEGA, STUCK = (np.sqrt(np.linalg.eigvals(np.linalg.solve(M, A)).real.min()) for A in (K, K + np.diag([0.0, 40.0])))
#: 600 and 40 on one place, columns in disorder.
TWICE = sp.csr_matrix(([40.0, -40.0, 600.0, 40.0, -40.0], [0, 1, 0, 1, 0], [0, 3, 5]), shape=(2, 2))
FORMATS = ("csr", "csc", "coo", "lil", "dok", "dia", "bsr")

RIGHT: dict[str, Any] = {
    "Fortran": np.asfortranarray(K),
    "not contiguous": np.repeat(np.repeat(K, 2, 0), 2, 1)[::2, ::2],
    "float32": K.astype(np.float32),
    "integers": K.astype(int),
    "other bytes": K.astype(">f8"),
    "objects": K.astype(object),
    "long doubles": K.astype(np.longdouble),
    "complex without imaginary parts": K.astype(complex),
    "lists": K.tolist(),
    "tuples": tuple(map(tuple, K.tolist())),
    "nothing masked": np.ma.masked_array(K),
    "entries of one place": TWICE,
    **{f"complex {name}": getattr(sp, f"{name}_matrix")(K.astype(complex)) for name in ("csr", "dia", "dok", "lil")},
    **{f"matrix {name}": getattr(sp, f"{name}_matrix")(K) for name in FORMATS},
    **{f"array {name}": getattr(sp, f"{name}_array")(K) for name in FORMATS if hasattr(sp, f"{name}_array")},
}
WRONG: dict[str, tuple[Any, str]] = {
    "complex": (K * (1 + 0.01j), "is complex"),
    "sparse complex": (sp.csr_matrix(K * (1 + 0.01j)), "is complex"),
    "diagonals complex": (sp.dia_matrix(K * (1 + 0.01j)), "is complex"),
    "not a number in its imaginary part": (K + np.array([[complex(0, np.nan), 0], [0, 0]]), "is complex"),
    "text": (K.astype(str), "no matrix"),
    "three dimensions": (K[None], "no matrix"),
    "ragged": ([[640.0, -40.0], [-40.0]], "no matrix"),
    "None in it": ([[640.0, None], [None, 40.0]], "not a number|no matrix"),
    "masked": (np.ma.masked_array(K, K < 0), "masked"),
    "nan": (np.where(K < 0, np.nan, K), "not a number"),
    "inf": (np.where(K < 0, np.inf, K), "not a number"),
    "wide": (K[:1], "not square"),
    "a row": (K.ravel(), "not square"),
}


def lowest(count: int = 1, **given: Any) -> float:
    terms = {"M": M, "K": K, **given}
    with fw.Model(**terms) as model:
        return fw.linear_modes(model, count)[0].omega


def slider(B: Any, **parameters: Any) -> list[fw.Contact]:
    return [fw.Contact("jenkins", B, {"tangential_stiffness": 40.0, "friction_limit": 1.0, **parameters})]


@pytest.mark.parametrize("kind", RIGHT)
def test_every_kind_of_matrix_is_the_same_one(kind: str) -> None:
    given = RIGHT[kind]
    assert lowest(K=given) == pytest.approx(OMEGA, rel=TIGHT)
    assert lowest(M=sp.csr_matrix(M), C=given) == pytest.approx(OMEGA, rel=TIGHT)


@pytest.mark.parametrize("triangle", [np.triu, np.tril, lambda A: sp.csr_matrix(np.triu(A))])
def test_a_triangle_of_the_mass_is_refused(triangle: Any) -> None:
    """It was taken for all of it: files hold one triangle, and the frequency was another."""
    half = triangle(M + [[0.0, 0.05], [0.05, 0.0]])
    for asked in (lambda: lowest(M=half), lambda: lowest(M={0: half}), lambda: fw.reduce(half, K, keep=[0], modes=1)):
        with pytest.raises(fw.InputError, match=r"mass matrix is not symmetric[\s\S]*0\.05"):
            asked()


@pytest.mark.parametrize("modes", [2.5, "2", [1]], ids=str)
def test_component_modes_are_counted(modes: Any) -> None:
    with pytest.raises(fw.InputError, match=r"modes are counted[\s\S]*whole number"):
        fw.reduce(M, K, keep=[0], modes=modes)


@pytest.mark.parametrize("kind", FORMATS)
def test_every_kind_of_contact_map_is_the_same_one(kind: str) -> None:
    B = getattr(sp, f"{kind}_matrix")(np.array([[0.0, 1.0]]))
    assert lowest(contacts=slider(B)) == pytest.approx(STUCK, rel=TIGHT)


def test_entries_of_one_place_add_up_and_stay_the_users() -> None:
    half = sp.csr_matrix(([0.5, 0.5], [1, 1], [0, 2]), shape=(1, 2))
    assert lowest(K=TWICE, contacts=slider(half)) == pytest.approx(STUCK, rel=TIGHT)
    assert (TWICE.nnz, half.nnz, half.data.tolist()) == (5, 2, [0.5, 0.5])


@pytest.mark.parametrize("kind", WRONG)
@pytest.mark.parametrize("letter", ["M", "K", "C"])
def test_what_is_no_real_matrix_is_refused(letter: str, kind: str) -> None:
    given, said = WRONG[kind]
    with pytest.raises(fw.InputError, match=said):
        fw.Model(**{"M": M, "K": K, letter: given})


@pytest.mark.parametrize("B", [[[0.0, 1j]], [[0.0, np.nan]], [["0", "1"]]], ids=str)
def test_what_is_no_real_contact_map_is_refused(B: Any) -> None:
    with pytest.raises(fw.InputError, match="B of contact 'contact'"):
        fw.Model(M, K, contacts=slider(B))


def test_a_complex_matrix_is_refused_wherever_one_is_taken() -> None:
    """SciPy would keep its real part, with a warning that is shown once."""
    loss = K * (1 + 0.01j)
    for taken in (
        lambda: fw.reduce(M, loss, keep=[0], modes=1),
        lambda: fw.modal_damping(M, loss, 0.01),
        lambda: fw.Sector(M, loss, 4),
        lambda: fw.Sector.from_faces(M, loss, [0], [1], 4),
        lambda: fw.Structure(M, loss).sparse(),
    ):
        with pytest.raises(fw.InputError, match="is complex"):
            taken()


@pytest.mark.parametrize(
    ("mass", "said"),
    [([1.0, 0.0], "zero diagonal"), ([-1.0, -0.02], "negative diagonal"), ([[1.0, 2.0], [2.0, 1.0]], "not positive")],
    ids=str,
)
def test_modes_of_a_mass_that_is_none_are_refused_in_words(mass: Any, said: str) -> None:
    with pytest.raises(fw.InputError, match=said):
        lowest(2, M=np.diag(mass) if np.ndim(mass) == 1 else mass)


def test_modes_without_any_stiffness_are_refused_in_words() -> None:
    with pytest.raises(fw.InputError, match="stiffness matrix is zero"):
        lowest(K=0 * K)


@pytest.mark.parametrize("contacts", [slider([[0.0, 1.0]])[0], "jenkins", None, [None]], ids=type)
def test_contacts_are_a_list_of_contacts(contacts: Any) -> None:
    with pytest.raises(fw.InputError, match="no list of contacts"):
        fw.Model(M, K, contacts=contacts)


@pytest.mark.parametrize("value", ["40", 40 + 0j, {}], ids=str)
def test_a_parameter_is_a_number(value: Any) -> None:
    with pytest.raises(fw.InputError, match="is no number"):
        fw.Model(M, K, contacts=slider([[0.0, 1.0]], tangential_stiffness=value))


def test_parameters_have_names() -> None:
    with pytest.raises(fw.InputError, match="have no names"):
        fw.Contact("jenkins", [[0.0, 1.0]], [40.0, 1.0])


def test_a_structure_of_dictionaries_of_keys_is_a_plain_one() -> None:
    """SciPy's DOK is a dict, as are the matrices of a sector by place."""
    structure = fw.Structure(sp.dok_matrix(M), sp.dok_matrix(K)).sparse()
    assert (structure.n_dof, abs(structure.K - K).max()) == (2, 0.0)


@pytest.mark.parametrize("values", [[1.0], [1.0, 2.0, 3.0], 1.0, [1.0, 1j]], ids=str)
def test_a_vector_has_a_real_number_for_every_dof(values: Any) -> None:
    """Rows beyond were dropped, an imaginary part as well."""
    with fw.Model(M, K) as model:
        for take in (model.vector, model.inertia):
            with pytest.raises(fw.InputError, match="does not fit the model"):
                take(values)


@pytest.mark.ranks(2)
def test_what_one_rank_alone_meets_is_no_matter_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """The others wait in the solver: nothing may be asked of all ranks then."""
    from fretwave import _core
    from fretwave.model import modes

    def fails(*_: object) -> None:
        raise fw.errors.PetscError("of this rank alone")

    monkeypatch.setattr(_core, "linear_modes", fails)
    monkeypatch.setattr(modes, "all_ranks_failed", lambda comm: False)
    monkeypatch.setattr(modes, "_wrong_terms", lambda model: pytest.fail("asked of all ranks"))
    with fw.Model(M, K) as model, pytest.raises(fw.errors.PetscError, match="alone"):
        fw.linear_modes(model, 1)


WAVES: dict[str, dict[str, Any]] = {
    "half a diameter": {"sectors": 6, "nodal_diameter": 1.5},
    "a diameter as float": {"sectors": 6, "nodal_diameter": 1.0},
    "half a sector": {"sectors": 6.5, "nodal_diameter": 1},
    "no sector": {"sectors": 0},
    "minus six": {"sectors": -6, "nodal_diameter": 1},
}


@pytest.mark.parametrize("wave", WAVES)
def test_a_wave_closes_around_the_wheel(wave: str) -> None:
    """Of 1.5 nodal diameters on six sectors there was a frequency."""
    terms: dict[int, Any] = {0: [[3.0]], 1: [[-1.0]], -1: [[-1.0]]}
    with pytest.raises(fw.InputError, match="whole number of times around"):
        fw.Model([[1.0]], terms, **WAVES[wave])
    for diameters in (1.5, 1.0):
        with pytest.raises(fw.InputError, match="whole number of nodal diameters"):
            fw.Sector([[1.0]], terms, 6).model(diameters)  # type: ignore[arg-type]
    with pytest.raises(fw.InputError, match=r"acts on no sector[\s\S]*0\.5"):
        fw.Model([[1.0]], {0: [[3.0]], 0.5: [[-1.0]], -0.5: [[-1.0]]}, sectors=6)  # type: ignore[dict-item]


def test_matrices_of_two_sizes_are_told_by_name() -> None:
    with pytest.raises(fw.InputError, match="M does not have the size of the other matrices") as error:
        fw.Model(np.eye(2), np.eye(3))
    assert (error.value.measured, error.value.expected) == ("2 x 2", "3 x 3")
