"""Largest damping of the oscillator over the friction limit, with a regularisation that grows with it.

.venv/bin/python cases/two_dof/sweep.py
"""

import fretwave as fw

M, K = [[1.0, 0.0], [0.0, 0.02]], [[640.0, -40.0], [-40.0, 40.0]]


def backbone(limit):  # [N]
    law = {"friction_limit": limit, "regularisation_velocity": 0.01 * limit}
    damper = fw.Contact("regularised_coulomb", [[0.0, 1.0]], law)
    model = fw.Model(M, K, contacts=[damper])
    mode = fw.NonlinearMode(model, fw.choose_harmonics(model, 7, 256), "CNM", dof=0)
    return fw.follow(mode, 0.004 * limit, 0.6 * limit)


found = fw.sweep(backbone, limit=[1.0, 5.0, 25.0])
print(found)
for values, branch in found:
    peak = branch[branch.met("peak_damping")[0]]
    print(f"{values['limit']:g} N: {100 * peak['zeta']:.9g} % at {peak['amplitude']:.9g} m")
