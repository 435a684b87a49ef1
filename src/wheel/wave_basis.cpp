#include "wheel/wave_basis.h"

#include <algorithm>
#include <cmath>

#include "lapack.h"
#include "model/stuck_basis.h"
#include "together.h"
#include "tuned.h"
#include "wheel/lowest_waves.h"

namespace fretwave::wheel {

namespace {

using lapack::multiply;

const Tuned whole("wheel_whole", 1000, "dofs of a sparse sector up to which its waves have all modes");
const Tuned dense("wheel_dense", 0.25, "share of nonzero entries from which a sector is dense");
const Tuned lowest("wheel_modes", 40, "modes of a wave beside the factor of a large sector");

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

}  // namespace

WaveBases::WaveBases(model::Model const& model, MeanSector const& mean,
                     std::vector<Circulant<SparseBlock>> const& terms, WheelContact const& contact,
                     std::vector<double> const& stuck)
    : mean_(mean), contact_(contact), stuck_(stuck) {
  for (size_t j = 0; j < terms.size(); ++j) {
    auto& to = of_order_[model.terms()[j].order];
    to = to.empty() ? terms[j] : sum(to, 1, terms[j]);
  }
  of_order_[0] = sum(of_order_[0], 1, of_springs());
  auto& kept = model.kept_of_waves();
  if (!kept) kept = std::make_shared<Kept>();
  kept_ = std::static_pointer_cast<Kept>(kept);
}

/// B^T k B
Circulant<SparseBlock> WaveBases::of_springs() const {
  std::map<int, std::map<std::pair<int, int>, double>> sums;
  std::vector<std::vector<WheelContact::Entry>> by_row(contact_.rows());
  for (auto const& b : contact_.entries()) by_row[b.row].push_back(b);
  for (int r = 0; r < contact_.rows(); ++r)
    for (auto const& a : by_row[r])
      for (auto const& b : by_row[r])
        sums[(b.ahead - a.ahead + mean_.sectors()) % mean_.sectors()]
            [{mean_.place(a.dof), mean_.place(b.dof)}] += a.value * stuck_[r] * b.value;
  Circulant<SparseBlock> out;
  for (auto const& [k, entries] : sums) {
    SparseBlock& block = out[k];
    for (auto const& [at, value] : entries) {
      block.first.resize(size_t(at.first) + 1, int(block.columns.size()));
      block.columns.push_back(at.second), block.values.push_back(value);
    }
    block.first.resize(size_t(mean_.dofs()) + 1, int(block.columns.size()));
  }
  return out;
}

bool WaveBases::large() const {
  double entries = 0;
  for (auto const& [k, A] : of_order_[0]) entries += double(A.values.size());
  const double n = mean_.dofs();
  return n > whole && entries < dense * n * n;
}

void WaveBases::prepare(std::vector<int> const& diameters, MPI_Comm comm) {
  if (large() && !kept_->factor)
    kept_->factor = std::make_shared<SectorFactor>(of_order_[0], mean_.sectors(), comm);
  const int ranks = comm_size(comm), all = mean_.sectors() / 2 + 1;
  std::vector<int> lacking(all, 0), missing;
  for (const int d : diameters) lacking[d] = !kept_->bases.contains(d);
  const std::vector<int> own = lacking;
  MPI_Allreduce(MPI_IN_PLACE, lacking.data(), all, MPI_INT, MPI_MAX, comm);
  for (int d = 0; d < all; ++d)
    if (lacking[d]) missing.push_back(d);
  std::map<int, std::shared_ptr<WaveBasis>> made;
  together(comm, "finding the waves' modes", [&] {
    bool fit = true;  // one that is none leaves the others without use
    for (size_t k = size_t(comm_rank(comm)); k < missing.size() && fit; k += size_t(ranks))
      fit = bool(made[missing[k]] = large() ? lowest_of(missing[k]) : all_of(missing[k]));
  });
  for (size_t k = 0; k < missing.size(); ++k) {
    const int d = missing[k];
    const auto basis = shared(std::move(made[d]), d, int(k) % ranks, comm);
    if (own[d]) kept_->bases[d] = basis;
  }
}

/// One rank's on all. Collective.
std::shared_ptr<WaveBasis> WaveBases::shared(std::shared_ptr<WaveBasis> basis, int d, int from,
                                             MPI_Comm comm) const {
  int is_basis = bool(basis);
  MPI_Bcast(&is_basis, 1, MPI_INT, from, comm);
  if (!is_basis || comm_size(comm) == 1) return basis;
  if (!basis) basis = std::make_shared<WaveBasis>();
  broadcast(basis->U, from, comm), broadcast(basis->Phi, from, comm), broadcast(basis->theta, from, comm);
  broadcast(basis->damping, from, comm);
  MPI_Bcast(&basis->damped_together, 1, MPI_DOUBLE, from, comm);
  broadcast(basis->static_shapes, from, comm), broadcast(basis->static_compliance, from, comm);
  if (large()) kept_->factor->share(d, from, comm);
  basis->factor = kept_->factor;
  return basis;
}

std::shared_ptr<WaveBasis> WaveBases::all_of(int d) const {
  const int n = mean_.dofs(), k = mean_.contact_dofs(), R = contact_.rows();
  auto K = mean_.of_wave(of_order_[0], d), U = mean_.of_wave(of_order_[2], d);
  const auto B = mean_.rows_of(d, contact_);
  auto basis = std::make_shared<WaveBasis>();
  basis->theta.resize(n);
  if (!solve_pencil(std::move(K), U, basis->theta)) return nullptr;
  basis->Phi.resize(size_t(R) * n);  // B is k x R, column-major
  multiply("TN", {R, n, k}, 1.0, {B.data(), k}, {U.data(), n}, 0.0, basis->Phi.data(), R);
  std::vector<double> motions;
  for (complex const& a : basis->Phi) motions.push_back(std::abs(a));
  if (R > 0 && model::too_stiff(motions, stuck_)) return nullptr;
  basis->U.assign(U.begin(), U.end());
  set_damping(*basis, U, d);
  return basis;
}

std::shared_ptr<WaveBasis> WaveBases::lowest_of(int d) const {
  if (!kept_->factor->take(d)) return nullptr;
  auto found = lowest_waves(*kept_->factor, of_order_[0], of_order_[2], d, lowest.count());
  auto basis = std::make_shared<WaveBasis>();
  const int m = int(found.theta.size()), n = mean_.dofs(), R = contact_.rows();
  basis->factor = kept_->factor;
  basis->theta = std::move(found.theta);
  basis->Phi.resize(size_t(R) * m);
  for (auto const& b : contact_.entries())
    for (int l = 0; l < m; ++l)
      basis->Phi[size_t(l) * R + b.row] +=
          b.value * mean_.turn(b.ahead, d) * found.U[size_t(l) * n + mean_.place(b.dof)];
  if (!set_static(*basis, d)) return nullptr;
  set_damping(*basis, found.U, d);
  basis->U.assign(found.U.begin(), found.U.end());
  return basis;
}

/// K_s^-1 B^H and B K_s^-1 B^H; false where springs are far stiffer than the structure.
bool WaveBases::set_static(WaveBasis& basis, int d) const {
  const size_t n = size_t(mean_.dofs()), R = size_t(contact_.rows());
  std::vector<complex> W(n * R);
  for (auto const& b : contact_.entries())
    W[size_t(b.row) * n + size_t(mean_.place(b.dof))] += std::conj(b.value * mean_.turn(b.ahead, d));
  if (R > 0) basis.factor->solve(std::vector<int>(R, d), W.data());
  basis.static_compliance.assign(R * R, 0.0);
  for (auto const& b : contact_.entries())
    for (size_t r = 0; r < R; ++r)
      basis.static_compliance[r * R + size_t(b.row)] +=
          b.value * mean_.turn(b.ahead, d) * W[r * n + size_t(mean_.place(b.dof))];
  std::vector<double> motions;
  for (size_t r = 0; r < R; ++r) motions.push_back(std::sqrt(basis.static_compliance[r * R + r].real()));
  basis.static_shapes.assign(W.begin(), W.end());
  return R == 0 || !model::too_stiff(motions, stuck_);
}

/// Of modes with the damping C between them: that of each, and the largest of one by all others.
void WaveBases::set_damping(WaveBasis& basis, std::vector<complex> const& U, int d) const {
  const int n = mean_.dofs(), m = int(basis.theta.size());
  basis.damping.assign(m, 0.0);
  if (of_order_[1].empty()) return;
  std::vector<complex> CU(U.size()), UCU(size_t(m) * m);
  for (int j = 0; j < m; ++j)
    std::ranges::copy(multiply(of_order_[1], d, mean_.sectors(), &U[size_t(j) * n]), &CU[size_t(j) * n]);
  multiply("CN", {m, m, n}, 1.0, {U.data(), n}, {CU.data(), n}, 0.0, UCU.data(), m);
  for (int j = 0; j < m; ++j) {
    double apart = 0;
    for (int i = 0; i < m; ++i) apart += i == j ? 0 : std::norm(UCU[size_t(j) * m + i]);
    basis.damped_together = std::max(basis.damped_together, std::sqrt(apart));
    basis.damping[j] = UCU[size_t(j) * m + j].real();
  }
}

}  // namespace fretwave::wheel
