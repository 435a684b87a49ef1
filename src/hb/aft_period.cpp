/// What is read of a motion beside the last one: samples of its period, and what the law says of them.
#include <algorithm>
#include <limits>

#include "hb/aft.h"

namespace fretwave::hb {

/// All pairs at once over the whole period.
contact::Motion Aft::whole(ContactPeriod const& period, Exponents const& e) const {
  contact::Motion motion = this->motion(angular_frequency(e));
  motion.samples = harmonics_.samples();
  motion.u = period.u.data(), motion.v = period.v.data();
  return motion;
}

FourierTransform const& Aft::whole_transform() const {
  if (!continuous_) return transform_;
  if (!whole_transform_)
    whole_transform_ = std::make_shared<FourierTransform>(harmonics_, columns_, law_->components());
  return *whole_transform_;
}

Aft::Found Aft::find(double const* U, Exponents const& e) const {
  Found out;
  ContactPeriod& period = out.samples;
  if (columns_ == 0) return out;
  for (auto* samples : {&period.u, &period.v, &period.f})
    samples->resize(size_t(harmonics_.samples()) * columns_);
  out.F.resize(size_t(columns_) * harmonics_.block_size());
  std::vector<double> V(out.F.size());
  multiply(harmonics_, e.s, U, V.data(), columns_);
  whole_transform().to_time(U, period.u.data());
  whole_transform().to_time(V.data(), period.v.data());
  if (continuous_) {
    out.exact = continuous_force(harmonics_, *law_);
    out.exact->force(U, V.data(), out.F.data());
    out.exact->sample(harmonics_.samples(), period.u.data(), period.v.data(), period.f.data());
    period.unclosed = out.exact->unclosed();
    return out;
  }
  contact::Record record;
  law_->force(whole(period, e), period.f.data(), record);
  whole_transform().to_harmonics(period.f.data(), out.F.data());
  return out;
}

ContactPeriod Aft::period(double const* U, Exponents const& e) const {
  Found found = find(U, e);
  if (columns_ == 0) return std::move(found.samples);
  std::vector<double> gap(size_t(harmonics_.samples()) * pairs_, std::numeric_limits<double>::quiet_NaN());
  contact::Diagnosis told = diagnosis(found, e, false, std::move(gap));
  ContactPeriod out = std::move(found.samples);
  out.status = std::move(told.status), out.gap = std::move(told.gap);
  out.work = std::move(told.work), out.shares = std::move(told.shares);
  return out;
}

contact::Diagnosis Aft::diagnosis(Found const& found, Exponents const& e, bool archard,
                                  std::vector<double> gap) const {
  const contact::Motion whole = this->whole(found.samples, e);
  contact::Diagnosis out{std::vector<contact::Status>(size_t(whole.samples) * pairs_),
                         std::vector<double>(pairs_),
                         std::vector<double>(pairs_),
                         std::vector<double>(archard ? pairs_ : 0),
                         std::move(gap),
                         std::vector<double>(3 * size_t(pairs_))};
  law_->diagnose(whole, found.samples.f.data(), out);
  for (size_t k = 0; k < out.status.size(); ++k) out.shares[size_t(out.status[k]) * pairs_ + k % pairs_] += 1;
  for (double& share : out.shares) share /= whole.samples;
  if (found.exact) found.exact->measure(out, angular_frequency(e));
  return out;
}

Wearing Aft::wearing(double const* U, Exponents const& e) const {
  const std::vector<double> none(pairs_, 0.0);
  Wearing out{none, none, none, none};
  if (columns_ == 0 || !law_->wears() || law_->normal() < 0) return out;
  const Found found = find(U, e);
  const contact::Diagnosis told = diagnosis(found, e, true);
  out.archard = told.archard;
  std::copy_n(&told.shares[pairs_], pairs_, out.slip.data());
  std::copy_n(&told.shares[2 * size_t(pairs_)], pairs_, out.open.data());
  for (int i = 0; i < pairs_; ++i)
    out.load[i] = found.F[(size_t(i) * law_->components() + law_->normal()) * harmonics_.block_size()];
  return out;
}

namespace {

void count(contact::Diagnosis const& diagnosis, ContactSummary& summary) {
  double* shares[] = {&summary.stick, &summary.slip, &summary.open};
  const size_t pairs = diagnosis.work.size();
  for (size_t k = 0; k < 3 * pairs; ++k) *shares[k / pairs] += diagnosis.shares[k];
  for (double w : diagnosis.work) summary.work += w;
  for (double path : diagnosis.slip_path) summary.path = std::max(summary.path, path);
}

}  // namespace

/// Force of the same motion on twice the samples; the same force where there are none.
std::vector<double> Aft::on_doubled_samples(double const* U, Exponents const& e, std::vector<double> F) {
  if (continuous_) return F;
  if (!doubled_)
    doubled_ = std::make_shared<Aft>(Harmonics(harmonics_.orders(), 2 * harmonics_.samples()), law_);
  doubled_->force(U, e, F.data());
  return F;
}

ContactSummary Aft::summarise(double const* U, Exponents const& e) {
  ContactSummary summary;
  if (columns_ == 0) return summary;
  const Found found = find(U, e);
  std::tie(summary.truncated, summary.total) =
      whole_transform().truncated_energy(found.samples.f.data(), found.F.data());
  summary.unclosed = found.samples.unclosed;
  count(diagnosis(found, e, false), summary);
  const std::vector<double> finer = on_doubled_samples(U, e, found.F);
  const size_t m = harmonics_.block_size(), mean = harmonics_.orders()[0] == 0;
  for (size_t k = 0; k < finer.size(); ++k) {
    const double F = found.F[k];
    summary.aliased += (finer[k] - F) * (finer[k] - F);
    summary.retained += k % m < mean ? 0 : F * F;
  }
  return summary;
}

}  // namespace fretwave::hb
