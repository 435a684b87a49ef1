"""Response of the lumped blisk to engine order 4, and the nonlinear mode of that wave at its largest peak.

.venv/bin/python cases/blisk_lumped/engine_order.py
"""

import numpy as np

import fretwave as fw
import model as case

ORDER, DISK = 4, case.DOFS.index("disk")
with case.sector().model(ORDER) as model:  # an engine order below half the sectors drives the wave of its own number
    stuck, harmonics = fw.linear_modes(model, 3)[-1], fw.choose_harmonics(model, 3, 20 * case.SECTORS)
    mode = fw.follow(fw.NonlinearMode(model, harmonics, "EPMC", DISK, stuck), 2e-5, 1e-2)
    for level in (20.0, 100.0, 300.0):  # [N] on the disk of each sector
        force = {1: np.eye(model.n_dof)[DISK]}
        response = fw.follow(
            fw.ForcedResponse(model, harmonics, force, level, DISK, stuck), 2 * np.pi * 1000, 2 * np.pi * 1080
        )
        peak = response[int(np.argmax(response["amplitude"]))]
        print(f"{level:g} N: peak of {peak['amplitude']:.6g} m at {peak['frequency_hz']:.6g} Hz")
        for found in mode.at(peak["amplitude"]):
            print(f"  mode there: {found['frequency_hz']:.6g} Hz, damping ratio {found['zeta']:.4g}")
