"""Sizes of a reduced model where nothing is said. Scripts and case files take them from here."""

#: Component modes beside the kept dofs.
COMPONENT_MODES = 10
#: Linear modes compared with the unreduced model.
COMPARED_MODES = 5
#: Waves of each nodal diameter, stuck and as many sliding, that give a sector's interface modes.
INTERFACE_WAVES = 10
#: Singular values of interface modes that are kept, over the largest.
INTERFACE_TOLERANCE = 1e-5
