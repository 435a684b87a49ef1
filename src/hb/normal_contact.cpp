#include "hb/normal_contact.h"

#include "hb/indicator.h"

namespace fretwave::hb {

void NormalContact::take(Harmonics const& h, contact::LinearPair const& law, double const* u) {
  stiffness = law.normal_stiffness;
  approach = series(h, u);
  approach.q[0] = law.interference() + mean(h, u);
}

void NormalContact::find_spans(double const* approach_at, int count) {
  std::vector<Root> roots;
  find_roots(approach, 0, approach_at, count, roots);
  closed = roots.empty() && approach_at[0] > 0;
  spans = positive_spans(roots);
}

double NormalContact::length() const {
  double sum = closed ? period : 0;
  for (Span const& span : spans) sum += span.length;
  return sum;
}

void NormalContact::add_force(Harmonics const& h, double* F) const {
  if (closed) {
    add_series(h, approach, stiffness, F);
    add_mean(h, stiffness * approach.q[0].real(), F);
    return;
  }
  Indicator during(h);
  Arc arc;
  for (Span const& span : spans) {
    arc.set(2 * h.highest(), span.begin, span.length);
    during.add(arc, 1);
    add_mean(h, stiffness * arc.integral(approach) / period, F);
  }
  during.add_product(approach, stiffness, F);
}

/// The force is continuous where the state changes, so that the times of the changes leave the derivative.
void NormalContact::add_blocks(Harmonics const& h, double* D, size_t ld, double* by_gap) const {
  Indicator during(h);
  if (closed) during.fill();
  Arc arc;
  for (Span const& span : spans) {
    arc.set(2 * h.highest(), span.begin, span.length);
    during.add(arc, 1);
  }
  during.add_multiplication(stiffness, D, ld);
  during.add_coefficients(-stiffness, by_gap);
}

}  // namespace fretwave::hb
