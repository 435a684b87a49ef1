#include "wheel/wave_basis.h"

#include <algorithm>
#include <cmath>

#include "lapack.h"
#include "model/stuck_basis.h"

namespace fretwave::wheel {

namespace {

using lapack::multiply;

/// M := U of M x = theta K x, U^H K U = 1; false if K is not positive definite.
bool solve_pencil(std::vector<complex> K, std::vector<complex>& M, std::vector<double>& theta) {
  const int n = int(theta.size()), type = 1, ask = -1;
  complex size;
  double reals;
  int ints, info;
  zhegvd_(&type, "V", "U", &n, M.data(), &n, K.data(), &n, theta.data(), &size, &ask, &reals, &ask, &ints,
          &ask, &info);
  std::vector<complex> work(static_cast<size_t>(size.real()));
  std::vector<double> real_work(static_cast<size_t>(reals));
  std::vector<int> places(ints);
  const int room = int(work.size()), real_room = int(real_work.size());
  zhegvd_(&type, "V", "U", &n, M.data(), &n, K.data(), &n, theta.data(), work.data(), &room, real_work.data(),
          &real_room, places.data(), &ints, &info);
  for (double& value : theta) value = std::max(value, 0.0);  // motions without mass
  return info == 0;
}

/// Of modes with the damping C between them: that of each, and the largest of one by all others.
void set_damping(WaveBasis& basis, std::vector<complex> const& U, std::vector<complex> const& C) {
  const int n = int(basis.theta.size());
  basis.damping.assign(n, 0.0);
  if (C.empty()) return;
  std::vector<complex> CU(C.size()), UCU(C.size());
  multiply("NN", {n, n, n}, 1.0, {C.data(), n}, {U.data(), n}, 0.0, CU.data(), n);
  multiply("CN", {n, n, n}, 1.0, {U.data(), n}, {CU.data(), n}, 0.0, UCU.data(), n);
  for (int j = 0; j < n; ++j) {
    double apart = 0;
    for (int i = 0; i < n; ++i) apart += i == j ? 0 : std::norm(UCU[size_t(j) * n + i]);
    basis.damped_together = std::max(basis.damped_together, std::sqrt(apart));
    basis.damping[j] = UCU[size_t(j) * n + j].real();
  }
}

}  // namespace

WaveBases::WaveBases(model::Model const& model, MeanSector const& mean,
                     std::vector<CirculantBlocks<double>> const& terms, WheelContact const& contact,
                     std::vector<double> const& stuck)
    : model_(model), mean_(mean), terms_(terms), contact_(contact), stuck_(stuck) {
  auto& kept = model.kept_of_waves();
  if (!kept) kept = std::make_shared<Kept>();
  kept_ = std::static_pointer_cast<Kept>(kept);
}

std::shared_ptr<WaveBasis const> WaveBases::of_diameter(int d) {
  if (const auto found = kept_->find(d); found != kept_->end()) return found->second;
  return (*kept_)[d] = found_for(d);
}

std::shared_ptr<WaveBasis const> WaveBases::found_for(int d) const {
  const int n = mean_.dofs(), k = mean_.contact_dofs(), R = contact_.rows();
  std::vector<std::vector<complex>> sums(3);
  for (size_t j = 0; j < terms_.size(); ++j) {
    const auto P = mean_.of_wave(terms_[j], d);
    auto& sum = sums[model_.terms()[j].order];
    sum.resize(P.size());
    for (size_t i = 0; i < P.size(); ++i) sum[i] += P[i];
  }
  auto &K = sums[0], &U = sums[2];
  const auto B = mean_.rows_of(d, contact_);
  for (int j = 0; j < k; ++j)
    for (int i = 0; i < k; ++i)
      for (int r = 0; r < R; ++r)
        K[size_t(j) * n + i] += std::conj(B[size_t(r) * k + i]) * stuck_[r] * B[size_t(r) * k + j];
  auto basis = std::make_shared<WaveBasis>();
  basis->theta.resize(n);
  if (!solve_pencil(std::move(K), U, basis->theta)) return nullptr;
  basis->Phi.resize(size_t(R) * n);  // B is k x R, column-major
  multiply("TN", {R, n, k}, 1.0, {B.data(), k}, {U.data(), n}, 0.0, basis->Phi.data(), R);
  std::vector<double> motions;
  for (complex const& a : basis->Phi) motions.push_back(std::abs(a));
  if (R > 0 && model::too_stiff(motions, stuck_)) return nullptr;
  basis->U.assign(U.begin(), U.end());
  set_damping(*basis, U, sums[1]);
  return basis;
}

}  // namespace fretwave::wheel
