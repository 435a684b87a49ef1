#include "hb/static_preload.h"

#include <algorithm>

namespace fretwave::hb {

StaticPreload::StaticPreload(model::Model const& model, Vec P, double size, double stiffness)
    : model_(model), size_(size), stiffness_(stiffness), K_(model.sum(0)) {
  for (auto* v : {&P_, &x_, &dx_, &force_}) *v = model.displacement();
  check(VecCopy(P, P_));
  for (auto const& contact : model.contacts()) {
    const size_t n = size_t(contact.law->components()) * contact.law->pairs();
    groups_.push_back({&contact, {}, {}, std::vector<double>(n), std::vector<double>(n), {}});
    check(MatCreateVecs(contact.B, nullptr, groups_.back().u.out()));
    groups_.back().f = like(groups_.back().u);
    contact.law->rest(std::vector<double>(n, 0.0).data());  // untouched
  }
}

namespace {

/// Rows of B (pair by pair) to the laws' order (component by component), or back.
void to_law(contact::Law const& law, double const* rows, double* out) {
  const int d = law.components(), n = law.pairs();
  for (int i = 0; i < n; ++i)
    for (int c = 0; c < d; ++c) out[c * n + i] = rows[i * d + c];
}

void to_rows(contact::Law const& law, double const* in, double* rows) {
  const int d = law.components(), n = law.pairs();
  for (int i = 0; i < n; ++i)
    for (int c = 0; c < d; ++c) rows[i * d + c] = in[c * n + i];
}

}  // namespace

contact::Motion StaticPreload::motion_of(Group const& group) const {
  return {.samples = 1, .components = group.contact->law->components(), .pairs = group.contact->law->pairs(), .u = group.motion.data(), .v = nullptr, .step = 0};
}

/// force_ += B^T f(B x)
void StaticPreload::contact_force(Group& group, Vec x) {
  auto const& law = *group.contact->law;
  check(MatMult(group.contact->B, x, group.u));
  {
    ReadArray u(group.u);
    to_law(law, u.data(), group.motion.data());
  }
  law.force(motion_of(group), group.force.data(), group.record);
  {
    WriteArray f(group.f);
    to_rows(law, group.force.data(), f.data());
  }
  check(MatMultTransposeAdd(group.contact->B, group.f, force_, force_));
}

void StaticPreload::evaluate(Vec y) {
  x_ = displacement(y);
  check(MatMult(K_, x_, force_));
  for (Group& group : groups_) contact_force(group, x_);
  check(VecAXPY(force_, -solve::last_entry(y), P_));
  check(VecScale(force_, 1 / (stiffness_ * size_)));
}

void StaticPreload::residual(Vec y, Vec r) {
  evaluate(y);
  ReadArray in(force_);
  WriteArray out(r);
  std::copy_n(in.data(), local_equations(), out.data());
}

void StaticPreload::product(Vec y, Vec dy, Vec dr) {
  evaluate(y);
  dx_ = displacement(dy);
  check(MatMult(K_, dx_, force_));
  for (Group& group : groups_) {
    auto const& law = *group.contact->law;
    std::vector<double> du(group.motion.size()), df(group.motion.size());
    check(MatMult(group.contact->B, dx_, group.u));
    to_law(law, ReadArray(group.u).data(), du.data());
    law.product(motion_of(group), group.record, du.data(), nullptr, df.data());
    {
      WriteArray f(group.f);
      to_rows(law, df.data(), f.data());
    }
    check(MatMultTransposeAdd(group.contact->B, group.f, force_, force_));
  }
  check(VecAXPY(force_, -solve::last_entry(dy), P_));
  check(VecScale(force_, 1 / (stiffness_ * size_)));
  check(VecCopy(force_, dr));
}

void StaticPreload::pattern(std::vector<PetscInt>& rows, std::vector<PetscInt>& cols) {
  const auto place = [&](PetscInt row, PetscInt col, double) { rows.push_back(row), cols.push_back(col); };
  for_each_entry(place);
}

void StaticPreload::values(Vec y, std::span<double> v) {
  evaluate(y);
  for (Group& group : groups_) tangent(group);
  double* next = v.data();
  for_each_entry([&](PetscInt, PetscInt, double value) { *next++ = value; });
}

}  // namespace fretwave::hb
