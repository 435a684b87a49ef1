#include "hb/diagnostics.h"

#include <algorithm>

namespace fretwave::hb {

namespace {

/// Its terms linearised at y, which costs nothing where they are already.
Residual& linearised(HarmonicProblem& problem, Vec y) {
  VecHandle unused = problem.equations();
  problem.residual(y, unused);
  return problem.terms();
}

}  // namespace

ContactSummary summarise(HarmonicProblem& problem, Vec y) {
  return problem.terms().summarise(problem.coefficients(y), problem.scaled(y).exponents);
}

std::vector<ContactPeriod> contact_periods(HarmonicProblem& problem, Vec y) {
  return problem.terms().periods(problem.coefficients(y), problem.scaled(y).exponents);
}

std::vector<Wearing> wearing(HarmonicProblem& problem, Vec y) {
  return problem.terms().wearing(problem.coefficients(y), problem.scaled(y).exponents);
}

EnergyBalance energy(HarmonicProblem& problem, Vec y) { return linearised(problem, y).energy(); }

double mechanical_energy(HarmonicProblem& problem, Vec y) {
  return problem.terms().mechanical_energy(problem.coefficients(y), problem.scaled(y).exponents);
}

VecHandle gap_product(HarmonicProblem& problem, Vec y, PerContact const& dgap) {
  Residual& terms = linearised(problem, y);
  VecHandle dR = terms.vector(), out = problem.equations();
  terms.gap_product(dgap, dR);
  check(VecSet(out, 0));
  const ReadArray in(dR);
  const double scale = 1 / (problem.stiffness_scale() * problem.scaled(y).amplitude);
  std::transform(in.data(), in.data() + local_size(dR), WriteArray(out).data(),
                 [&](double r) { return scale * r; });
  return out;
}

std::vector<double> unfolding_amplitudes(HarmonicProblem& problem, Vec y) {
  const auto z = problem.scalars(y);
  return {z.end() - problem.unfolding().count(), z.end()};
}

void settle(HarmonicProblem& problem, Vec y, PerContact const& from) {
  problem.terms().settle(problem.coefficients(y), from);
}

void stand(HarmonicProblem& problem, PerContact sliders) {
  problem.at_rest().stand(std::move(sliders));
  problem.at_rest().place(problem.terms());
}

VecHandle embedded(HarmonicProblem const& from, HarmonicProblem const& to, Vec x) {
  return embedded(from.model(), from.harmonics(), to.harmonics(), x);
}

}  // namespace fretwave::hb
