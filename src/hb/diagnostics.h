#pragma once
#include "hb/harmonic_problem.h"

/// What is read from a point of a harmonic problem beside its scalars, and what contacts are told there. All
/// collective.
namespace fretwave::hb {

/// Contact of the motion, summed over ranks.
ContactSummary summarise(HarmonicProblem&, Vec y);
/// This rank's contact samples, one per contact.
std::vector<ContactPeriod> contact_periods(HarmonicProblem&, Vec y);
std::vector<Wearing> wearing(HarmonicProblem&, Vec y);
EnergyBalance energy(HarmonicProblem&, Vec y);
double mechanical_energy(HarmonicProblem&, Vec y);
/// dr for gaps that grow by dgap [length], the derivative of r by worn depths.
VecHandle gap_product(HarmonicProblem&, Vec y, PerContact const& dgap);
/// Amplitudes tau of the unfolding, as shares of the inertia force k_ref a of a unit motion; none if not
/// unfolded.
std::vector<double> unfolding_amplitudes(HarmonicProblem&, Vec y);
/// The laws start their march from the static state at y (Residual::settle).
void settle(HarmonicProblem&, Vec y, PerContact const& from = {});
/// Sliders at rest (AtRest::stand), also in the laws at once.
void stand(HarmonicProblem&, PerContact sliders);
/// Unknowns or equations of a problem as those of the same one on another set of harmonics: what is new is
/// zero.
VecHandle embedded(HarmonicProblem const& from, HarmonicProblem const& to, Vec x);

}  // namespace fretwave::hb
