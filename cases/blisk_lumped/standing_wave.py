"""Standing wave of four nodal diameters on the tuned wheel, against the travelling one of the same amplitude.

.venv/bin/python cases/blisk_lumped/standing_wave.py
"""

import fretwave as fw
import model as case

DIAMETERS, DISK, N = 4, case.DOFS.index("disk"), case.SECTORS
tuned = case.sector()
with tuned.model(DIAMETERS) as model:
    wave = fw.linear_modes(model, 3)[-1]
starts = {
    "travelling": fw.travelling_wave(wave, DIAMETERS, N),
    "standing": fw.standing_wave(wave, DIAMETERS, N, DISK),
}
shape = fw.WheelShape.of(tuned, DISK, wave)
with tuned.wheel() as wheel:
    for name, (start, other) in starts.items():
        harmonics = fw.choose_harmonics(wheel, 1, 20 * N)
        mode = fw.NonlinearMode(wheel, harmonics, "CNM", DISK, start, avoid=other)
        branch = fw.follow(mode, 1e-4, 1e-2, steps=fw.StepControl(maximum=0.3), report_at=[3e-4])
        for at in branch.at([1e-4, 3e-4, 1e-2]):
            ratio = shape(branch.shape(at["place"]))["participation"]
            print(f"{name} {at['amplitude']:g} m: {at['frequency_hz']:.9g} Hz, zeta {at['zeta']:.6g}, {ratio:.9g}")
