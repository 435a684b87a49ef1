#!/usr/bin/env python3
"""Writes the lap joint's deck for CalculiX: joint.inp, or with --ties one that gives the frequencies of a limit.

    python3 deck.py > joint.inp                  # what the case begins with: two plates that do not touch
    python3 deck.py --ties stuck > stuck.inp     # pairs joined by equations in x, y, z; "sliding" in z alone
    python3 deck.py --springs stuck > stuck.inp  # by springs of the case's contact stiffness instead
    python3 deck.py --second 24 6 2 > other.inp  # another mesh of the second plate: faces that do not match

Steel in mm, t, s. Plates of 160 x 20 x 4 mm, the second on the first from x = 120 mm on; the first is held at x = 0.
"""

import argparse

SIZE = (160.0, 20.0, 4.0)
BEGINS = ((0.0, 0.0, 0.0), (120.0, 0.0, 4.0))
CONTACT_STIFFNESS = 1e5  # N/mm, as in case.toml


class Plate:
    """Nodes and elements of one plate, numbers counted on from those before."""

    def __init__(self, begin, cells, node, element):
        self.cells, points = cells, [n + 1 for n in cells]
        self.number = {}
        for k in range(points[2]):
            for j in range(points[1]):
                for i in range(points[0]):
                    self.number[i, j, k] = node + len(self.number)
        steps = [size / n for size, n in zip(SIZE, cells)]
        self.nodes = {n: [b + s * p for b, s, p in zip(begin, steps, ijk)] for ijk, n in self.number.items()}
        boxes = [(i, j, k) for k in range(cells[2]) for j in range(cells[1]) for i in range(cells[0])]
        self.elements = {element + e: self.corners(*box) for e, box in enumerate(boxes)}

    def corners(self, i, j, k):
        """In the order of C3D8."""
        square = ((0, 0), (1, 0), (1, 1), (0, 1))
        return [self.number[i + a, j + b, k + c] for c in (0, 1) for a, b in square]

    def where(self, wanted):
        """Numbers of the nodes whose place fits."""
        return [n for n, x in self.nodes.items() if wanted(*x)]


def lines(numbers):
    """Up to ten numbers a line."""
    return [", ".join(map(str, numbers[k : k + 10])) for k in range(0, len(numbers), 10)]


def face(name, plate, side, layer):
    """The overlap's face of a plate: a surface by elements, and a set of its nodes."""
    nodes = plate.where(lambda x, y, z: 120 - 1e-9 <= x <= 160 + 1e-9 and abs(z - 4) < 1e-9)
    over = [e for e, corners in plate.elements.items() if sum(n in nodes for n in corners) == 4]
    text = [f"*NSET, NSET={name}", *lines(nodes), f"*ELSET, ELSET=E{name}", *lines(over)]
    return nodes, [*text, f"*SURFACE, NAME={layer}, TYPE=ELEMENT", f"E{name}, {side}"]


def equations(pairs, directions):
    """The nodes of each pair move alike in these directions."""
    return [f"*EQUATION\n2\n{a}, {d}, 1., {b}, {d}, -1." for a, b in pairs for d in directions]


def springs(pairs, directions, first):
    """One spring a pair and direction."""
    text = []
    for d in directions:
        text.append(f"*ELEMENT, TYPE=SPRING2, ELSET=SPRING{d}")
        text += [f"{first + len(pairs) * d + k}, {a}, {b}" for k, (a, b) in enumerate(pairs)]
        text.append(f"*SPRING, ELSET=SPRING{d}\n{d}, {d}\n{CONTACT_STIFFNESS}")
    return text


def deck(told):
    """All lines."""
    first = Plate(BEGINS[0], (16, 4, 1), 1, 1)
    second = Plate(BEGINS[1], tuple(told.second), 1 + len(first.nodes), 1 + len(first.elements))
    text = ["*HEADING", "Lap joint of two steel plates (mm, t, s); written by deck.py", "*NODE, NSET=ALL"]
    for plate in (first, second):
        text += [f"{n}, {x:.12g}, {y:.12g}, {z:.12g}" for n, (x, y, z) in plate.nodes.items()]
    text.append("*ELEMENT, TYPE=C3D8I, ELSET=PLATES")
    for plate in (first, second):
        text += [f"{e}, " + ", ".join(map(str, corners)) for e, corners in plate.elements.items()]
    text += ["*NSET, NSET=HELD", *lines(first.where(lambda x, y, z: x == 0))]
    a, upper = face("A", first, "S2", "UPPER")
    b, lower = face("B", second, "S1", "LOWER")
    text += upper + lower
    pairs = list(zip(a, b))
    directions = (1, 2, 3) if "stuck" in (told.ties, told.springs) else (3,)
    text += ["*MATERIAL, NAME=STEEL", "*ELASTIC", "210000., 0.3", "*DENSITY", "7.85e-9"]
    text += ["*SOLID SECTION, ELSET=PLATES, MATERIAL=STEEL", "*BOUNDARY", "HELD, 1, 3"]
    text += equations(pairs, directions) if told.ties else []
    text += springs(pairs, directions, 10000) if told.springs else []
    limit = told.ties or told.springs
    text += ["*STEP", "*FREQUENCY" if limit else "*FREQUENCY, SOLVER=MATRIXSTORAGE", "6", "*END STEP"]
    return text


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ties", choices=["stuck", "sliding"], help="join the pairs by equations")
    parser.add_argument("--springs", choices=["stuck", "sliding"], help="join the pairs by springs")
    parser.add_argument("--second", type=int, nargs=3, default=[16, 4, 1], help="cells of the second plate")
    print("\n".join(deck(parser.parse_args())))
