#include "contact/law.h"

#include <algorithm>
#include <cstddef>
#include <stdexcept>

namespace fretwave::contact {

namespace {

/// df += G dx with G samples x components x components x pairs.
void add_tangent_product(Motion const& motion, std::vector<double> const& tangent, double const* dx,
                         double* df) {
  const int d = motion.components, n = motion.pairs;
  for (int t = 0; t < motion.samples; ++t)
    for (int row = 0; row < d; ++row)
      for (int col = 0; col < d; ++col) {
        double const* g = tangent.data() + (size_t(t * d + row) * d + col) * n;
        double const* x = dx + size_t(t * d + col) * n;
        double* y = df + size_t(t * d + row) * n;
#pragma omp simd
        for (int i = 0; i < n; ++i) y[i] += g[i] * x[i];
      }
}

}  // namespace

void Law::force(Motion const&, double*, Record&) const {
  throw std::logic_error("this contact law is not known by samples");
}

void Law::product(Motion const& motion, Record const& record, double const* du, double const* dv,
                  double* df) const {
  std::fill_n(df, motion.size(), 0.0);
  if (du && !record.df_du.empty()) add_tangent_product(motion, record.df_du, du, df);
  if (dv && !record.df_dv.empty()) add_tangent_product(motion, record.df_dv, dv, df);
}

Diagnosis states(Law const& law, Motion const& motion, double const* f) {
  const size_t n = motion.pairs, all = n * motion.samples;
  Diagnosis out{std::vector<Status>(all), std::vector<double>(n), std::vector<double>(n)};
  out.gap.assign(all, std::numeric_limits<double>::quiet_NaN());
  law.diagnose(motion, f, out);
  return out;
}

void set_shares(Diagnosis& diagnosis, size_t pair, double contact, double slip) {
  const size_t n = diagnosis.work.size();
  if (contact == 1 && slip == 0) {
    if (diagnosis.shares[n + pair] == 1) return;
    for (size_t row = pair; row < diagnosis.status.size(); row += n) diagnosis.status[row] = Status::stick;
  }
  const double shares[] = {std::max(0.0, contact - slip), slip, std::max(0.0, 1 - contact)};
  for (size_t state = 0; state < 3; ++state) diagnosis.shares[state * n + pair] = shares[state];
}

void add_work(Motion const& motion, double const* f, std::vector<double>& work) {
  if (!motion.v) return;
  for (int row = 0; row < motion.samples * motion.components; ++row)
    for (int i = 0; i < motion.pairs; ++i)
      work[i] += f[size_t(row) * motion.pairs + i] * motion.v[size_t(row) * motion.pairs + i] * motion.step;
}

}  // namespace fretwave::contact
