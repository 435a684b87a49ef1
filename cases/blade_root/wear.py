"""How the flanks of the blade root wear at one amplitude of the first bending: a coarse mesh, reduced.

.venv/bin/python cases/blade_root/wear.py
"""

import fretwave as fw
import model as case

MESH = {"axial_cells": 6, "thickness_cells": 1, "radial_cells": (2, 1, 1, 2, 11)}
blade = case.build(speed_rpm=1500.0, **MESH)
reduction = fw.reduce(blade.M, blade.K, 2e-6 * blade.K, keep=blade.kept, modes=10)
small = blade.reduced(reduction)
root = fw.Contact("coulomb_3d", small.pairs["root"], {"friction_coefficient": 0.5}, "root")
with small.model([root]) as model:
    stuck, harmonics = fw.linear_modes(model, 1)[0], fw.choose_harmonics(model, 3, 64, "all")
    rest, dof = fw.balanced(model, stuck), small.dof("tip")
    mode = fw.NonlinearMode(model, harmonics, "CNM", dof, stuck, rest=rest)
    branch = fw.follow(mode, 3e-4, 1.2e-3, steps=fw.StepControl(initial=0.2, maximum=0.4))
    control = fw.WearControl(tolerance=5e-3, pressure_change=0.4)
    worn = fw.wear(branch, 1.1e-3, 1e-14, {"root": root.pairs.areas}, 2.0, control=control, report_at=[1.0])
for row, volume in zip(worn, worn.volume):
    print(f"{row['cycles']:g} cycles: {row['frequency_hz']:.9g} Hz, zeta {row['zeta']:.6g}, worn {volume:.6g} m^3")
