"""Who sticks, slips and is open is said by the law alone: table, picture and view of a run agree with it."""

from __future__ import annotations

import ast
import shutil
from pathlib import Path

import h5py
import matplotlib.colors
import numpy as np
import pytest
from command_line import call
from models import three_pads
from models.three_pads import CONTACT, FRICTION, LIFTED
from models.vtkhdf_files import read_step
from tolerances import LAST_DIGITS, SOLVED

import fretwave as fw
from fretwave.model.law_info import Limit, ParameterInfo, Role
from fretwave.model.laws import forget_law
from fretwave.model.python_law import PythonLaw
from fretwave.plots import faces, style
from fretwave.post.contact_history import OPEN, SLIP, STICK
from fretwave.results.reader import Run

pytestmark = pytest.mark.ranks(1)

PACKAGE = Path(fw.__file__).parent
CASE = """
[model]
builder = "model.py"
mass_damping = 2.0

[preload]
pair_loads = false
loads = ["press"]

[[contact]]
name = "pads"
{contact}

[[analysis]]
name = "rest"
type = "static"

[[analysis]]
name = "mode"
type = "mode"
linear_mode = 2
harmonics = 2
samples = 64
normalise = "across"
amplitude = [1e-8, 1e-7]
"""
COMPILED = (
    f'law = "{{law}}"\nnormal_stiffness = {CONTACT}\ntangential_stiffness = {CONTACT}\n'
    f"friction_coefficient = {FRICTION}\nnormal_load = 30.0"  # which the preload replaces
)


class Foreign(PythonLaw):
    """A pad without memory, each tangent clipped by itself, whose parameters no other file has heard of."""

    name = "foreign_pad"
    components = 3
    limit = Limit.EACH
    stuck_stiffness = CONTACT
    parameters = (
        ParameterInfo("squeeze", "N/m", "along the normal", 0.0, True, None, Role.NORMAL_STIFFNESS),
        ParameterInfo("shear", "N/m", "along the tangents", 0.0, True, None, Role.TANGENTIAL_STIFFNESS),
        ParameterInfo("rub", "-", "friction", 0.0, False, None, Role.FRICTION_COEFFICIENT),
        ParameterInfo("push", "N", "load", 0.0, False, 7.0, Role.LOAD),
        ParameterInfo("air", "m", "gap", -1.0, False, 0.0, Role.GAP),
    )

    def force(self, u, v):
        normal = np.maximum(0.0, self.push + self.squeeze * (u[:, :1] - self.air))
        bound = self.rub * normal
        return np.concatenate([normal, np.clip(self.shear * u[:, 1:], -bound, bound)], axis=1)

    def status(self, u, v, f):
        slips = self.at_limit(np.abs(f[:, 1:]).max(axis=1), self.rub * f[:, 0])
        return np.where(f[:, 0] <= 0, OPEN, np.where(slips, SLIP, STICK))

    def gap(self, u, v, f):
        return np.where(f[:, 0] > 0, 0.0, np.maximum(self.air - u[:, 0] - self.push / self.squeeze, 0.0))


FOREIGN = f'law = "foreign_pad"\nsqueeze = {CONTACT}\nshear = {CONTACT}\nrub = {FRICTION}'
#: Contact entry of the case -> what the three pairs are at rest.
CONTACTS = {
    "coulomb_3d_uncoupled": (COMPILED.format(law="coulomb_3d_uncoupled"), ["stick", "slip", "open"]),
    # |(40, 40)| N = 56.6 N is outside the circle of 50 N
    "coulomb_3d": (COMPILED.format(law="coulomb_3d"), ["slip", "slip", "open"]),
    "foreign_pad": (FOREIGN, ["stick", "slip", "open"]),
}


#: Laws under which the first pair sticks: a motion that is far too small changes no state.
STILL = ["coulomb_3d_uncoupled", "foreign_pad"]


@pytest.fixture(scope="module", autouse=True)
def registered():
    """Known to all cases here."""
    fw.register_law(Foreign)
    yield
    forget_law(Foreign)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Folders of the finished runs, by law."""
    folders = {}
    for law, (contact, _) in CONTACTS.items():
        folder = tmp_path_factory.mktemp(law)
        shutil.copy(three_pads.__file__, folder / "model.py")
        (folder / "case.toml").write_text(CASE.format(contact=contact))
        only = [] if law in STILL else ["--only", "rest"]
        assert call("run", folder / "case.toml", "--out", folder / "run", "--no-plots", *only) == 0
        folders[law] = folder / "run"
    return folders


@pytest.mark.parametrize("law", CONTACTS)
def test_the_static_table_has_the_law_s_word(runs, law: str) -> None:
    folder, words = runs[law], CONTACTS[law][1]
    table = Run(folder).table("rest")
    assert table["status"].tolist() == words
    assert table["gap"] == pytest.approx([0.0, 0.0, LIFTED], rel=SOLVED, abs=1e-18)
    assert table["normal_force"] == pytest.approx([100.0, 100.0, 0.0], rel=SOLVED)
    if words[0] == "stick":
        assert table["tangential_force"][0] == pytest.approx(40 * np.sqrt(2), rel=SOLVED)


@pytest.mark.parametrize("law", STILL)
def test_the_contact_picture_has_the_law_s_word(runs, law: str) -> None:
    """One colour to each disc, that of the pair's state: the motion is far too small to change any."""
    folder, words = runs[law], CONTACTS[law][1]
    data = Run(folder)
    with style.rules():
        figure = faces.draw_map(data.analyses["mode"], "pads")
    discs = [line for line in figure.axes[1].get_lines() if line.get_markerfacecolor() != "none"]
    drawn = {float(line.get_xdata()[0]): line.get_color() for line in discs}
    assert len(discs) == len(drawn) == 3
    for (_, colour), word in zip(sorted(drawn.items()), words):
        assert matplotlib.colors.to_hex(colour) == matplotlib.colors.to_hex(faces.STATUS[word])


@pytest.mark.parametrize("law", STILL)
def test_the_view_has_the_law_s_word(runs, law: str) -> None:
    folder, words = runs[law], CONTACTS[law][1]
    assert call("view", folder, "--analysis", "mode", "--phases", "4") == 0
    number = {"stick": STICK, "slip": SLIP, "open": OPEN}
    for step in range(4):
        found = read_step(folder / "mode_contact.vtkhdf", step)
        assert found["status"].tolist() == [number[word] for word in words]
        assert found["gap"] == pytest.approx([0.0, 0.0, LIFTED], rel=SOLVED, abs=1e-18)
        for word in number:
            assert found[f"share_{word}"].tolist() == [float(w == word) for w in words]


@pytest.mark.parametrize("law", STILL)
def test_results_say_which_parameter_has_which_role(runs, law: str) -> None:
    """Pictures find stiffness and friction in a finished run without asking the core."""
    folder = runs[law]
    mode = Run(folder).analyses["rest"]
    assert mode.parameter("pads", Role.NORMAL_STIFFNESS) == CONTACT
    assert mode.parameter("pads", Role.FRICTION_COEFFICIENT) == FRICTION
    assert mode.parameter("pads", Role.FRICTION_LIMIT) is None


@pytest.mark.ranks(1, 2)
def test_parameters_of_a_registered_law_go_with_their_pairs(comm) -> None:
    """Each pair its own stiffness and gap, also where the pairs lie on different ranks; the normal at component 0."""
    given = {"squeeze": [2.0, 3.0, 5.0], "shear": 1.0, "rub": 0.4, "push": 0.0, "air": [-0.5, 0.25, 3.0]}
    contact = fw.Contact("foreign_pad", np.eye(9), given)
    model = fw.Model(np.eye(9), 4 * np.eye(9), contacts=[contact], comm=comm)
    start = fw.LinearMode(2.0, 0.0, np.tile([1.0, 0.0, 0.0], 3), np.zeros(9))
    problem = fw.NonlinearMode(model, fw.Harmonics([0, 1], 16), "EPMC", 0, start)
    told = comm.bcast(problem.contact_history(problem.initial(1.0))[0])
    stiffness, gap = np.array(given["squeeze"]), np.array(given["air"])
    assert told["f"][:, 0] == pytest.approx(np.maximum(0.0, stiffness * (told["u"][:, 0] - gap)), abs=LAST_DIGITS)
    assert told["gap"] == pytest.approx(np.maximum(0.0, gap - told["u"][:, 0]), abs=LAST_DIGITS)
    assert np.array_equal(told["status"] == OPEN, told["u"][:, 0] <= gap) and told["status"].dtype == np.int8


@pytest.mark.parametrize("law", STILL)
def test_rows_whose_status_was_not_kept_are_not_called_stuck(runs, law: str, tmp_path, capfd) -> None:
    """Of a run that an earlier version began: no picture and no status rather than a wrong one."""
    folder = runs[law]
    shutil.copytree(folder, tmp_path / "run")
    from fretwave.results.results import rewritten

    with rewritten(tmp_path / "run" / "results.h5", "other") as file:
        file["mode/contact_pads/status"][0] = -1
    assert not Run(tmp_path / "run").analyses["mode"].tells_status("pads")
    assert call("view", tmp_path / "run", "--analysis", "mode", "--point", 0, "--phases", "4") == 0
    assert "contact 'pads' is shown without status" in capfd.readouterr().out
    assert "status" not in read_step(tmp_path / "run" / "mode_contact.vtkhdf", 0)
    assert [name for name, _ in faces.figures(Run(tmp_path / "run"))] == ["rest_load_pads"]


ROLES = {
    "regularised_coulomb": {
        "friction_limit": Role.FRICTION_LIMIT,
        "regularisation_velocity": Role.REGULARISATION,
    },
    "jenkins": {"tangential_stiffness": Role.TANGENTIAL_STIFFNESS, "friction_limit": Role.FRICTION_LIMIT},
    **dict.fromkeys(
        ("coulomb_3d", "coulomb_3d_uncoupled", "coulomb_2d"),
        {
            "normal_stiffness": Role.NORMAL_STIFFNESS,
            "tangential_stiffness": Role.TANGENTIAL_STIFFNESS,
            "friction_coefficient": Role.FRICTION_COEFFICIENT,
            "normal_load": Role.LOAD,
            "gap": Role.GAP,
        },
    ),
    "unilateral_spring": {"normal_stiffness": Role.NORMAL_STIFFNESS, "gap": Role.GAP},
    "cubic_spring": {"cubic_stiffness": Role.NONE},
}


def test_every_law_says_the_roles_of_its_parameters() -> None:
    compiled = {name: law for name, law in fw.laws().items() if name != Foreign.name}
    assert {name: {p.name: p.role for p in law.parameters} for name, law in compiled.items()} == ROLES
    limits = {name: (law.normal, law.limit, law.wears) for name, law in compiled.items()}
    assert limits == {
        "regularised_coulomb": (None, Limit.NONE, False),
        "jenkins": (None, Limit.EACH, False),
        "coulomb_3d": (0, Limit.CIRCLE, True),
        "coulomb_3d_uncoupled": (0, Limit.EACH, True),
        "coulomb_2d": (0, Limit.EACH, True),
        "unilateral_spring": (0, Limit.NONE, False),
        "cubic_spring": (None, Limit.NONE, False),
    }


@pytest.mark.parametrize("law", [name for name in ROLES if name not in ("regularised_coulomb", "cubic_spring")])
def test_stiffnesses_by_role_are_what_a_stuck_pair_has(comm, law: str) -> None:
    """omega^2 = 1 + stiffness of unit masses on unit springs, by component."""
    info = fw.laws()[law]
    size = {Role.NORMAL_STIFFNESS: 8.0, Role.TANGENTIAL_STIFFNESS: 3.0}
    others = {p.name: 1.0 for p in info.parameters if p.role not in size and p.default is None}
    contact = fw.Contact(law, np.eye(info.components), {**others, **info.with_roles(size), **info.closing()})
    with fw.Model(np.eye(info.components), np.eye(info.components), contacts=[contact], comm=comm) as model:
        found = [mode.omega**2 - 1 for mode in fw.linear_modes(model, info.components, "stuck")]
    expected = [size[info.stiffness_along(component)] for component in range(info.components)]
    assert sorted(found) == pytest.approx(sorted(expected), rel=SOLVED)


@pytest.mark.parametrize("law", [name for name in ROLES if name.startswith(("jenkins", "coulomb", "regularised"))])
def test_a_pair_without_friction_does_not_stick_along_its_tangents(law: str) -> None:
    """Of two pairs the first has none."""
    info = fw.laws()[law]
    friction = info.with_roles({Role.FRICTION_COEFFICIENT: [0.0, 0.5], Role.FRICTION_LIMIT: [0.0, 0.5]})
    others = {p.name: 1.0 for p in info.parameters if p.default is None}
    rows = np.eye(2 * info.components)
    contact = fw.Contact(law, rows, {**others, **info.with_roles({Role.LOAD: 1.0}), **friction})
    without, with_friction = contact.stuck_stiffness()
    assert all(with_friction > 0)
    assert [row for row in range(info.components) if without[row] > 0] == [r for r in [info.normal] if r is not None]
    assert (contact.closed().stuck_stiffness() == with_friction).all()


def test_a_law_may_not_give_two_parameters_one_role() -> None:
    class Twice(Foreign):
        name = "twice"
        parameters = (*Foreign.parameters, ParameterInfo("again", "N", "a second load", role=Role.LOAD))

    with pytest.raises(fw.InputError, match="one role"):
        fw.register_law(Twice)


def test_a_law_may_not_take_the_name_of_a_compiled_one() -> None:
    class Own(Foreign):
        name = "jenkins"

    with pytest.raises(fw.InputError, match="of this name"):
        fw.register_law(Own)


#: Where a name may stand: the laws' modules, and where the keys that users write are shown to them.
KNOWN = {"model/laws.py", "model/law_info.py", "case/schema.py", "commands/main.py"}
#: The distance of an open pair is a result too, a column and a field of that name.
RESULTS = {
    ("gap", name)
    for name in (
        *("analyses/static.py", "view/contact.py", "post/contact_history.py", "solve/preload.py"),
        "report/findings.py",
    )
}


def literals(path: Path) -> list[tuple[str, int]]:
    """Texts of a module that are no docstrings, with their lines."""
    tree = ast.parse(path.read_text())
    bare = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    return [
        (node.value, node.lineno)
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in bare
    ]


def test_no_other_module_knows_laws_or_parameters_by_name() -> None:
    names = set(ROLES) | {name for roles in ROLES.values() for name in roles}
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        place = path.relative_to(PACKAGE).as_posix()
        if place in KNOWN:
            continue
        for text, line in literals(path):
            # "gap" is an English word: alone it names the parameter, within a sentence it does not
            words = {name for name in names if name in text} - {"gap"} | ({text} & names)
            found += [f"{place}:{line}: {name}" for name in words if (name, place) not in RESULTS]
    assert not found


def test_the_search_for_names_finds_them(tmp_path) -> None:
    (tmp_path / "a.py").write_text('"""On jenkins."""\nx = f"{y}/friction_limit"  # gap\n"""coulomb_3d"""\n')
    assert [text for text, _ in literals(tmp_path / "a.py")] == ["/friction_limit"]


@pytest.mark.parametrize("law", STILL)
def test_status_in_results_is_what_the_law_says_of_the_forces_there(runs, law: str) -> None:
    """Kept status and gap are the law's answer to the kept displacements, velocities and forces."""
    folder = runs[law]
    from fretwave.case.build import acting_parameters
    from fretwave.case.load import load_case

    case = load_case(folder.parent / "case.toml")
    spec = case.contacts[0]
    contact = fw.Contact(spec.law, spec.pairs, acting_parameters(spec, case.preload_of(case.analyses["mode"])))
    with h5py.File(folder / "results.h5") as file:
        group = {key: data[()] for key, data in file["mode/contact_pads"].items()}
    assert len(group["u"]) > 1
    for row in range(len(group["u"])):
        status, gap = contact.states(*(group[key][row] for key in "uvf"))
        assert np.array_equal(status, group["status"][row])
        assert np.array_equal(gap, group["gap"][row])
