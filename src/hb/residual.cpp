#include "hb/residual.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "error.h"
#include "fault.h"
#include "scramble.h"
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
                       .weights = {}});
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

std::vector<complex> conjugate(std::vector<complex> factor) {
  for (complex& c : factor) c = std::conj(c);
  return factor;
}

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
  if (Q != Q_) check(VecCopy(Q, Q_));
  e_ = e;
  check(VecSet(R, 0));
  stiffness_.multiply_add(e, Q_, R);
  for (Group& group : groups_) relative_motion(group, Q_, group.U);
  together(model_.comm(), "contact forces", [&] {
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
  if (dQ) stiffness_.multiply_add(e_, dQ, dR);
  if (de) stiffness_.derivative_multiply_add(e_, *de, Q_, dR);
  for (Group& group : groups_) contact_product(group, dQ, de, dR);
}

// dV = s dU + ds U: the velocity's coefficients are s U (Laxalde et al. 2008, step 1 of the AFT)
void Residual::contact_product(Group& group, Vec dQ, Exponents const* de, Vec dR) {
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
    group.aft.product(dU_array.data(), group.dV.data(), WriteArray(dF).data());
  }
  add_force(group, dF, dR);
}

void Residual::expect_depths(PerContact const& depth) const {
  if (depth.size() != groups_.size())
    throw InputError("worn depths are given for another number of contacts", std::to_string(depth.size()),
                     std::to_string(groups_.size()), "give a list, may be empty, for each contact");
  for (size_t k = 0; k < groups_.size(); ++k) {
    contact::Law const& law = *groups_[k].contact->law;
    if (!depth[k].empty() && (!law.wears() || int(depth[k].size()) != law.pairs()))
      throw InputError(
          "a contact cannot take these worn depths",
          "contact '" + groups_[k].contact->name + "', " + std::to_string(depth[k].size()) + " depths",
          law.wears() ? std::to_string(law.pairs()) + " depths" : "a law with a normal direction",
          "wear contacts with law coulomb_3d");
  }
}

void Residual::wear(PerContact const& depth) {
  together(model_.comm(), "wearing contacts", [&] {
    fault::point("wear");
    expect_depths(depth);
  });
  for (size_t k = 0; k < groups_.size(); ++k) {
    contact::Law& law = *groups_[k].contact->law;
    // on a rank without pairs too: all must agree that linearisations are of other depths
    law.wear(depth[k].empty() ? nullptr : depth[k].data());
  }
}

void Residual::gap_product(PerContact const& dgap, Vec dR) {
  together(model_.comm(), "wearing contacts", [&] { expect_depths(dgap); });
  gaps_product(dgap, dR);
}

void Residual::gaps_product(PerContact const& dgap, Vec dR) {
  check(VecSet(dR, 0));
  for (size_t k = 0; k < groups_.size(); ++k) {
    Group& group = groups_[k];
    if (!group.contact->law->stands_off()) continue;
    VecHandle dF = like(group.F);
    std::vector<double> gaps = dgap[k];
    gaps.resize(size_t(group.contact->law->pairs()), 0.0);  // an empty list: this contact does not wear
    group.aft.gap_product(gaps.data(), WriteArray(dF).data());
    add_force(group, dF, dR);
  }
}

void Residual::stand_off(double distance) {
  for (Group const& group : groups_) group.contact->law->stand_off(distance);
}

void Residual::stand_off_product(Vec dR) {
  PerContact dgap(groups_.size());
  for (size_t k = 0; k < groups_.size(); ++k)
    if (groups_[k].contact->law->stands_off()) dgap[k].assign(groups_[k].contact->law->pairs(), 1.0);
  gaps_product(dgap, dR);
}

std::vector<Wearing> Residual::wearing(Vec Q, Exponents const& e) {
  std::vector<Wearing> out;
  const auto U = relative_motions(Q);
  together(model_.comm(), "what wears the contacts", [&] {
    fault::point("wearing");
    for (size_t k = 0; k < groups_.size(); ++k)
      out.push_back(groups_[k].aft.wearing(ReadArray(U[k]).data(), e));
  });
  return out;
}

namespace {

/// pi sum_n n q_n^H p_n of this rank, q_n = Qc_n - i Qs_n: its imaginary part is the work of -p over a
/// period.
complex period_product(Harmonics const& h, Vec q, Vec p) {
  ReadArray a(q), b(p);
  complex sum = 0;
  for (PetscInt first = 0; first < local_size(q); first += h.block_size())
    for (int i = 0; i < h.count(); ++i) {
      if (h.orders()[i] == 0) continue;
      const PetscInt k = first + h.offset(i);
      sum += double(h.orders()[i]) * std::conj(complex(a[k], -a[k + 1])) * complex(b[k], -b[k + 1]);
    }
  return std::numbers::pi * sum;
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

/// Entries of this rank's rows of all maps, pair by pair.
void Residual::find_weights(Group& group) {
  const int d = group.contact->law->components();
  for (auto const& [phase, B, blocked, factor] : group.maps) {
    PetscInt begin;
    check(MatGetOwnershipRange(B, &begin, nullptr));
    for_entries(B, [&](PetscInt row, PetscInt dof, double value) {
      const int own = int(row - begin);
      group.weights.push_back({own / d, own % d, dof, value, phase});
    });
  }
  std::stable_sort(group.weights.begin(), group.weights.end(),
                   [](auto const& a, auto const& b) { return a.pair < b.pair; });
}

template <class Body>
void Residual::Group::each_couple(Body body) const {
  for (size_t first = 0, last = 0; first < weights.size(); first = last) {
    while (last < weights.size() && weights[last].pair == weights[first].pair) ++last;
    for (size_t a = first; a < last; ++a)
      for (size_t b = first; b < last; ++b) body(weights[a], weights[b]);
  }
}

void Residual::contact_pattern(Group& group, std::vector<PetscInt>& rows, std::vector<PetscInt>& cols) {
  const PetscInt m = harmonics_.block_size();
  group.each_couple([&](auto const& a, auto const& b) {
    group.places.push_back({a.pair, a.component, b.component, a.value * b.value, a.phase, b.phase});
    for (PetscInt i = 0; i < m; ++i)
      for (PetscInt j = 0; j < m; ++j) rows.push_back(a.dof * m + i), cols.push_back(b.dof * m + j);
  });
}

double Residual::rounding() const {
  const int m = harmonics_.block_size();
  ReadArray Q(Q_);
  const auto size = [m](double const* block) {
    double square = 0;
    for (int k = 0; k < m; ++k) square += block[k] * block[k];
    return std::sqrt(square);
  };
  double square = 0;
  for (Group const& group : groups_) {
    contact::Law const& law = *group.contact->law;
    ReadArray F(group.F);
    std::vector<double> motion(group.aft.columns(), 0.0);
    for (Weight const& w : group.weights) {
      const PetscInt dof = w.dof - model_.first_dof();  // those of other ranks are left out: an estimate
      if (dof >= 0 && dof < model_.local_dofs())
        motion[size_t(w.pair) * law.components() + w.component] +=
            std::abs(w.value) * size(&Q.data()[dof * m]);
    }
    for (size_t row = 0; row < motion.size(); ++row) {
      const double k = law.stuck_stiffness(int(row % law.components()), int(row / law.components()));
      const double force = size(&F.data()[row * m]) + (std::isfinite(k) ? k * motion[row] : 0);
      square += force * force;
    }
  }
  MPI_Allreduce(MPI_IN_PLACE, &square, 1, MPI_DOUBLE, MPI_SUM, model_.comm());
  return std::hypot(stiffness_.rounding(e_, Q_), std::numeric_limits<double>::epsilon() * std::sqrt(square));
}

std::vector<PairTangents> Residual::pair_tangents() {
  std::vector<PairTangents> out;
  together(model_.comm(), "linearising contacts", [&] {
    fault::point("contact tangents");
    for (Group& group : groups_) {
      const int d = group.contact->law->components(), pairs = group.contact->law->pairs();
      const size_t ld = size_t(d) * harmonics_.block_size();
      out.push_back({pairs, d, group.weights, std::vector<double>(pairs * ld * ld)});
      group.aft.blocks(e_, out.back().D.data());
      if (fault::value("contact tangents") && !out.back().D.empty()) out.back().D[0] = std::nan("");
    }
  });
  return out;
}

void Residual::pattern(std::vector<PetscInt>& rows, std::vector<PetscInt>& cols) {
  stiffness_.pattern(rows, cols);
  for (Group& group : groups_) {
    group.places.clear();
    contact_pattern(group, rows, cols);
  }
}

/// P_row^H D P_col of an m x m block, P the phase factors: rows and columns are harmonic blocks themselves.
void Residual::turn(int row_phase, int col_phase, double* block) const {
  const int m = harmonics_.block_size();
  std::vector<double> work(size_t(m) * m);
  const auto transpose = [m](double const* in, double* out) {
    for (int i = 0; i < m; ++i)
      for (int j = 0; j < m; ++j) out[size_t(j) * m + i] = in[size_t(i) * m + j];
  };
  // a row d of D becomes P^T d, which is the factor's conjugate times d
  multiply(harmonics_, conjugate(factors(col_phase)), block, work.data(), m);
  transpose(work.data(), block);
  multiply(harmonics_, conjugate(factors(row_phase)), block, work.data(), m);
  transpose(work.data(), block);
}

double* Residual::values(double scale, double* v) {
  v = stiffness_.values(e_, scale, v);
  const size_t m = harmonics_.block_size();
  const auto tangents = pair_tangents();
  for (size_t g = 0; g < groups_.size(); ++g) {
    const size_t ld = tangents[g].components * m;
    for (auto const& place : groups_[g].places) {  // B^H (dF/dU) B
      double const* from = tangents[g].D.data() + (place.pair * ld + place.row * m) * ld + place.col * m;
      for (size_t i = 0; i < m; ++i)
        for (size_t j = 0; j < m; ++j) v[i * m + j] = scale * place.value * from[i * ld + j];
      if (place.row_phase || place.col_phase) turn(place.row_phase, place.col_phase, v);
      v += m * m;
    }
  }
  return v;
}

ContactSummary Residual::summarise(Vec Q, Exponents const& e) {
  double sums[8] = {}, largest[2] = {};
  const auto U = relative_motions(Q);
  together(model_.comm(), "reading contacts", [&] {
    fault::point("summary");
    for (size_t k = 0; k < groups_.size(); ++k) {
      const auto s = groups_[k].aft.summarise(ReadArray(U[k]).data(), e);
      const double parts[8] = {s.stick, s.slip, s.open, s.truncated, s.total, s.aliased, s.retained, s.work};
      for (int i = 0; i < 8; ++i) sums[i] += parts[i];
      largest[0] = std::max(largest[0], s.unclosed), largest[1] = std::max(largest[1], s.path);
    }
  });
  MPI_Allreduce(MPI_IN_PLACE, sums, 8, MPI_DOUBLE, MPI_SUM, model_.comm());
  MPI_Allreduce(MPI_IN_PLACE, largest, 2, MPI_DOUBLE, MPI_MAX, model_.comm());
  return {sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6], sums[7], largest[0], largest[1]};
}

std::uint64_t Residual::piece() const {
  std::uint64_t sum = 0;
  for (size_t g = 0; g < groups_.size(); ++g) sum += scrambled(groups_[g].aft.piece() + g);
  sum = scrambled(sum + std::uint64_t(comm_rank(model_.comm())));
  MPI_Allreduce(MPI_IN_PLACE, &sum, 1, MPI_UINT64_T, MPI_SUM, model_.comm());
  return sum;
}

unsigned Residual::contact_version() const {
  unsigned sum = 0;
  for (Group const& group : groups_) sum += group.contact->law->version();
  return sum;
}

void Residual::place(PerContact const& sliders, unsigned owner) {
  for (size_t k = 0; k < groups_.size(); ++k) groups_[k].contact->law->place(sliders[k], owner);
}

void Residual::settle(Vec Q, PerContact const& from) {
  const auto U = relative_motions(Q);
  together(model_.comm(), "settling contacts", [&] {
    fault::point("settle");
    for (size_t k = 0; k < groups_.size(); ++k) {
      contact::Law& law = *groups_[k].contact->law;
      const int d = law.components(), n = law.pairs();
      ReadArray blocks(U[k]);
      std::vector<double> u(size_t(d) * n);
      for (int i = 0; i < n; ++i)
        for (int c = 0; c < d; ++c) u[size_t(c) * n + i] = blocks[(i * d + c) * harmonics_.block_size()];
      law.rest(u.data(), from.empty() ? std::vector<double>{} : from[k]);
    }
  });
}

std::vector<ContactPeriod> Residual::periods(Vec Q, Exponents const& e) {
  std::vector<ContactPeriod> out;
  const auto U = relative_motions(Q);
  together(model_.comm(), "contact samples", [&] {
    fault::point("contact samples");
    for (size_t k = 0; k < groups_.size(); ++k)
      out.push_back(groups_[k].aft.told_period(ReadArray(U[k]).data(), e));
  });
  return out;
}

}  // namespace fretwave::hb
