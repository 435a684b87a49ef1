/// Entries of dR/dQ: which they are, and the linearised contact in them.
#include <algorithm>

#include "fault.h"
#include "hb/residual.h"
#include "log.h"
#include "together.h"

namespace fretwave::hb {

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
  std::vector<PetscInt> dofs;
  for (Weight const& w : group.weights) dofs.push_back(w.dof);
  PetscLayout layout;
  check(MatGetLayouts(group.maps[0].rows, nullptr, &layout));
  check(PetscSFCreate(model_.comm(), group.dofs.out()));
  check(PetscSFSetGraphLayout(group.dofs, layout, PetscInt(dofs.size()), nullptr, PETSC_COPY_VALUES,
                              dofs.data()));
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

std::vector<PairTangents> Residual::pair_tangents() {
  static const log::Event tangents("FwContactBlocks");
  const log::Span span(tangents);
  std::vector<PairTangents> out;
  together(model_.comm(), "linearising contacts", [&] {
    fault::point("contact tangents");
    for (Group& group : groups_) {
      const int d = group.contact->law->components(), pairs = group.contact->law->pairs();
      const size_t ld = size_t(d) * harmonics_.block_size();
      out.push_back({pairs, d, group.weights, std::vector<double>(pairs * ld * ld)});
      group.aft.blocks(e_, out.back().D.data());
      for (size_t row = 0; row < size_t(d) * pairs; ++row)
        out.back().D[row * harmonics_.block_size() * ld + row % d * harmonics_.block_size()] +=
            holding(group, int(row) / d, int(row) % d);
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

}  // namespace fretwave::hb
