#include "hb/residual.h"

namespace fretwave::hb {

Residual::Residual(model::Model const& model, Harmonics const& h)
    : model_(model), harmonics_(h), stiffness_(model, h), Q_(vector()) {
  for (auto const& contact : model.contacts()) {
    groups_.push_back({.contact = &contact,
                       .B = {},
                       .aft = Aft(h, contact.law),
                       .U = {},
                       .F = {},
                       .dV = {},
                       .places = {},
                       .weights = {}});
    Group& group = groups_.back();
    check(MatCreateMAIJ(contact.B, h.block_size(), group.B.out()));
    group.U = make_vector(model.comm(), group.aft.columns() * h.block_size());
    group.F = like(group.U);
    group.dV.resize(size_t(group.aft.columns()) * h.block_size());
    find_weights(group);
  }
}

void Residual::evaluate(Vec Q, Exponents const& e, Vec R) {
  if (Q != Q_) check(VecCopy(Q, Q_));
  e_ = e;
  check(VecSet(R, 0));
  stiffness_.multiply_add(e, Q_, R);
  for (Group& group : groups_) {
    check(MatMult(group.B, Q_, group.U));
    group.aft.force(ReadArray(group.U).data(), e, WriteArray(group.F).data());
    check(MatMultTransposeAdd(group.B, group.F, R, R));
  }
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
    check(MatMult(group.B, dQ, dU));
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
  check(MatMultTransposeAdd(group.B, dF, dR, dR));
}

/// Entries of this rank's rows of B.
void Residual::find_weights(Group& group) {
  const int d = group.contact->law->components();
  PetscInt begin;
  check(MatGetOwnershipRange(group.contact->B, &begin, nullptr));
  for (int row = 0; row < group.aft.columns(); ++row) {
    PetscInt n;
    PetscInt const* dofs;
    PetscScalar const* values;
    check(MatGetRow(group.contact->B, begin + row, &n, &dofs, &values));
    for (PetscInt k = 0; k < n; ++k) group.weights.push_back({row / d, row % d, dofs[k], values[k]});
    check(MatRestoreRow(group.contact->B, begin + row, &n, &dofs, &values));
  }
}

void Residual::contact_pattern(Group& group, std::vector<PetscInt>& rows, std::vector<PetscInt>& cols) {
  const PetscInt m = harmonics_.block_size();
  auto const& weights = group.weights;
  for (size_t first = 0, last = 0; first < weights.size(); first = last) {
    while (last < weights.size() && weights[last].pair == weights[first].pair) ++last;
    for (size_t a = first; a < last; ++a)
      for (size_t b = first; b < last; ++b) {
        group.places.push_back({weights[a].pair, weights[a].component, weights[b].component,
                                weights[a].value * weights[b].value});
        for (PetscInt i = 0; i < m; ++i)
          for (PetscInt j = 0; j < m; ++j)
            rows.push_back(weights[a].dof * m + i), cols.push_back(weights[b].dof * m + j);
      }
  }
}

std::vector<PairTangents> Residual::pair_tangents() {
  std::vector<PairTangents> out;
  for (Group& group : groups_) {
    const int d = group.contact->law->components(), pairs = group.contact->law->pairs();
    const size_t ld = size_t(d) * harmonics_.block_size();
    out.push_back({pairs, d, group.weights, std::vector<double>(pairs * ld * ld)});
    group.aft.blocks(e_, out.back().D.data());
  }
  return out;
}

void Residual::pattern(std::vector<PetscInt>& rows, std::vector<PetscInt>& cols) {
  stiffness_.pattern(rows, cols);
  for (Group& group : groups_) {
    group.places.clear();
    contact_pattern(group, rows, cols);
  }
}

double* Residual::values(double scale, double* v) {
  v = stiffness_.values(e_, scale, v);
  const size_t m = harmonics_.block_size();
  const auto tangents = pair_tangents();
  for (size_t g = 0; g < groups_.size(); ++g) {
    const size_t ld = tangents[g].components * m;
    for (auto const& place : groups_[g].places) {  // B^T (dF/dU) B
      double const* block = tangents[g].D.data() + (place.pair * ld + place.row * m) * ld + place.col * m;
      for (size_t i = 0; i < m; ++i)
        for (size_t j = 0; j < m; ++j) *v++ = scale * place.value * block[i * ld + j];
    }
  }
  return v;
}

/// A vector of its own: group.U stays the point of linearisation.
VecHandle Residual::relative_motion(Group& group, Vec Q) const {
  VecHandle U = like(group.U);
  check(MatMult(group.B, Q, U));
  return U;
}

ContactSummary Residual::summarise(Vec Q, Exponents const& e) {
  double sums[8] = {};
  for (Group& group : groups_) {
    const auto s = group.aft.summarise(ReadArray(relative_motion(group, Q)).data(), e);
    const double parts[8] = {s.stick, s.slip, s.open, s.truncated, s.total, s.aliased, s.retained, s.work};
    for (int i = 0; i < 8; ++i) sums[i] += parts[i];
  }
  MPI_Allreduce(MPI_IN_PLACE, sums, 8, MPI_DOUBLE, MPI_SUM, model_.comm());
  return {sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6], sums[7]};
}

void Residual::settle(Vec Q) {
  for (Group& group : groups_) {
    contact::Law& law = *group.contact->law;
    const int d = law.components(), n = law.pairs();
    VecHandle U = relative_motion(group, Q);
    ReadArray blocks(U);
    std::vector<double> u(size_t(d) * n);
    for (int i = 0; i < n; ++i)
      for (int c = 0; c < d; ++c) u[size_t(c) * n + i] = blocks[(i * d + c) * harmonics_.block_size()];
    law.rest(u.data());
  }
}

std::vector<ContactPeriod> Residual::periods(Vec Q, Exponents const& e) {
  std::vector<ContactPeriod> out;
  for (Group& group : groups_) {
    out.push_back(group.aft.period(ReadArray(relative_motion(group, Q)).data(), e));
  }
  return out;
}

}  // namespace fretwave::hb
