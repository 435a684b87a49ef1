"""Limit cycles of the lumped blisk in flutter: where friction takes what the flow gives, wave by wave on one sector.

.venv/bin/python cases/blisk_lumped/flutter.py
"""

from dataclasses import replace

import numpy as np

import fretwave as fw
import model as case

tuned = case.sector()
flow = {3: -1e-3, 4: -2e-3, 5: 1e-3}  # damping ratios of the waves by the flow alone
for nodal_diameter in flow:
    with tuned.model(nodal_diameter) as model:
        omega = fw.linear_modes(model, 3)[-1].omega
    aerodynamics = fw.Aerodynamics.from_damping(flow, case.SECTORS, omega)
    with replace(tuned, aerodynamics=aerodynamics).model(nodal_diameter) as model:
        start, harmonics = fw.linear_modes(model, 3)[-1], fw.choose_harmonics(model, 9, 20 * case.SECTORS)
        branch = fw.follow(fw.NonlinearMode(model, harmonics, "CNM", case.DOFS.index("disk"), start), 2e-5, 0.1)
    print(
        f"{nodal_diameter} nodal diameters: damping ratio from {branch['zeta'].min():.2g} to {branch['zeta'].max():.2g}"
    )
    for cycle in branch.at(zeta=0.0):
        rises, grows = (np.diff(branch[name][int(cycle["place"]) :][:2])[0] > 0 for name in ("zeta", "amplitude"))
        kind = ("stable" if rises else "unstable") if grows else "perhaps stable"  # or not: the branch runs back
        print(f"  limit cycle {kind} in its own amplitude: {cycle['amplitude']:.6g} m, {cycle['frequency_hz']:.6g} Hz")
