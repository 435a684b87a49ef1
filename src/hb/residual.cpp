#include "hb/residual.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "fault.h"
#include "log.h"
#include "together.h"

namespace fretwave::hb {

Residual::Residual(model::Model const& model, Harmonics const& h)
    : model_(model), harmonics_(h), stiffness_(model, h), Q_(vector()) {
  for (auto const& contact : model.contacts()) {
    groups_.push_back({.contact = &contact,
                       .maps = {},
                       .aft = Aft(h, contact.law),
                       .U = {},
                       .F = {},
                       .dV = {},
                       .places = {},
                       .weights = {},
                       .dofs = {}});
    Group& group = groups_.back();
    group.maps.push_back(make_map(contact.B, 0));
    for (auto const& map : contact.ahead) group.maps.push_back(make_map(map.B, map.phase));
    group.U = make_vector(model.comm(), group.aft.columns() * h.block_size());
    group.F = like(group.U);
    group.dV.resize(size_t(group.aft.columns()) * h.block_size());
    find_weights(group);
  }
}

Residual::Map Residual::make_map(Mat B, int phase) const {
  Map map{phase, B, {}, factors(phase)};
  // of one coefficient a dof it is B itself: a static state's motions are rounded as those about it
  check(MatSetOption(B, MAT_USE_INODES, PETSC_FALSE));
  check(MatCreateMAIJ(B, harmonics_.block_size(), map.B.out()));
  return map;
}

/// e^{-i k n theta} per retained order.
std::vector<complex> Residual::factors(int phase) const {
  std::vector<complex> out;
  for (int n : harmonics_.orders()) out.push_back(std::polar(1.0, -phase * n * model_.theta()));
  return out;
}

namespace {

/// A harmonic-block vector with each order multiplied by its factor.
VecHandle multiplied(Harmonics const& h, std::vector<complex> const& factor, Vec x) {
  VecHandle y = like(x);
  multiply(h, factor, ReadArray(x).data(), WriteArray(y).data(), int(local_size(x)) / h.block_size());
  return y;
}

}  // namespace

/// U = sum_k B_k e^{-i k n theta} Q: x_{j+k} lags x_j by k theta in each period of harmonic 1.
void Residual::relative_motion(Group const& group, Vec Q, Vec U) const {
  check(MatMult(group.maps[0].B, Q, U));
  for (size_t k = 1; k < group.maps.size(); ++k)
    check(MatMultAdd(group.maps[k].B, multiplied(harmonics_, group.maps[k].factor, Q), U, U));
}

/// A vector of its own: group.U stays the point of linearisation.
VecHandle Residual::relative_motion(Group const& group, Vec Q) const {
  VecHandle U = like(group.U);
  relative_motion(group, Q, U);
  return U;
}

std::vector<VecHandle> Residual::relative_motions(Vec Q) const {
  std::vector<VecHandle> out;
  for (Group const& group : groups_) out.push_back(relative_motion(group, Q));
  return out;
}

/// R += sum_k B_k^T e^{+i k n theta} F: the force of the pair k places behind, which reaches into this
/// sector.
void Residual::add_force(Group const& group, Vec F, Vec R) const {
  check(MatMultTransposeAdd(group.maps[0].B, F, R, R));
  for (size_t k = 1; k < group.maps.size(); ++k)
    check(MatMultTransposeAdd(group.maps[k].B, multiplied(harmonics_, conjugate(group.maps[k].factor), F), R,
                              R));
}

void Residual::evaluate(Vec Q, Exponents const& e, Vec R) {
  static const log::Event forces("FwContactForce");
  if (Q != Q_) check(VecCopy(Q, Q_));
  e_ = e;
  tangents_.clear(), stiffness_.has_moved();
  check(VecSet(R, 0));
  stiffness_.multiply_add_exactly(e, Q_, R);
  for (Group& group : groups_) relative_motion(group, Q_, group.U);
  together(model_.comm(), "contact forces", [&] {
    const log::Span span(forces);
    for (Group& group : groups_) {
      fault::point("contact force");
      WriteArray F(group.F);
      group.aft.force(ReadArray(group.U).data(), e, F.data());
      if (fault::value("contact force") && group.aft.columns()) F[0] = std::nan("");
    }
  });
  for (Group& group : groups_) add_force(group, group.F, R);
}

void Residual::product(Vec dQ, Exponents const* de, Vec dR) {
  check(VecSet(dR, 0));
  if (dQ && exactly_) stiffness_.multiply_add_exactly(e_, dQ, dR);
  if (dQ && !exactly_) stiffness_.multiply_add(e_, dQ, dR);
  if (de) stiffness_.derivative_multiply_add(e_, *de, Q_, dR);
  for (Group& group : groups_) contact_product(group, dQ, de, dR);
}

void Residual::transposed_product(Vec dR, Vec dQ) {
  check(VecSet(dQ, 0));
  stiffness_.transposed_multiply_add(e_, dR, dQ);
  if (tangents_.empty()) tangents_ = pair_tangents();
  for (size_t g = 0; g < groups_.size(); ++g) transposed_contact_product(groups_[g], tangents_[g], dR, dQ);
}

/// dF/dQ = S^T D S with S = sum_k B_k e^{-i k n theta} and D the pairs' dF/dU: its transpose is S^T D^T S.
void Residual::transposed_contact_product(Group& group, PairTangents const& tangents, Vec dR, Vec dQ) {
  VecHandle U = relative_motion(group, dR), F = like(group.F);
  const size_t ld = size_t(tangents.components) * harmonics_.block_size();
  {
    const ReadArray u(U);
    const WriteArray f(F);
    std::fill_n(f.data(), tangents.pairs * ld, 0.0);
    double const* D = tangents.D.data();
    for (size_t first = 0; first < tangents.pairs * ld; first += ld)
      for (size_t row = 0; row < ld; ++row)
        for (size_t col = 0; col < ld; ++col) f.data()[first + col] += *D++ * u.data()[first + row];
  }
  add_force(group, F, dQ);
}

/// What `hold_means` adds to a pair's stiffness: where there is friction, along it.
double Residual::holding(Group const& group, int pair, int component) const {
  contact::Law const& law = *group.contact->law;
  if (held_share_ == 0 || harmonics_.orders()[0] != 0 || harmonics_.count() == 1 || component == law.normal())
    return 0;
  const contact::LinearPair friction = law.linear_pair(pair);
  if (!(friction.friction_coefficient > 0 || friction.friction_limit > 0)) return 0;
  return held_share_ * std::min(law.stuck_stiffness(component, pair), stiffness_held_to_);
}

// dV = s dU + ds U: the velocity's coefficients are s U (Laxalde et al. 2008, step 1 of the AFT)
void Residual::contact_product(Group& group, Vec dQ, Exponents const* de, Vec dR) {
  static const log::Event products("FwContactJacob");
  const log::Span span(products);
  const int columns = group.aft.columns();
  VecHandle dU = like(group.U), dF = like(group.F);
  if (dQ)
    relative_motion(group, dQ, dU);
  else
    check(VecSet(dU, 0));
  {
    ReadArray U(group.U), dU_array(dU);
    multiply(harmonics_, e_.s, dU_array.data(), group.dV.data(), columns);
    if (de) {
      std::vector<double> share(group.dV.size());
      multiply(harmonics_, de->s, U.data(), share.data(), columns);
      for (size_t k = 0; k < share.size(); ++k) group.dV[k] += share[k];
    }
    const WriteArray F(dF);
    group.aft.product(dU_array.data(), group.dV.data(), F.data());
    const int d = group.contact->law->components(), m = harmonics_.block_size();
    for (int k = 0; k < columns; ++k)
      F[size_t(k) * m] += holding(group, k / d, k % d) * dU_array[size_t(k) * m];
  }
  add_force(group, dF, dR);
}

namespace {

/// sum_n>0 weight(n) q_n^H p_n of this rank, q_n = Qc_n - i Qs_n.
template <class Weight>
complex product_of(Harmonics const& h, Vec q, Vec p, Weight weight) {
  ReadArray a(q), b(p);
  complex sum = 0;
  for (PetscInt first = 0; first < local_size(q); first += h.block_size())
    for (int i = 0; i < h.count(); ++i) {
      if (h.orders()[i] == 0) continue;
      const PetscInt k = first + h.offset(i);
      sum += weight(h.orders()[i]) * std::conj(complex(a[k], -a[k + 1])) * complex(b[k], -b[k + 1]);
    }
  return sum;
}

/// pi sum_n n q_n^H p_n: its imaginary part is the work of -p over a period.
complex period_product(Harmonics const& h, Vec q, Vec p) {
  return std::numbers::pi * product_of(h, q, p, [](int n) { return double(n); });
}

}  // namespace

EnergyBalance Residual::energy() {
  double sums[4] = {};
  for (Group& group : groups_) sums[0] += period_product(harmonics_, group.U, group.F).imag();
  VecHandle p = like(Q_);
  for (int order = 0; order < 3; ++order) {
    check(VecSet(p, 0));
    stiffness_.multiply_add(e_, Q_, p, order);
    const complex work = period_product(harmonics_, Q_, p);
    sums[3 - order] = order == 0 ? work.real() : order == 1 ? work.imag() : -work.imag();
  }
  MPI_Allreduce(MPI_IN_PLACE, sums, 4, MPI_DOUBLE, MPI_SUM, model_.comm());
  return {.contact = sums[0], .damping = sums[2], .modal = sums[1], .stored = sums[3]};
}

double Residual::mechanical_energy(Vec Q, Exponents const& e) {
  Exponents sizes{.s = e.s};
  for (complex& s : sizes.s) s = std::abs(s);
  double sum = 0;
  for (int order : {0, 2}) {
    VecHandle p = like(Q);
    check(VecSet(p, 0));
    stiffness_.multiply_add(sizes, Q, p, order);
    sum += product_of(harmonics_, Q, p, [](int) { return 0.25; }).real();
  }
  MPI_Allreduce(MPI_IN_PLACE, &sum, 1, MPI_DOUBLE, MPI_SUM, model_.comm());
  return sum;
}

/// Of the dof of each weight, on whichever rank. Collective.
std::vector<double> Residual::of_weights(Group const& group, std::vector<double> const& of_dofs) const {
  std::vector<double> out(group.weights.size());
  check(PetscSFBcastBegin(group.dofs, MPI_DOUBLE, of_dofs.data(), out.data(), MPI_REPLACE));
  check(PetscSFBcastEnd(group.dofs, MPI_DOUBLE, of_dofs.data(), out.data(), MPI_REPLACE));
  return out;
}

double Residual::rounding() const {
  const int m = harmonics_.block_size();
  const ReadArray Q(Q_);
  const auto size = [m](double const* block) {
    double square = 0;
    for (int k = 0; k < m; ++k) square += block[k] * block[k];
    return std::sqrt(square);
  };
  std::vector<double> moved(model_.local_dofs());
  for (size_t dof = 0; dof < moved.size(); ++dof) moved[dof] = size(&Q.data()[dof * m]);
  double square = 0;
  for (Group const& group : groups_) {
    contact::Law const& law = *group.contact->law;
    ReadArray F(group.F);
    std::vector<double> motion(group.aft.columns(), 0.0);
    const auto of_dofs = of_weights(group, moved);
    for (size_t k = 0; k < of_dofs.size(); ++k) {
      Weight const& w = group.weights[k];
      motion[size_t(w.pair) * law.components() + w.component] += std::abs(w.value) * of_dofs[k];
    }
    for (size_t row = 0; row < motion.size(); ++row) {
      const int pair = int(row) / law.components(), component = int(row) % law.components();
      const double k = group.aft.stiffness(pair, component);
      const double force = size(&F.data()[row * m]) + (std::isfinite(k) ? k * motion[row] : 0);
      square += force * force;
    }
  }
  MPI_Allreduce(MPI_IN_PLACE, &square, 1, MPI_DOUBLE, MPI_SUM, model_.comm());
  return std::hypot(stiffness_.rounding(e_, Q_), std::numeric_limits<double>::epsilon() * std::sqrt(square));
}

}  // namespace fretwave::hb
