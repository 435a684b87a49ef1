/// Derivatives of a harmonic problem: products, and the entries of its matrix.
#include <algorithm>

#include "hb/harmonic_problem.h"

namespace fretwave::hb {

// Q = Q_static + a q: dQ = a (dq + q dlog a); r = R / (k a): dr = dR / (k a) - r dlog a
void HarmonicProblem::product(Vec y, Vec dy, Vec dr) {
  linearise(y);
  const auto dz = scalars(dy);
  {
    ReadArray in(dy);
    std::copy_n(in.data(), local_block_, WriteArray(dQ_).data());
  }
  const auto along = unfolding_.components(dQ_);
  residual_.product(dQ_, nullptr, dR_);
  check(VecScale(dR_, 1 / stiffness_));
  for (int j = 0; j < scalars_; ++j) check(VecAXPY(dR_, dz[j], column(j)));
  WriteArray out(dr);
  ReadArray in(dR_);
  std::copy_n(in.data(), local_block_, out.data());
  border(dz, along, out.data());
}

// J = [[dR/dQ / k, G, C], [W, 0, 0], [G^T, 0, 0]], G the unfolding's vectors, C the scalars' columns, W the
// row on the fundamental; rows below the first are on the last rank.
void HarmonicProblem::transposed_product(Vec y, Vec dr, Vec dy) {
  linearise(y);
  const int beside = normalised() ? unfolding_.count() + scalars_ - 1 : 0;
  std::vector<double> below(beside, 0.0);
  VecHandle p = like(q_);
  {
    const ReadArray in(dr);
    std::copy_n(in.data(), local_block_, WriteArray(p).data());
    if (last_rank()) std::copy_n(in.data() + local_block_, beside, below.begin());
  }
  MPI_Bcast(below.data(), beside, MPI_DOUBLE, comm_size(comm()) - 1, comm());
  std::vector<double> z = unfolding_.components(p);
  for (int j = 0; j < scalars_; ++j) {
    z.push_back(0);
    check(VecDot(column(j), p, &z.back()));
  }
  residual_.transposed_product(p, dR_);
  check(VecScale(dR_, 1 / stiffness_));
  const ReadArray in(dR_);
  WriteArray out(dy);
  std::copy_n(in.data(), local_block_, out.data());
  for (int j = 0; normalised() && j < 2; ++j)
    for (auto const& [dof, weight] : mine())
      out[(dof - model().first_dof()) * harmonics().block_size() +
          harmonics().offset(harmonics().fundamental()) + j] += weight * below[j];
  if (beside > 2) unfolding_.add(below.data() + 2, out.data());
  if (last_rank()) std::ranges::copy(z, out.data() + local_block_);
}

void HarmonicProblem::pattern(std::vector<PetscInt>& rows, std::vector<PetscInt>& cols) {
  residual_.pattern(rows, cols);
  const PetscInt first = model().first_dof() * harmonics().block_size(),
                 all = model().dofs() * harmonics().block_size();
  for (int j = 0; j < unfolding_.count() + scalars_; ++j)
    for (PetscInt i = 0; i < local_block_; ++i) rows.push_back(first + i), cols.push_back(all + j);
  for (int j = 0; j < unfolding_.count(); ++j)
    for (PetscInt i = 0; i < local_block_; ++i) rows.push_back(all + 2 + j), cols.push_back(first + i);
  if (!normalised()) return;
  for (int j = 0; j < 2; ++j)
    for (auto const& [dof, weight] : mine())
      rows.push_back(all + j),
          cols.push_back(dof * harmonics().block_size() + harmonics().offset(harmonics().fundamental()) + j);
}

/// dR += dR/d(stand-off) d(stand-off)/dz_j.
void HarmonicProblem::add_stand_off(int j, Vec dR) {
  if (j != scalars_ - 1 || motion_.dstand_off == 0) return;
  VecHandle wider = like(dR);
  residual_.stand_off_product(wider);
  check(VecAXPY(dR, motion_.dstand_off, wider));
}

/// dr/dz_j at the point of linearisation, on the harmonic rows.
Vec HarmonicProblem::column(int j) {
  if (columns_[j]) return columns_[j];
  VecHandle out = like(q_);
  const double dlog = motion_.dlog_amplitude[j];
  check(VecCopy(q_, dQ_));
  check(VecScale(dQ_, dlog * motion_.amplitude));
  residual_.product(dlog ? Vec(dQ_) : nullptr, &motion_.dexponents[j], out);
  check(VecAXPY(out, -dload(j), excitation_));
  add_stand_off(j, out);
  check(VecAXPBY(out, -dlog, 1 / (stiffness_ * motion_.amplitude), R_));
  return columns_[j] = std::move(out);
}

void HarmonicProblem::values(Vec y, std::span<double> v) {
  linearise(y);
  double* next = residual_.values(1 / stiffness_, v.data());
  const auto add = [&](Vec x) { next = std::copy_n(ReadArray(x).data(), local_block_, next); };
  for (auto const& g : unfolding_.vectors()) add(g);
  for (int j = 0; j < scalars_; ++j) add(column(j));
  for (auto const& g : unfolding_.vectors()) add(g);
  for (int j = 0; normalised() && j < 2; ++j)
    for (auto const& [dof, weight] : mine()) *next++ = weight;
}

Vec HarmonicProblem::scalar_column(Vec y, int j) {
  linearise(y);
  return column(j);
}

std::vector<PairTangents> HarmonicProblem::pair_tangents(Vec y) {
  linearise(y);
  auto contacts = residual_.pair_tangents();
  for (auto& contact : contacts)
    for (double& d : contact.D) d /= stiffness_;
  return contacts;
}

double HarmonicProblem::jacobian_entries() const {
  const double m = harmonics().block_size();
  double entries = 0, contact = 0;
  for (auto const& term : model().terms()) {
    MatInfo info;
    check(MatGetInfo(term.A, MAT_GLOBAL_SUM, &info));
    entries += info.nz_used * 2 * m;
  }
  for (auto const& group : model().contacts()) {
    MatInfo info;
    PetscInt rows;
    check(MatGetSize(group.B, &rows, nullptr));
    check(MatGetInfo(group.B, MAT_GLOBAL_SUM, &info));
    if (!rows) continue;
    const double of_a_pair = info.nz_used / double(rows) * group.law->components();
    contact += double(rows) / group.law->components() * of_a_pair * of_a_pair * m * m;
  }
  return entries + contact;
}

}  // namespace fretwave::hb
