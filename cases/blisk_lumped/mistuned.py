"""Mode of the wheel with blades of 2 % scattered stiffness: which blade moves most, and by how much more than tuned.

.venv/bin/python cases/blisk_lumped/mistuned.py
"""

import fretwave as fw
import model as case

DIAMETERS, TIP, N = 4, case.DOFS.index("tip"), case.SECTORS
tuned = case.sector()
with tuned.model(DIAMETERS) as model:
    wave = fw.linear_modes(model, 2)[-1]  # the blades' second family
shape, scatter = fw.WheelShape.of(tuned, TIP, wave), fw.deviations(N, 0.02, seed=1)
with tuned.wheel(changes={"K": [part * case.blade_stiffness() for part in scatter]}) as wheel:
    modes = fw.linear_modes(wheel, N, near=wave.omega)
    start = fw.most_alike(modes, tuned.around(wave, DIAMETERS), tuned)
    largest = shape(start.shape)["largest_sector"]
    harmonics = fw.choose_harmonics(wheel, 1, 20 * N)
    mode = fw.NonlinearMode(wheel, harmonics, "CNM", tuned.n_dof * largest + TIP, start)
    branch = fw.follow(mode, 1e-2, 0.2, steps=fw.StepControl(maximum=0.3), report_at=[3.5e-2])
    for row in (0, *branch.met("report"), -1):
        told = shape(branch.shape(row % len(branch)))
        print(f"{branch[row]['amplitude']:.6g} m: {branch[row]['frequency_hz']:.9g} Hz, zeta {branch[row]['zeta']:.6g}")
        print(f"  blade {told['largest_sector']}: amplification {told['amplification']:.9g}")
